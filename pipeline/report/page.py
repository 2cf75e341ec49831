"""The page: what was run, how to run it again, what came out, and what it took."""

from __future__ import annotations

from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader

from pipeline.data.pictures import PictureSeries
from pipeline.errors import PipelineError
from pipeline.parallel import threads
from pipeline.report.figures import figures_of
from pipeline.report.graph_picture import graph_svg
from pipeline.report.naming import Labelled, duration, flat, labelled, moment, prose
from pipeline.report.pictures import Figure, beside
from pipeline.report.view import NodeView, RunView

FEW_TILES, MOST_TILES = 4, 6
STATES = {"ran": "ran", "cached": "from cache", "failed": "failed", "blocked": "blocked", "absent": "absent"}


@dataclass(frozen=True)
class Section:
    """A node of the run with its figures.

    Attributes
    ----------
    settings : list of tuple
        Name, value, and "written", "default" or, inside a device that was written, "".
    damage : str
        Why its stored value cannot be read.
    shown_with : tuple of str
        Nodes beside whose pictures its own are shown.
    repeats : dict of str to list of str
        Titles of figures that look as those of another node do, by that node's name.
    """

    node: NodeView
    figures: list[Figure]
    metrics: list[Labelled]
    settings: list[tuple[str, str, str]]
    damage: str = ""
    shown_with: tuple[str, ...] = ()
    repeats: dict[str, list[str]] = field(default_factory=dict)


@dataclass(frozen=True)
class Drawing:
    """Everything of a run that the page shows, drawn.

    Attributes
    ----------
    values : dict
        Values by node, as far as they can be read.
    sections : list of Section
        Every node.
    compared : list of Figure
        Pictures of several nodes beside each other.
    """

    values: Mapping[str, Any]
    sections: list[Section]
    compared: list[Figure]


def draw(run: RunView) -> Drawing:
    """Draw the figures of a run."""
    nodes = list(run.nodes.values())
    values, damages = _values(run)
    together = _under_equal_lights(values)
    shown_with = {name: tuple(names) for names in together for name in names}
    with ThreadPoolExecutor(threads()) as pool:
        drawn = pool.map(lambda node: [] if node.name in shown_with else _figures(node, values), nodes)
        compared = list(pool.map(lambda names: beside({name: values[name] for name in names}), together))
        sections = [
            Section(
                node,
                figures,
                [labelled(name, number) for name, number in getattr(values.get(node.name), "metrics", {}).items()],
                [(name, shown, _origin(name, node.written)) for name, shown in flat(node.settings)],
                damages.get(node.name, ""),
                shown_with.get(node.name, ()),
            )
            for node, figures in zip(nodes, drawn, strict=True)
        ]
    _say_once(sections)
    return Drawing(values, sections, compared)


def page(run: RunView, drawing: Drawing | None = None) -> str:
    """The report as one HTML text that needs nothing else."""
    drawing = drawing or draw(run)
    nodes = list(run.nodes.values())
    metrics = [labelled(name, value) for name, value in run.metrics.items()]
    environment = Environment(
        loader=PackageLoader("pipeline.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    environment.filters |= {"duration": duration, "moment": moment, "prose": prose}
    measured = [node for node in nodes if node.seconds is not None]
    return environment.get_template("report.html.j2").render(
        run=run,
        tiles=_headlines(run, drawing.values),
        metrics=metrics,
        warnings=[(node.name, text) for node in nodes for text in node.warnings],
        troubled=[node for node in nodes if node.status in {"failed", "blocked"}],
        graph=graph_svg({name: node for name, node in run.nodes.items() if node.status != "absent"}),
        sections=drawing.sections,
        compared=drawing.compared,
        measured=measured,
        longest=max((node.seconds or 0.0 for node in measured), default=0.0) or 1.0,
        states=STATES,
        count={state: sum(node.status == state for node in nodes) for state in STATES},
    )


def _headlines(run: RunView, values: Mapping[str, Any]) -> list[Labelled]:
    """The first figure of merit of each node that no other node with figures judges; where few, their next."""
    judging = [node for node, value in values.items() if getattr(value, "metrics", {})]
    judged = {name for node in judging for name in _upstream(run, node)}
    found: list[str] = []
    for node in judging:
        name = next(iter(values[node].metrics))
        own = f"{node}.{name}" if f"{node}.{name}" in run.metrics else name
        if own in run.metrics and node not in judged:
            found.append(own)
    last = [name for node in judging if node not in judged for name in values[node].metrics]
    further = sorted((name for name in run.metrics if name not in found), key=lambda name: name not in last)
    further = further[: max(0, FEW_TILES - len(found))]
    chosen = sorted([*found, *further], key=list(run.metrics).index)
    return [labelled(name, run.metrics[name]) for name in chosen[:MOST_TILES]]


def _upstream(run: RunView, name: str) -> set[str]:
    """All nodes that a node stands on."""
    found: set[str] = set()
    waiting = [name]
    while waiting:
        sources = {s for group in run.nodes[waiting.pop()].inputs.values() for s in group or () if s in run.nodes}
        waiting += sources - found
        found |= sources
    return found


def _values(run: RunView) -> tuple[dict[str, Any], dict[str, str]]:
    """Values by node, and why those that cannot be read cannot."""
    values, damages = {}, {}
    for name, node in run.nodes.items():
        if node.artifact and run.has(name):
            try:
                values[name] = run.value(name)
            except PipelineError as error:
                damages[name] = str(error)
    return values, damages


def _figures(node: NodeView, values: Mapping[str, Any]) -> list[Figure]:
    return figures_of(values[node.name], _pixel_mm(node, values)) if node.name in values else []


def _say_once(sections: list[Section]) -> None:
    """Take away figures that have been shown for an earlier node, and say where."""
    shown: dict[str, str] = {}
    for section in sections:
        for figure in list(section.figures):
            first = shown.setdefault(figure.body, section.node.name)
            if first != section.node.name:
                section.figures.remove(figure)
                section.repeats.setdefault(first, []).append(figure.title)


def _origin(name: str, written: frozenset[str]) -> str:
    if name in written:
        return "written"
    return "" if name.partition(".")[0] in written else "default"


def _pixel_mm(node: NodeView, values: Mapping[str, Any]) -> float | None:
    """Pixel pitch of a map that does not know its own: that of an input whose map has the same shape."""
    shape = _shape(values[node.name])
    for sources in node.inputs.values():
        for source in sources:
            pitch = getattr(values.get(source), "pixel_mm", None)
            if pitch and shape and _shape(values[source]) == shape:
                return float(pitch)
    return None


def _shape(value: Any) -> tuple[int, ...]:
    """Rows and columns of a value's first map."""
    arrays = (array for array in vars(value).values() if isinstance(array, np.ndarray) and array.ndim == 2)
    return next((array.shape for array in arrays), ())


def _under_equal_lights(values: Mapping[str, Any]) -> list[list[str]]:
    """Nodes with pictures under the same lights, where there are at least two."""
    groups: list[list[str]] = []
    for name, value in values.items():
        if isinstance(value, PictureSeries):
            firsts = ((g, values[g[0]]) for g in groups)
            same = (
                g
                for g, first in firsts
                if first.together == value.together and np.array_equal(first.light_mm, value.light_mm)
            )
            group = next(same, None)
            if group is None:
                groups.append([name])
            else:
                group.append(name)
    return [group for group in groups if len(group) > 1]
