"""What a sweep found: its points, and one table of them."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.graph.studies import Maps, Tradeoff
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
        Which error is charted against which node's seconds.
    timed : dict of str to float
        Least seconds of that node's recipes, by key.
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
        """Seconds of the timed node, and whether the point is on the front of those with which it competes."""
        assert self.tradeoff is not None
        wanted = self.tradeoff
        seconds = [self.timed.get(point.run.nodes[wanted.node].key) for point in self.points]
        places: list[dict[str, Any]] = [{wanted.seconds: value, "pareto": None} for value in seconds]
        panels: dict[tuple[str, ...], list[tuple[int, float, float]]] = {}
        for index, (point, value) in enumerate(zip(self.points, seconds, strict=True)):
            error = point.run.metrics.get(wanted.error)
            if value is not None and error is not None:
                panel = tuple(point.settings[name] for name in wanted.panels)
                panels.setdefault(panel, []).append((index, value, error))
        for known in panels.values():
            for (index, *_), best in zip(known, pareto_front([(v, e) for _, v, e in known]), strict=True):
                places[index]["pareto"] = "yes" if best else "no"
        return places
