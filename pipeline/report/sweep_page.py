"""A sweep on one page and in one table: each figure of merit against each setting that was varied."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Any, Protocol

from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from pipeline.graph.studies import Maps, Tradeoff
from pipeline.parallel import cores
from pipeline.report.charts import CROWDED, as_svg, chart_style, figure_label, numbers, places, short
from pipeline.report.heat_maps import heat_maps
from pipeline.report.naming import duration, labelled
from pipeline.report.tradeoff_chart import front, on_the_chart, tradeoff_chart
from pipeline.storage.files import write_text

PANEL_INCHES = (3.0, 2.3)
MOST_METRICS = 24
FEW_LINES, MOST_LINES = 6, 16
"""Lines whose names fit into a panel, and beside the first panel of a column."""
LEGEND_INCHES = 1.3
FIGURES_OF_TEXT = 6
"""Figures of merit in the table for a terminal."""


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
    """The table for a terminal: settings, a few figures, place in the trade-off, seconds."""
    wanted = sweep.tradeoff
    figures = sorted(sweep.metrics, key=lambda name: wanted is None or name != wanted.error)[:FIGURES_OF_TEXT]
    columns = [*sweep.columns, *figures, *([wanted.seconds, "pareto"] if wanted else []), "seconds", "state"]
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
    return environment.get_template("sweep.html.j2").render(
        sweep=sweep,
        rows=rows,
        metrics=heads,
        chart=_chart(rows, sweep.swept, metrics[:MOST_METRICS]) if sweep.swept and metrics else "",
        left_out=metrics[MOST_METRICS:],
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
    return {
        "chart": tradeoff_chart(rows, sweep.swept, wanted),
        "front": front(rows, wanted),
        "missing": len(rows) - len(on_the_chart(rows)),
        "error": figure_label(wanted.error),
        "cores": cores(),
    }


def _maps(sweep: SweepView, rows: Sequence[Mapping[str, Any]], metrics: Sequence[str]) -> list[tuple[str, Markup]]:
    """Each figure of merit that is mapped, in words, and its maps."""
    wanted = sweep.maps
    if wanted is None:
        return []
    return [
        (figure_label(name), heat_maps(rows, sweep.swept, wanted, name)) for name in wanted.metrics if name in metrics
    ]


def _chart(rows: Sequence[Mapping[str, Any]], swept: Sequence[str], metrics: Sequence[str]) -> Markup:
    """Panels: a row for each figure of merit, a column for each setting; points joined where only that one varies."""
    from matplotlib.figure import Figure

    with chart_style():
        beside = sum(FEW_LINES < _lines_over(rows, setting, swept) <= MOST_LINES for setting in swept)
        size = (PANEL_INCHES[0] * len(swept) + 0.5 + LEGEND_INCHES * beside, PANEL_INCHES[1] * len(metrics))
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(metrics), len(swept), squeeze=False, sharex="col", sharey="row")
        for i, metric in enumerate(metrics):
            for j, setting in enumerate(swept):
                _panel(axes[i][j], rows, setting, metric, swept, first=i == 0)
            axes[i][0].set_ylabel("\n".join(wrap(figure_label(metric), 26)))
        for j, setting in enumerate(swept):
            axes[-1][j].set_xlabel(setting)
        return as_svg(figure)


def _lines_over(rows: Sequence[Mapping[str, Any]], setting: str, swept: Sequence[str]) -> int:
    return len({tuple(row[name] for name in swept if name != setting) for row in rows})


def _panel(
    axes: Any, rows: Sequence[Mapping[str, Any]], setting: str, metric: str, swept: Sequence[str], *, first: bool
) -> None:
    from matplotlib import colormaps

    known = [row for row in rows if row[metric] is not None]
    place = places([row[setting] for row in rows])
    lines: dict[tuple[Any, ...], list[tuple[float, float]]] = {}
    for row in known:
        others = tuple(row[name] for name in swept if name != setting)
        lines.setdefault(others, []).append((place[row[setting]], row[metric]))
    if len(lines) > 10:
        axes.set_prop_cycle(color=colormaps["tab20"](range(20)))
    for others, points in lines.items():
        points.sort()
        axes.plot(*zip(*points, strict=True), "o-", markersize=3.5, linewidth=0.9, label=", ".join(map(str, others)))
    if numbers(list(place)) is None or len(place) <= 8:
        axes.set_xticks(list(place.values()), [str(value) for value in place])
        if len("".join(place)) > CROWDED:
            axes.tick_params("x", labelrotation=90)
    axes.margins(x=0.08)
    axes.tick_params(labelbottom=True)
    title = ", ".join(short(name) for name in swept if name != setting)
    if 1 < len(lines) <= FEW_LINES and len(swept) > 1:
        axes.legend(frameon=False, fontsize=6, title=title)
    elif first and FEW_LINES < len(lines) <= MOST_LINES:
        axes.legend(frameon=False, fontsize=6, title=title, loc="upper left", bbox_to_anchor=(1, 1))


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
