"""Height fields: a map, and profiles through its middle; the periods in their spectrum."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.report.maps import Mark, Scale, map_with_bar, size_of, spread
from pipeline.report.pictures import Figure
from pipeline.report.svg import Axes, Svg, room_for, ticks

DECADES = 8.0
"""Span of the spectrum's colours at most."""
Line = NDArray[np.floating]

MOST_SAMPLES = 400
"""Length of a profile; of longer rows the middle part is shown."""


def heights(value: HeightField) -> list[Figure]:
    """The map in um with its colour bar, and the profiles of the middle row and column."""
    height = value.height_um
    known = height[np.isfinite(height)]
    rows, columns = height.shape
    unknown = 100 * (1 - known.size / height.size)
    said = [
        f"{value.caption}." if value.caption else "",
        f"{columns * value.pitch_um:.4g} × {rows * value.pitch_um:.4g} µm, a sample every "
        f"{1000 * value.pitch_um:.4g} nm.",
        "The tile repeats." if value.periodic else "",
        f"Lowest to highest {np.ptp(known):.4g} µm, root mean square {known.std(dtype=np.float64):.4g} µm."
        if known.size
        else "No height is known.",
        f"Grey: not known, {unknown:.2g} percent." if unknown else "",
        size_of(height.shape),
    ]
    drawn = map_with_bar(height, value.pitch_um, spread(height, "height (µm)"), unit="µm")
    return [Figure("height", drawn, " ".join(filter(None, said))), *([_profiles(value)] if known.size else [])]


def periods(value: Periodicity) -> list[Figure]:
    """The spectrum with a box around each peak that was found."""
    power = np.log10(np.maximum(value.power_um2, np.finfo(np.float32).tiny))
    high = float(power.max())
    low = max(float(np.percentile(power, 5)), high - DECADES)
    drawn = map_with_bar(power, value.step_per_um[0], _scale(low, high), _boxes(value), unit="1/µm")
    found = "; ".join(
        f"{index}: {period:.4g} ± {error:.2g} µm at {np.rad2deg(direction):.2f} ± {np.rad2deg(off):.2g}°"
        for index, (period, error, direction, off) in enumerate(
            zip(
                value.period_um,
                value.period_error_um,
                value.direction_rad,
                value.direction_error_rad,
                strict=True,
            ),
            1,
        )
    )
    said = f"Boxes: the periods, {found}." if found else "No period stands out."
    return [Figure("spectrum", drawn, f"Spectrum of the heights over frequency, x right and y up. {said}")]


def _scale(low: float, high: float) -> Scale:
    return Scale("log₁₀ power (µm²)", low, high if high > low else low + 1)


def _boxes(value: Periodicity) -> list[Mark]:
    boxes = []
    for index, (period, direction, spread_) in enumerate(
        zip(value.period_um, value.direction_rad, value.spread, strict=True), 1
    ):
        x, y = np.cos(direction) / period, np.sin(direction) / period
        half = max(3 * max(value.step_per_um), spread_ / period)
        boxes.append(Mark(str(index), x - half, x + half, y - half, y + half))
    return boxes


def _profiles(value: HeightField) -> Figure:
    middle_row, middle_column = (count // 2 for count in value.height_um.shape)
    along_x = _middle(value.height_um[middle_row], value.pitch_um)
    along_y = _middle(value.height_um[::-1, middle_column], value.pitch_um)
    shown = np.concatenate([along_x[1], along_y[1]])
    shown = shown[np.isfinite(shown)]
    if not shown.size:
        shown = np.zeros(1)
    margin = 0.06 * float(np.ptp(shown)) or 0.01
    low, high = float(shown.min()) - margin, float(shown.max()) + margin
    reach = max(abs(float(place)) for x, _ in (along_x, along_y) for place in (x[0], x[-1])) or value.pitch_um
    marks = ticks(low, high)
    left = room_for(marks)
    svg = Svg(left + 470, 232)
    axes = Axes(svg, (left, 12, 450, 172), (-reach, reach), (low, high))
    axes.frame()
    axes.label_x("distance from the middle (µm)")
    axes.label_y("height (µm)", marks)
    for (x, y), kind in ((along_x, "curve"), (along_y, "second")):
        for part in _unbroken(x, y):
            svg.path([axes.at(*point) for point in part], kind)
    markup: Markup = svg.markup("height along the middle row and the middle column")
    return Figure("profile", markup, "Height along x through the middle; dashed: along y, upwards.")


def _middle(line: Line, pitch_um: float) -> tuple[Line, Line]:
    """Places and heights of the middle part of a row or column."""
    skipped = max(0, (len(line) - MOST_SAMPLES) // 2)
    part = line[skipped : skipped + MOST_SAMPLES]
    return (np.arange(len(part)) - (len(part) - 1) / 2) * pitch_um, part


def _unbroken(x: Line, y: Line) -> list[list[tuple[float, float]]]:
    """A curve in pieces, cut where it is not known."""
    known = np.isfinite(y)
    cuts = np.flatnonzero(np.diff(known.astype(np.int8))) + 1
    pieces = zip(np.split(x, cuts), np.split(y, cuts), strict=True)
    return [list(zip(a.tolist(), b.tolist(), strict=True)) for a, b in pieces if np.isfinite(b[0])]
