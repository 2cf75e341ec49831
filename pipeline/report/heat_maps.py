"""Figures of merit as colours over two swept settings."""

from __future__ import annotations

from collections.abc import Sequence
from math import ceil
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.graph.studies import Maps
from pipeline.report.charts import (
    CROWDED,
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
from pipeline.report.naming import plain, setting_label

CELL_INCHES = 0.4
LEAST_INCHES, MOST_INCHES = 2.0, 5.0
AROUND_INCHES = 0.9
BAR_INCHES = 1.0
LOG_FROM = 20.0
"""Ratio of the largest to the least value above which colours are logarithmic."""
FEW_COLUMNS = 4
"""Cells of so few columns are wide enough for four digits; others take two."""
MOST_WRITTEN = 120
"""Cells of a map in which values are still written."""
MOST_TICKS = 14


def heat_maps(rows: Sequence[Row], swept: Sequence[str], maps: Maps, metric: str) -> Markup:
    """Draw a figure of merit over two settings, a map for each combination of the others, colours the same for all.

    Cells without a value are grey; a line is where the figure crosses its limit, along settings that are numbers only:
    words have nothing between them.
    """
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.figure import Figure

    known = [row for row in rows if row[metric] is not None and np.isfinite(row[metric])]
    if not known:
        return Markup("")
    others = [name for name in swept if name not in (maps.rows, maps.columns)]
    panels = combinations(known, others)
    down, across = _axis(rows, maps.rows), _axis(rows, maps.columns)
    grids = [_grid([r for r in known if _values(r, others) == p], maps, metric, down, across) for p in panels]
    low, high = min(row[metric] for row in known), max(row[metric] for row in known)
    limit, numeric = maps.limit_of(metric), (numbers(down) is not None, numbers(across) is not None)
    log = low > 0 and high / low > LOG_FROM
    norm = LogNorm(low, high) if log else Normalize(low, high)
    columns = min(len(panels), MOST_COLUMNS)
    shape = (ceil(len(panels) / columns), columns)
    with chart_style():
        width, height = (min(max(CELL_INCHES * len(n), LEAST_INCHES), MOST_INCHES) for n in (across, down))
        size = ((width + AROUND_INCHES) * shape[1] + BAR_INCHES, (height + AROUND_INCHES) * shape[0])
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(*shape, squeeze=False, sharex=True, sharey=True)
        for place, panel, values in zip(axes.flat, panels, grids, strict=False):
            place.imshow(values, norm=norm, cmap="viridis", origin="lower", aspect="auto")
            place.set_facecolor("0.8")
            place.set_title(named(others, panel), fontsize=8)
            if values.size <= MOST_WRITTEN:
                _write(place, values, norm)
            if limit is not None:
                _limit_line(place, values, limit, log=log, numeric=numeric)
        for place in axes.flat[len(panels) :]:
            place.set_axis_off()
        _ticks(axes, maps, down, across)
        bar = figure.colorbar(ScalarMappable(norm, "viridis"), ax=axes, label=figure_label(metric))
        if log:
            round_ticks(bar.ax.yaxis, high / low)
        if limit is not None and low <= limit <= high:
            bar.ax.axhline(limit, color="red", linewidth=1.5)
        return as_svg(figure)


def _values(row: Row, settings: Sequence[str]) -> tuple[str, ...]:
    return tuple(row[name] for name in settings)


def _axis(rows: Sequence[Row], setting: str) -> list[str]:
    """A setting's values in the order in which they stand on an axis."""
    place = places([row[setting] for row in rows])
    return sorted(place, key=place.__getitem__)


def _grid(
    rows: Sequence[Row], maps: Maps, metric: str, down: Sequence[str], across: Sequence[str]
) -> NDArray[np.float64]:
    values = np.full((len(down), len(across)), np.nan)
    for row in rows:
        values[down.index(row[maps.rows]), across.index(row[maps.columns])] = row[metric]
    return values


def _write(axes: Any, values: NDArray[np.float64], norm: Any) -> None:
    """Every value in its cell, black on bright colours and white on dark ones."""
    digits = 4 if values.shape[1] <= FEW_COLUMNS else 2
    for (i, j), value in np.ndenumerate(values):
        if np.isfinite(value):
            colour = "black" if norm(value) > 0.6 else "white"
            axes.text(j, i, plain(value, digits), ha="center", va="center", fontsize=6, color=colour)


def _limit_line(axes: Any, values: NDArray[np.float64], limit: float, *, log: bool, numeric: tuple[bool, bool]) -> None:
    """Where a figure has the limit's value, between the middles of the cells; ``numeric`` says it of rows and columns.

    Over two numbers this is a contour; along one number and words, a bar in each line of cells.
    """
    heights, level = (np.log(values), np.log(limit)) if log else (values, limit)
    if all(numeric):
        if min(values.shape) > 1 and np.nanmin(values) < limit < np.nanmax(values):
            axes.contour(np.ma.masked_invalid(heights), levels=[level], colors="red", linewidths=1.5)
    elif any(numeric):
        for i, cells in enumerate(heights if numeric[1] else heights.T):
            for at in _crossings(cells, level):
                ends = ([at, at], [i - 0.5, i + 0.5])
                axes.plot(*(ends if numeric[1] else ends[::-1]), color="red", linewidth=1.5)


def _crossings(heights: NDArray[np.float64], level: float) -> list[float]:
    """Where straight lines through neighbouring heights have the level, in indices."""
    before, after = heights[:-1] - level, heights[1:] - level
    (crossed,) = np.nonzero(before * after < 0)
    return [float(i + before[i] / (before[i] - after[i])) for i in crossed]


def _ticks(axes: Any, maps: Maps, down: Sequence[str], across: Sequence[str]) -> None:
    for place in axes[-1]:
        step = ceil(len(across) / MOST_TICKS)
        place.set_xticks(range(0, len(across), step), across[::step])
        place.set_xlabel(setting_label(maps.columns))
        if len("".join(across[::step])) > CROWDED:
            place.tick_params("x", labelrotation=90)
    for place in axes[:, 0]:
        step = ceil(len(down) / MOST_TICKS)
        place.set_yticks(range(0, len(down), step), down[::step])
        place.set_ylabel(setting_label(maps.rows))
