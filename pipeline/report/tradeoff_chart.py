"""Error against seconds: a colour for each method, the Pareto front as a line."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

from markupsafe import Markup

from pipeline.graph.studies import MOST_PANEL_SETTINGS, Tradeoff
from pipeline.report.charts import (
    MOST_COLUMNS,
    Row,
    as_svg,
    chart_style,
    combinations,
    figure_label,
    named,
    numbers,
    places,
    round_ticks,
)
from pipeline.report.naming import setting_label

PANEL_INCHES = (4.2, 3.1)
LEGEND_INCHES = 0.4
MARKERS = "os^DvPX*<>"
SMALLEST, LARGEST = 14.0, 70.0
"""Areas of markers, in square points."""


def on_the_chart(rows: Sequence[Row], tradeoff: Tradeoff, error: str) -> list[Row]:
    """The points that have both an error and a time."""
    return [row for row in rows if row[tradeoff.pareto(error)] is not None]


def front(rows: Sequence[Row], tradeoff: Tradeoff, error: str) -> list[Row]:
    """The points on the Pareto fronts, panel by panel, the fastest first."""
    order = combinations(rows, tradeoff.panels)
    best = [row for row in on_the_chart(rows, tradeoff, error) if row[tradeoff.pareto(error)] == "yes"]
    return sorted(best, key=lambda row: (order.index(_panel(row, tradeoff)), row[tradeoff.seconds]))


def tradeoff_chart(rows: Sequence[Row], swept: Sequence[str], tradeoff: Tradeoff, error: str) -> Markup:
    """Draw an error against seconds, a panel for each combination of the settings that ``tradeoff.panels`` names.

    Settings whose values are no numbers tell methods apart, by colour and shape; numbers stand beside the points, and
    the first of them makes the points larger. Where all settings are numbers the first of them tells methods apart.
    """
    from matplotlib.figure import Figure

    known = on_the_chart(rows, tradeoff, error)
    if not known:
        return Markup("")
    free = [name for name in swept if name not in tradeoff.panels]
    words = [name for name in free if numbers([row[name] for row in rows]) is None] or free[:1]
    counts = [name for name in free if name not in words]
    methods = combinations(known, words)
    panels = combinations(known, tradeoff.panels)
    shape = _grid(panels)
    with chart_style():
        size = (PANEL_INCHES[0] * shape[1], PANEL_INCHES[1] * shape[0] + LEGEND_INCHES)
        figure = Figure(figsize=size, layout="constrained")
        alike: Any = "row" if len(tradeoff.panels) == MOST_PANEL_SETTINGS else True
        grid = figure.subplots(*shape, squeeze=False, sharex=True, sharey=alike)
        for axes, panel in _placed(grid, panels):
            here = [row for row in known if _panel(row, tradeoff) == panel]
            _draw(axes, here, tradeoff, error, words, methods, counts, _areas(known, counts))
            axes.set_title(named(tradeoff.panels, panel), fontsize=8)
        _scale(grid, known, tradeoff.seconds, error)
        for axes in grid[-1]:
            axes.set_xlabel(f"{tradeoff.timed} (s)")
        for axes in grid[:, 0]:
            axes.set_ylabel(figure_label(error))
        _legend(figure, words, methods, counts)
        return as_svg(figure)


def _panel(row: Row, tradeoff: Tradeoff) -> tuple[str, ...]:
    return tuple(row[name] for name in tradeoff.panels)


def _grid(panels: Sequence[tuple[str, ...]]) -> tuple[int, int]:
    """Rows and columns of panels: one setting's go on in the next row, two make a table."""
    if len(panels[0]) == MOST_PANEL_SETTINGS:
        return len({first for first, _ in panels}), len({second for _, second in panels})
    columns = min(len(panels), MOST_COLUMNS)
    return ceil(len(panels) / columns), columns


def _placed(grid: Any, panels: Sequence[tuple[str, ...]]) -> list[tuple[Any, tuple[str, ...]]]:
    """The axes of every panel; those that no panel needs are taken away."""
    if len(panels[0]) == MOST_PANEL_SETTINGS:
        down, across = (list(dict.fromkeys(panel[i] for panel in panels)) for i in (0, 1))
        taken = {panel: grid[down.index(panel[0])][across.index(panel[1])] for panel in panels}
    else:
        taken = dict(zip(panels, grid.flat, strict=False))
    for axes in grid.flat:
        if axes not in taken.values():
            axes.set_axis_off()
    return [(axes, panel) for panel, axes in taken.items()]


def _areas(rows: Sequence[Row], counts: Sequence[str]) -> dict[str, float]:
    """Area of a point's marker by the first of the numbers."""
    if not counts:
        return {}
    place = places([row[counts[0]] for row in rows])
    order = sorted(place, key=place.__getitem__)
    step = (LARGEST - SMALLEST) / max(len(order) - 1, 1)
    return {value: SMALLEST + i * step for i, value in enumerate(order)}


def _draw(
    axes: Any,
    rows: Sequence[Row],
    tradeoff: Tradeoff,
    error: str,
    words: Sequence[str],
    methods: Sequence[tuple[str, ...]],
    counts: Sequence[str],
    areas: dict[str, float],
) -> None:
    place = tradeoff.pareto(error)
    best = sorted((row[tradeoff.seconds], row[error]) for row in rows if row[place] == "yes")
    axes.step(*zip(*best, strict=True), where="post", color="0.35", linewidth=1.0, zorder=1, gid="front")
    for index, method in enumerate(methods):
        for row in rows:
            if tuple(row[name] for name in words) != method:
                continue
            at, on_front = (row[tradeoff.seconds], row[error]), row[place] == "yes"
            axes.scatter(
                *at,
                s=areas.get(row[counts[0]], SMALLEST) if counts else 2 * SMALLEST,
                marker=MARKERS[index % len(MARKERS)],
                color=_colour(index, len(methods)),
                edgecolors="black" if on_front else "none",
                linewidths=0.8,
                alpha=1.0 if on_front else 0.55,
                zorder=3 if on_front else 2,
            )
            if counts:
                below = list(areas).index(row[counts[0]]) % 2
                text = "/".join(str(row[name]) for name in counts)
                axes.annotate(text, at, xytext=(4, -8 if below else 3), textcoords="offset points", fontsize=6)


def _scale(grid: Any, rows: Sequence[Row], seconds: str, error: str) -> None:
    """Logarithmic axes, unless something on them is not above zero."""
    for name, axis in ((seconds, "x"), (error, "y")):
        values = [row[name] for row in rows]
        if min(values) <= 0:
            continue
        for axes in grid.flat:
            getattr(axes, f"set_{axis}scale")("log")
            round_ticks(getattr(axes, f"{axis}axis"), max(values) / min(values))


def _legend(figure: Any, words: Sequence[str], methods: Sequence[tuple[str, ...]], counts: Sequence[str]) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], linestyle="", marker=MARKERS[i % len(MARKERS)], color=_colour(i, len(methods)))
        for i in range(len(methods))
    ]
    labels = [", ".join(map(str, method)) for method in methods]
    handles.append(Line2D([], [], color="0.35", linewidth=1.0))
    labels.append("Pareto front" + (f"; numbers: {' / '.join(map(setting_label, counts))}" if counts else ""))
    title = ", ".join(map(setting_label, words))
    figure.legend(handles, labels, loc="outside upper center", ncols=min(len(labels), 5), frameon=False, title=title)


def _colour(index: int, count: int) -> Any:
    from matplotlib import colormaps

    return colormaps["tab10" if count <= 10 else "tab20"](index % (10 if count <= 10 else 20))
