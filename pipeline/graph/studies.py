"""What a sweep's page is asked to chart: accuracy against speed (``tradeoff``), maps over two settings (``maps``)."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

from pipeline.errors import InputError, InputErrors, nearest
from pipeline.graph.annotations import Annotation, check_setting, parse_annotation
from pipeline.graph.config import Configuration
from pipeline.graph.nodes import Graph

MOST_PANEL_SETTINGS = 2


@dataclass(frozen=True)
class Tradeoff:
    """Errors against the seconds that a node takes, or several one after the other.

    Attributes
    ----------
    errors : tuple of str
        Figures of merit, smaller is better; each has a chart and a Pareto front of its own.
    nodes : tuple of str
        What is timed; the seconds of several are added.
    alike : bool
        Whether these are timed at every point; else each point has some of them.
    repeats : int
        How often each recipe is timed, after one time that does not count.
    panels : tuple of str
        Up to two swept settings; points compete only where these are equal.
    """

    errors: tuple[str, ...]
    nodes: tuple[str, ...]
    repeats: int = 3
    panels: tuple[str, ...] = ()
    alike: bool = True

    @property
    def seconds(self) -> str:
        """Name of the column with the seconds that are charted."""
        return seconds_of(self.nodes[0]) if len(self.nodes) == 1 else "timed_seconds"

    @property
    def timed(self) -> str:
        """What is timed, in words."""
        if not self.alike:
            return "each point's nodes"
        return self.nodes[0] if len(self.nodes) == 1 else f"{self.nodes[0]} to {self.nodes[-1]}"

    def pareto(self, error: str) -> str:
        """Name of the column that says which points are on the front of an error."""
        return "pareto" if len(self.errors) == 1 else f"pareto_{error}"


@dataclass(frozen=True)
class Maps:
    """Figures of merit as heat maps over two swept settings.

    Attributes
    ----------
    rows, columns : str
        Settings along y and x.
    metrics : tuple of str
        Figures, each with maps of its own.
    limit : float, mapping of str to float, or None
        Where to draw a line: on every map, or on those of the figures named.
    """

    rows: str
    columns: str
    metrics: tuple[str, ...]
    limit: float | Mapping[str, float] | None = None

    def limit_of(self, metric: str) -> float | None:
        """Where the map of a figure has its line."""
        return self.limit.get(metric) if isinstance(self.limit, Mapping) else self.limit


KEYS = {
    "tradeoff": {"error": "str | list[str]", "node": "str | list[str]", "repeats": "int", "panels": "str | list[str]"},
    "maps": {"rows": "str", "columns": "str", "metrics": "str | list[str]", "limit": "float | dict[str, float] | None"},
}
NEEDED = {"tradeoff": ("error", "node"), "maps": ("rows", "columns", "metrics")}


def tradeoff_of(configuration: Configuration, swept: Collection[str], graphs: Iterable[Graph]) -> Tradeoff | None:
    """What ``tradeoff`` asks for.

    Parameters
    ----------
    configuration : Configuration
        Of a point.
    swept : collection of str
        Settings that points are told apart by.
    graphs : iterable of Graph
        Of all points.

    Raises
    ------
    InputErrors
        Unknown or missing keys, values of a wrong type, too few repeats, a node that a point lacks or that stands for
        real devices, panels by a setting that is not swept.
    """
    written = _section("tradeoff", configuration)
    if written is None:
        return None
    errors, nodes, panels = (_names(written.get(key, [])) for key in ("error", "node", "panels"))
    wanted = Tradeoff(errors, nodes, written.get("repeats", 3), panels)
    problems = _not_swept("tradeoff.panels", wanted.panels, swept, configuration)
    problems += [
        _error(configuration, f"tradeoff.{key}", f"{key} is empty", f"{key}: {_kind(KEYS['tradeoff'][key])}")
        for key, names in (("error", errors), ("node", nodes))
        if not names
    ]
    if wanted.repeats < 1:
        problems.append(_error(configuration, "tradeoff.repeats", f"repeats is {wanted.repeats}", "at least 1"))
    if len(wanted.panels) > MOST_PANEL_SETTINGS:
        what = f"panels names {len(wanted.panels)} settings"
        problems.append(_error(configuration, "tradeoff.panels", what, f"at most {MOST_PANEL_SETTINGS}"))
    every = list(graphs)
    problems += [problem for name in nodes for problem in _untimeable(name, every, configuration)]
    if problems:
        raise InputErrors(problems)
    return wanted


def together(asked: Sequence[Tradeoff]) -> Tradeoff:
    """What the page charts of points each of which says what is timed of it."""
    nodes = tuple(dict.fromkeys(name for one in asked for name in one.nodes))
    return replace(asked[0], nodes=nodes, alike=all(one.nodes == nodes for one in asked))


def maps_of(configuration: Configuration, swept: Collection[str]) -> Maps | None:
    """What ``maps`` asks for.

    Parameters
    ----------
    configuration : Configuration
        Of a point.
    swept : collection of str
        Settings that points are told apart by.

    Raises
    ------
    InputErrors
        Unknown or missing keys, values of a wrong type, rows or columns that are not swept, or that are the same.
    """
    written = _section("maps", configuration)
    if written is None:
        return None
    wanted = Maps(written["rows"], written["columns"], _names(written["metrics"]), written.get("limit"))
    problems = _not_swept("maps.rows", [wanted.rows], swept, configuration)
    problems += _not_swept("maps.columns", [wanted.columns], swept, configuration)
    if wanted.rows == wanted.columns:
        what = f"rows and columns are both '{wanted.rows}'"
        problems.append(_error(configuration, "maps.columns", what, "two settings"))
    if not wanted.metrics:
        problems.append(_error(configuration, "maps.metrics", "metrics is empty", "names of figures of merit"))
    if problems:
        raise InputErrors(problems)
    return wanted


def unknown_figures(tradeoff: Tradeoff | None, maps: Maps | None, known: Collection[str]) -> list[InputError]:
    """Figures that are asked for and that no point has; which there are is known only when points were computed."""
    asked = [("tradeoff.error", name) for name in tradeoff.errors] if tradeoff else []
    asked += [("maps.metrics", name) for name in maps.metrics] if maps else []
    asked += [("maps.limit", name) for name in maps.limit] if maps and isinstance(maps.limit, Mapping) else []
    return [
        InputError(f"no point has a figure '{name}'", where=place, hint=nearest(name, known))
        for place, name in asked
        if name not in known
    ]


def seconds_of(node: str) -> str:
    """Name of the column with a node's seconds."""
    return f"{node}_seconds"


def _section(section: str, configuration: Configuration) -> Mapping[str, Any] | None:
    """A section as it is written, its keys and types checked."""
    written, keys = configuration.content.get(section), KEYS[section]
    if written is None:
        return None
    if not isinstance(written, dict):
        shape = ", ".join(f"{key}: ..." for key in NEEDED[section])
        raise InputErrors([_error(configuration, section, f"'{section}' is {written!r}", f"{{{shape}}}")])
    checked, problems = {}, []
    for key, value in written.items():
        place = f"{section}.{key}"
        if key not in keys:
            what = f"'{section}' has no '{key}'"
            problems.append(
                _error(configuration, place, what, "a name from: " + ", ".join(keys), nearest(str(key), keys))
            )
            continue
        try:
            checked[key] = check_setting(value, _kind(keys[key]), str(key))
        except InputError as error:
            problems.append(error.at(configuration.where(place)))
    problems += [
        _error(configuration, section, f"'{section}' does not say its '{key}'", f"{key}: {_kind(keys[key])}")
        for key in NEEDED[section]
        if key not in written
    ]
    if problems:
        raise InputErrors(problems)
    return checked


def _untimeable(name: str, graphs: Iterable[Graph], configuration: Configuration) -> list[InputError]:
    """Why a node cannot be timed in the first graph in which it cannot."""
    for graph in graphs:
        node = graph.nodes.get(name)
        if node is None:
            why = f", it is absent: {graph.absent[name]}" if name in graph.absent else ""
            what, hint = f"there is no node '{name}'{why}", nearest(name, graph.nodes)
            return [_error(configuration, "tradeoff.node", what, "the node that is timed", hint)]
        if node.is_source:
            what = f"'{name}' is a capture of real devices"
            return [_error(configuration, "tradeoff.node", what, "a node that can be carried out again")]
    return []


def _not_swept(
    place: str, names: Iterable[str], swept: Collection[str], configuration: Configuration
) -> list[InputError]:
    return [
        _error(configuration, place, f"'{name}' is not swept", "a setting that the sweep varies", nearest(name, swept))
        for name in names
        if name not in swept
    ]


def _error(configuration: Configuration, path: str, what: str, expected: str, hint: str = "") -> InputError:
    return InputError(what, where=configuration.where(path), expected=expected, hint=hint)


def _names(written: str | list[str]) -> tuple[str, ...]:
    return (written,) if isinstance(written, str) else tuple(written)


@cache
def _kind(text: str) -> Annotation:
    return parse_annotation(text, {})
