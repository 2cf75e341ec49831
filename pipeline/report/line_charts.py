"""Figures of merit over each swept setting: a row of panels for each figure, a column for each setting."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, prod
from textwrap import wrap
from typing import Any

from markupsafe import Markup

from pipeline.report.charts import CROWDED, Row, as_svg, chart_style, figure_label, numbers, places, short
from pipeline.report.naming import labelled, setting_label, with_unit

PANEL_INCHES = (3.0, 2.4)
LEGEND_INCHES = 1.6
MOST_LINES = 16
"""Lines whose names fit beside the first panel of a column."""
FEW_COLOURS = 10
ALIKE = 1 / 200
"""Share of a figure's range below which two lines look like one."""
ROUNDING = 1e-10
"""Differences, relative to 1 or to the larger figure, that rounding makes."""

Line = tuple[str, ...]
"""The values of the settings that a line does not run over."""


def constants(rows: Sequence[Row], metrics: Sequence[str]) -> dict[str, float]:
    """Figures that are the same at every point but for rounding, and what they are."""
    found = {}
    for metric in metrics:
        known = _known(rows, metric)
        if len(known) > 1 and max(known) - min(known) <= ROUNDING * max(1.0, *map(abs, known)):
            found[metric] = 0.0 if max(map(abs, known)) <= ROUNDING else known[0]
    return found


def line_charts(rows: Sequence[Row], swept: Sequence[str], metrics: Sequence[str]) -> Markup:
    """Draw panels in which points are joined where only the panel's setting varies.

    A setting whose values are words has nothing between them, so its points stand alone. Lines that no reader could
    tell apart in any panel are drawn as one, which is named for all of them.
    """
    from matplotlib.figure import Figure

    groups = {setting: _groups(rows, setting, swept, metrics) for setting in swept}
    with chart_style():
        beside = sum(1 < len(lines) <= MOST_LINES for lines in groups.values())
        size = (PANEL_INCHES[0] * len(swept) + 0.5 + LEGEND_INCHES * beside, PANEL_INCHES[1] * len(metrics))
        figure = Figure(figsize=size, layout="constrained")
        axes = figure.subplots(len(metrics), len(swept), squeeze=False, sharex="col", sharey="row")
        for i, metric in enumerate(metrics):
            for j, setting in enumerate(swept):
                _panel(axes[i][j], rows, setting, metric, swept, groups[setting])
            axes[i][0].set_ylabel("\n".join(wrap(figure_label(metric), 26)))
        for j, setting in enumerate(swept):
            if 1 < len(groups[setting]) <= MOST_LINES:
                title = ", ".join(labelled(short(name), 0.0).label for name in swept if name != setting)
                axes[0][j].legend(frameon=False, fontsize=7, title=title, loc="upper left", bbox_to_anchor=(1, 1))
        return as_svg(figure)


def _known(rows: Sequence[Row], metric: str) -> list[float]:
    return [row[metric] for row in rows if row[metric] is not None and isfinite(row[metric])]


def _groups(rows: Sequence[Row], setting: str, swept: Sequence[str], metrics: Sequence[str]) -> dict[str, list[Line]]:
    """The lines over a setting, by name, those together that look like one for every figure."""
    others = [name for name in swept if name != setting]
    values: dict[Line, dict[tuple[str, str], float | None]] = {}
    for row in rows:
        place = values.setdefault(tuple(row[name] for name in others), {})
        place |= {(metric, row[setting]): row[metric] for metric in metrics}
    span = {metric: max(known) - min(known) for metric in metrics if (known := _known(rows, metric))}
    groups: list[list[Line]] = []
    for line, own in values.items():
        for group in groups:
            if _alike(values[group[0]], own, span):
                group.append(line)
                break
        else:
            groups.append([line])
    counts = [len({line[i] for line in values}) for i in range(len(others))]
    return {_name(group, others, counts): group for group in groups}


def _alike(
    a: Mapping[tuple[str, str], float | None], b: Mapping[tuple[str, str], float | None], span: Mapping[str, float]
) -> bool:
    return a.keys() == b.keys() and all(
        x == y or (x is not None and y is not None and abs(x - y) <= ALIKE * span.get(place[0], 0.0))
        for (place, x), y in zip(a.items(), (b[place] for place in a), strict=True)
    )


def _name(group: Sequence[Line], others: Sequence[str], counts: Sequence[int]) -> str:
    """A line's values with their units; of several lines, what they share and "any" where it makes no difference."""
    units = [labelled(short(name), 0.0).unit for name in others]
    distinct = [dict.fromkeys(line[i] for line in group) for i in range(len(others))]
    first = [with_unit(value, unit) for value, unit in zip(group[0], units, strict=True)]
    if len(group) < prod(map(len, distinct)):
        return f"{', '.join(first)} and {len(group) - 1} like it"
    return ", ".join(
        word if len(some) == 1 else "any" if len(some) == count else f"{word} and {len(some) - 1} more"
        for word, some, count in zip(first, distinct, counts, strict=True)
    )


def _panel(
    axes: Any,
    rows: Sequence[Row],
    setting: str,
    metric: str,
    swept: Sequence[str],
    groups: Mapping[str, Sequence[Line]],
) -> None:
    from matplotlib import colormaps

    others = [name for name in swept if name != setting]
    place = places([row[setting] for row in rows])
    in_words = numbers(list(place)) is None
    few = len(groups) <= FEW_COLOURS
    colours = colormaps["tab10" if few else "tab20"](range(10 if few else 20))
    for index, (name, lines) in enumerate(groups.items()):
        here = [row for row in rows if row[metric] is not None and tuple(row[other] for other in others) == lines[0]]
        points = sorted((place[row[setting]], row[metric]) for row in here)
        style, colour = "o" if in_words else "o-", colours[index % len(colours)]
        x, y = zip(*points, strict=True) if points else ((), ())
        axes.plot(x, y, style, markersize=3.5, linewidth=0.9, label=name, color=colour)
    if in_words or len(place) <= 8:
        axes.set_xticks(list(place.values()), list(place))
        if len("".join(place)) > CROWDED:
            axes.tick_params("x", labelrotation=90)
    axes.margins(x=0.08)
    axes.tick_params(labelbottom=True)
    axes.set_xlabel(setting_label(setting))
