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

from pipeline.report.naming import duration, labelled
from pipeline.storage.files import write_text

PANEL_INCHES = (3.0, 2.3)
MOST_METRICS = 24
FEW_LINES, MOST_LINES = 6, 16
"""Lines whose names fit into a panel, and beside the first panel of a column."""
LEGEND_INCHES = 1.3
CROWDED = 36
"""Characters of an axis's names beyond which they are turned."""


class SweepView(Protocol):
    """What the page asks of a sweep; see :class:`pipeline.sweeps.Sweep`."""

    folder: Path
    command: str
    stages_run: int
    stages_found: int
    seconds: float

    @property
    def stages_named(self) -> int:
        """Nodes that the points name one by one."""

    @property
    def swept(self) -> list[str]:
        """Settings that differ between points."""

    @property
    def metrics(self) -> list[str]:
        """Figures that any point has."""

    def table(self) -> list[dict[str, Any]]:
        """One row a point."""


def write_sweep(sweep: SweepView) -> None:
    """Write ``table.csv``, ``table.txt`` and ``report.html`` into the sweep's folder."""
    rows = sweep.table()
    write_text(sweep.folder / "table.csv", _csv(rows))
    write_text(sweep.folder / "table.txt", _text(rows, sweep.swept, sweep.metrics))
    write_text(sweep.folder / "report.html", _page(sweep, rows))


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return text.getvalue()


def _text(rows: Sequence[Mapping[str, Any]], swept: Sequence[str], metrics: Sequence[str]) -> str:
    """The table for a terminal: settings, a few figures, seconds."""
    columns = [*swept, *metrics[:6], "seconds", "state"]
    head = [name.rpartition(".")[2] if name in swept else name for name in columns]
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
        chart=Markup(_chart(rows, sweep.swept, metrics[:MOST_METRICS])) if sweep.swept and metrics else "",
        left_out=metrics[MOST_METRICS:],
        cell=_cell,
        duration=duration,
    )


def _chart(rows: Sequence[Mapping[str, Any]], swept: Sequence[str], metrics: Sequence[str]) -> str:
    """Panels: a row for each figure of merit, a column for each setting; points joined where only that one varies."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    with rc_context({"font.size": 8, "svg.fonttype": "none", "axes.spines.top": False, "axes.spines.right": False}):
        beside = sum(FEW_LINES < _lines_over(rows, setting, swept) <= MOST_LINES for setting in swept)
        size = (PANEL_INCHES[0] * len(swept) + 0.5 + LEGEND_INCHES * beside, PANEL_INCHES[1] * len(metrics))
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(metrics), len(swept), squeeze=False, sharex="col", sharey="row")
        for i, metric in enumerate(metrics):
            for j, setting in enumerate(swept):
                _panel(axes[i][j], rows, setting, metric, swept, first=i == 0)
            label = labelled(metric, 0.0)
            text = f"{label.label} ({label.unit})" if label.unit else label.label
            axes[i][0].set_ylabel("\n".join(wrap(text, 26)))
        for j, setting in enumerate(swept):
            axes[-1][j].set_xlabel(setting)
        drawn = io.StringIO()
        figure.savefig(drawn, format="svg", transparent=True, metadata={"Date": None})
    return drawn.getvalue()[drawn.getvalue().index("<svg") :]


def _lines_over(rows: Sequence[Mapping[str, Any]], setting: str, swept: Sequence[str]) -> int:
    return len({tuple(row[name] for name in swept if name != setting) for row in rows})


def _panel(
    axes: Any, rows: Sequence[Mapping[str, Any]], setting: str, metric: str, swept: Sequence[str], *, first: bool
) -> None:
    from matplotlib import colormaps

    known = [row for row in rows if row[metric] is not None]
    places = _places([row[setting] for row in rows])
    lines: dict[tuple[Any, ...], list[tuple[float, float]]] = {}
    for row in known:
        others = tuple(row[name] for name in swept if name != setting)
        lines.setdefault(others, []).append((places[row[setting]], row[metric]))
    if len(lines) > 10:
        axes.set_prop_cycle(color=colormaps["tab20"](range(20)))
    for others, points in lines.items():
        points.sort()
        axes.plot(*zip(*points, strict=True), "o-", markersize=3.5, linewidth=0.9, label=", ".join(map(str, others)))
    if _numbers(list(places)) is None or len(places) <= 8:
        axes.set_xticks(list(places.values()), [str(value) for value in places])
        if len("".join(places)) > CROWDED:
            axes.tick_params("x", labelrotation=90)
    axes.margins(x=0.08)
    axes.tick_params(labelbottom=True)
    title = ", ".join(n.rpartition(".")[2] for n in swept if n != setting)
    if 1 < len(lines) <= FEW_LINES and len(swept) > 1:
        axes.legend(frameon=False, fontsize=6, title=title)
    elif first and FEW_LINES < len(lines) <= MOST_LINES:
        axes.legend(frameon=False, fontsize=6, title=title, loc="upper left", bbox_to_anchor=(1, 1))


def _places(values: Sequence[str]) -> dict[str, float]:
    """Where on an axis values stand: as numbers if they all are, else one after the other."""
    distinct = list(dict.fromkeys(values))
    found = _numbers(distinct)
    return dict(zip(distinct, found or [float(i) for i in range(len(distinct))], strict=True))


def _numbers(values: Sequence[str]) -> list[float] | None:
    try:
        return [float(value) for value in values]
    except ValueError:
        return None


def _cell(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.5g}" if isinstance(value, float) else str(value)
