"""A sweep on one page and in one table: each figure of merit against each setting that was varied."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any, Protocol

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from pipeline.graph.studies import Maps, Tradeoff
from pipeline.parallel import cores
from pipeline.report.charts import figure_label, short
from pipeline.report.heat_maps import heat_maps
from pipeline.report.line_charts import constants, line_charts
from pipeline.report.naming import duration, labelled, plain, with_unit
from pipeline.report.tradeoff_chart import front, on_the_chart, tradeoff_chart
from pipeline.storage.files import write_text

MOST_METRICS = 24
FIGURES_OF_TEXT = 6
"""Figures of merit in the table for a terminal, unless the charts need more."""


class SweepView(Protocol):
    """What the page asks of a sweep; see :class:`pipeline.sweep_results.Sweep`."""

    folder: Path
    command: str
    stages_run: int
    stages_found: int
    seconds: float
    tradeoff: Tradeoff | None
    maps: Maps | None

    @property
    def stages_named(self) -> int:
        """Nodes that the points name one by one."""

    @property
    def swept(self) -> list[str]:
        """Settings that differ between points."""

    @property
    def columns(self) -> list[str]:
        """Settings that the table has."""

    @property
    def metrics(self) -> list[str]:
        """Figures that any point has."""

    def table(self) -> list[dict[str, Any]]:
        """One row a point."""


def write_sweep(sweep: SweepView) -> None:
    """Write ``table.csv``, ``table.txt`` and ``report.html`` into the sweep's folder."""
    rows = sweep.table()
    write_text(sweep.folder / "table.csv", _csv(rows))
    write_text(sweep.folder / "table.txt", _text(rows, sweep))
    write_text(sweep.folder / "report.html", _page(sweep, rows))


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _text(rows: Sequence[Mapping[str, Any]], sweep: SweepView) -> str:
    """The table for a terminal: settings, what is charted and a few figures more, place in the trade-off, seconds."""
    wanted = sweep.tradeoff
    charted = [*(wanted.errors if wanted else ()), *(sweep.maps.metrics if sweep.maps else ())]
    known = [name for name in charted if name in sweep.metrics]
    figures = list(dict.fromkeys([*known, *sweep.metrics]))[: max(FIGURES_OF_TEXT, len(known))]
    columns = [
        *sweep.columns,
        *figures,
        *([wanted.seconds, *map(wanted.pareto, wanted.errors)] if wanted else []),
        "seconds",
        "state",
    ]
    head = [short(name) if name in sweep.columns else name for name in columns]
    body = [[_cell(row[name]) for name in columns] for row in rows]
    widths = [max(len(line[i]) for line in [head, *body]) for i in range(len(columns))]
    return "\n".join("  ".join(word.rjust(w) for word, w in zip(line, widths, strict=True)) for line in [head, *body])


def _page(sweep: SweepView, rows: Sequence[Mapping[str, Any]]) -> str:
    metrics = [name for name in sweep.metrics if any(row[name] is not None for row in rows)]
    environment = Environment(
        loader=PackageLoader("pipeline.report"), autoescape=True, trim_blocks=True, lstrip_blocks=True
    )
    heads = [labelled(name, 0.0) for name in metrics]
    same = constants(rows, metrics)
    varying = [name for name in metrics if name not in same]
    return environment.get_template("sweep.html.j2").render(
        sweep=sweep,
        rows=rows,
        metrics=heads,
        chart=line_charts(rows, sweep.swept, varying[:MOST_METRICS]) if sweep.swept and varying else "",
        same=[_in_words(name, value) for name, value in same.items()],
        left_out=varying[MOST_METRICS:],
        tradeoff=_tradeoff(sweep, rows),
        maps=_maps(sweep, rows, metrics),
        cell=_cell,
        duration=duration,
    )


def _tradeoff(sweep: SweepView, rows: Sequence[Mapping[str, Any]]) -> dict[str, Any] | None:
    """What the page says of accuracy against speed."""
    wanted = sweep.tradeoff
    if wanted is None:
        return None
    charts = [
        {
            "error": error,
            "label": figure_label(error),
            "chart": tradeoff_chart(rows, sweep.swept, wanted, error),
            "front": front(rows, wanted, error),
            "missing": len(rows) - len(on_the_chart(rows, wanted, error)),
        }
        for error in wanted.errors
    ]
    return {"charts": charts, "pareto": [wanted.pareto(error) for error in wanted.errors], "cores": cores()}


def _maps(sweep: SweepView, rows: Sequence[Mapping[str, Any]], metrics: Sequence[str]) -> list[tuple[str, str, Markup]]:
    """Each figure of merit that is mapped, in words, what to say of its limit, and its maps."""
    wanted = sweep.maps
    if wanted is None:
        return []
    return [
        (figure_label(name), _limit_words(rows, wanted, name), heat_maps(rows, sweep.swept, wanted, name))
        for name in wanted.metrics
        if name in metrics
    ]


def _in_words(metric: str, value: float) -> str:
    head = labelled(metric, value)
    return f"{head.label} {with_unit(_cell(value), head.unit)}"


def _limit_words(rows: Sequence[Mapping[str, Any]], maps: Maps, metric: str) -> str:
    limit, known = (
        maps.limit_of(metric),
        [row[metric] for row in rows if row[metric] is not None and isfinite(row[metric])],
    )
    if limit is None or not known:
        return ""
    words = with_unit(_cell(limit), labelled(metric, limit).unit)
    if min(known) < limit < max(known):
        return f"Red line: {words}."
    return f"All are {'above' if min(known) >= limit else 'below'} {words}."


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return plain(value, 5) if isinstance(value, float) else str(value)
