"""What a sweep found: its points, and one table of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.graph.studies import Maps, Tradeoff, seconds_of
from pipeline.report.pareto import pareto_front
from pipeline.runs import Run


@dataclass(frozen=True)
class Point:
    """One run of a sweep.

    Attributes
    ----------
    overrides : tuple of str
        What makes it differ from the others, and what they share.
    settings : dict of str to str
        The same by name, as written.
    run : Run
        The run.
    """

    overrides: tuple[str, ...]
    run: Run

    @property
    def settings(self) -> dict[str, str]:
        """Overrides by name, as they were written: a sweeper escapes spaces, among others."""
        pairs = (word.lstrip("+").partition("=") for word in self.overrides)
        return {name: re.sub(r"\\(.)", r"\1", value) for name, _, value in pairs}

    @property
    def seconds(self) -> float:
        """What computing all its nodes took, whenever that was and whoever shared them."""
        return sum(node.seconds or 0.0 for node in self.run.nodes.values())


@dataclass
class Sweep:
    """A sweep: its points as they come, and what was saved by sharing.

    Attributes
    ----------
    folder : Path
        Where table and page lie.
    command : str
        The command that runs it again.
    points : list of Point
        Runs in the order in which they were proposed.
    stages_run, stages_found : int
        Nodes of the merged graphs that were computed, and that the store had.
    seconds : float
        Wall time of all.
    tradeoff : Tradeoff or None
        Which errors are charted against which nodes' seconds.
    timed_nodes : list of tuple of str
        Which nodes these are, point by point.
    timed : dict of str to float
        Least seconds of those nodes' recipes, by key.
    maps : Maps or None
        Which figures are drawn as maps over two settings.
    """

    folder: Path
    command: str
    points: list[Point] = field(default_factory=list)
    stages_run: int = 0
    stages_found: int = 0
    seconds: float = 0.0
    tradeoff: Tradeoff | None = None
    timed_nodes: list[tuple[str, ...]] = field(default_factory=list)
    timed: dict[str, float] = field(default_factory=dict)
    maps: Maps | None = None

    @property
    def stages_named(self) -> int:
        """Nodes that the points name one by one: what as many separate runs without a store would compute."""
        return sum(sum(bool(node.stage) for node in point.run.nodes.values()) for point in self.points)

    @property
    def swept(self) -> list[str]:
        """Settings that differ between points."""
        names = dict.fromkeys(name for point in self.points for name in point.settings)
        return [name for name in names if len({point.settings.get(name) for point in self.points}) > 1]

    @property
    def columns(self) -> list[str]:
        """Settings that the table has: those that differ, and those by which charts are laid out."""
        charted = [*(self.tradeoff.panels if self.tradeoff else ())]
        charted += [self.maps.rows, self.maps.columns] if self.maps else []
        return list(dict.fromkeys([*self.swept, *charted]))

    @property
    def metrics(self) -> list[str]:
        """Figures that any point has."""
        return list(dict.fromkeys(name for point in self.points for name in point.run.metrics))

    @property
    def failed(self) -> bool:
        """Whether any point failed."""
        return any(point.run.failed for point in self.points)

    def table(self) -> list[dict[str, Any]]:
        """One row a point: settings, metrics, place in the trade-off if there is one, seconds, state and folder."""
        places = self._places() if self.tradeoff else [{}] * len(self.points)
        return [
            {
                **{name: point.settings.get(name, "") for name in self.columns},
                **{name: point.run.metrics.get(name) for name in self.metrics},
                **place,
                "seconds": round(point.seconds, 3),
                "state": "failed" if point.run.failed else "done",
                "run": str(point.run.path),
            }
            for point, place in zip(self.points, places, strict=True)
        ]

    def _places(self) -> list[dict[str, Any]]:
        """Seconds of the timed nodes, and whether the point is on the fronts of those with which it competes."""
        assert self.tradeoff is not None
        wanted = self.tradeoff
        places: list[dict[str, Any]] = []
        for point, nodes in zip(self.points, self.timed_nodes, strict=True):
            seconds = {name: self.timed.get(point.run.nodes[name].key) for name in nodes}
            known = [value for value in seconds.values() if value is not None]
            total = sum(known) if len(known) == len(seconds) else None
            each = {seconds_of(name): seconds.get(name) for name in wanted.nodes}
            places.append({**each, wanted.seconds: total, **{wanted.pareto(error): None for error in wanted.errors}})
        for error in wanted.errors:
            panels: dict[tuple[str, ...], list[tuple[int, float, float]]] = {}
            for index, (point, place) in enumerate(zip(self.points, places, strict=True)):
                seconds_here, value = place[wanted.seconds], point.run.metrics.get(error)
                if seconds_here is not None and value is not None:
                    panel = tuple(point.settings[name] for name in wanted.panels)
                    panels.setdefault(panel, []).append((index, seconds_here, value))
            for here in panels.values():
                for (index, *_), best in zip(here, pareto_front([(s, v) for _, s, v in here]), strict=True):
                    places[index][wanted.pareto(error)] = "yes" if best else "no"
        return places
