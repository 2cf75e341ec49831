"""Maps with axes, a colour bar and a histogram beside it; orientations with their wheel."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png_uri
from pipeline.report.naming import plain
from pipeline.report.shades import (
    MOST_PIXELS,
    WHEEL_HOLE,
    Shades,
    colours,
    orientation_colours,
    reduced,
    wheel_colours,
)
from pipeline.report.svg import Axes, Svg, room_for, ticks

SIDE = 350.0
"""Longest side of a map on the page, in CSS pixels."""

LEFT, TOP, BELOW = 50.0, 24.0, 40.0
"""Least room around a map, for ticks and names."""

BINS = 64
SECTORS = 36


@dataclass(frozen=True)
class Scale:
    """How numbers become colours: the name with its unit, the numbers at both ends, and the colours between."""

    label: str
    low: float
    high: float
    shades: Shades = "viridis"
    log: bool = False


@dataclass(frozen=True)
class Mark:
    """A box on a map with a word beside it, in the units of the map's axes."""

    words: str
    left: float
    right: float
    low: float
    high: float


def spread(values: NDArray[np.floating], label: str, percent: float = 0.25) -> Scale:
    """A scale that leaves out ``percent`` of the known values at either end."""
    known = values[np.isfinite(values)]
    low, high = np.percentile(known, [percent, 100 - percent]).tolist() if known.size else (0.0, 1.0)
    if not high > low:
        wide = abs(low) * 0.05 or 0.5
        low, high = low - wide, high + wide
    return Scale(label, low, high)


def map_with_bar(
    values: NDArray[np.floating], pitch: float | None, scale: Scale, marks: Sequence[Mark] = (), *, unit: str = "mm"
) -> Markup:
    """A map, its colour bar, and how many pixels have each colour; the pitch is in ``unit``."""
    svg, axes = _framed(values.shape, pitch, 170, unit)
    shown = colours(reduced(values), scale.low, scale.high, scale.shades)
    svg.image(png_uri(shown), axes.left, axes.top, axes.width, axes.height)
    axes.frame()
    _mark(svg, axes, marks)
    ramp = np.linspace(scale.high, scale.low, 256, dtype=np.float32)[:, None]
    bar, widest = colour_bar(svg, axes, colours(ramp, scale.low, scale.high, scale.shades), scale)
    _histogram(svg, values, scale, (bar.right + 15 + 7 * widest, bar.top, 168 - 50 - 7 * widest, bar.height))
    return svg.markup(f"map of {scale.label}")


def orientation_map(
    orientation_rad: NDArray[np.floating], pixel_mm: float | None, marks: Sequence[Mark] = ()
) -> Markup:
    """Orientations as hues, the wheel that names them, and in it a rose of how common each is."""
    svg, axes = _framed(orientation_rad.shape, pixel_mm, 170)
    shown = orientation_colours(reduced(orientation_rad, axial=True))
    svg.image(png_uri(shown), axes.left, axes.top, axes.width, axes.height)
    axes.frame()
    _mark(svg, axes, marks)
    radius = 54.0
    x, y = axes.right + 94, axes.top + max(radius + 16, axes.height / 2)
    svg.image(png_uri(wheel_colours(int(4 * radius))), x - radius, y - radius, 2 * radius, 2 * radius)
    for degrees in range(0, 360, 45):
        direction = math.radians(degrees)
        words = f"{degrees % 180}°"
        svg.text(
            x + (radius + 14) * math.cos(direction), y - (radius + 11) * math.sin(direction) + 4, words, anchor="middle"
        )
    _rose(svg, orientation_rad, x, y, (WHEEL_HOLE - 0.05) * radius)
    return svg.markup("orientation as hue, with its colour wheel")


def marked(signal: NDArray[np.floating], kept: NDArray[np.bool_], pixel_mm: float | None, *, white: float) -> Markup:
    """A linear signal in greys, encoded for a display, from 0 to ``white``; what is not kept is tinted."""
    svg, axes = _framed(signal.shape, pixel_mm, 80)
    share = reduced(kept)[..., None]
    level = np.nan_to_num(reduced(encode_srgb(signal / white)))[..., None]
    tinted = 0.55 * level + 0.45 * np.array(TINT, np.float32)
    svg.image(png_uri(share * level + (1 - share) * tinted), axes.left, axes.top, axes.width, axes.height)
    axes.frame()
    colour_bar(svg, axes, encode_srgb(np.linspace(1, 0, 256)[:, None]), Scale("signal", 0.0, white))
    return svg.markup("what the mask keeps")


TINT = (0.93, 0.35, 0.13)


def size_of(shape: tuple[int, ...], *, most: int = MOST_PIXELS, axial: bool = False) -> str:
    """How large a map is, and how it was made smaller for the page."""
    rows, columns = shape[:2]
    if max(rows, columns) <= most:
        return f"{columns} × {rows} pixels."
    shrink = most / max(rows, columns)
    mean = "axial mean" if axial else "mean"
    side = plain(1 / shrink, 2)
    return (
        f"{columns} × {rows} pixels, shown as {round(columns * shrink)} × {round(rows * shrink)}, each the {mean} of "
        f"about {side} × {side} pixels."
    )


def _framed(shape: tuple[int, ...], pitch: float | None, beside: float, unit: str = "mm") -> tuple[Svg, Axes]:
    """Axes around a map: from the centre, y up, or in pixels from the upper left corner where no pitch is known."""
    rows, columns = shape[:2]
    shrink = SIDE / max(rows, columns)
    width, height = max(columns * shrink, 40.0), max(rows * shrink, 40.0)
    if pitch:
        half_x, half_y = columns * pitch / 2, rows * pitch / 2
        x, y = (-half_x, half_x), (-half_y, half_y)
    else:
        x, y = (0.0, float(columns)), (float(rows), 0.0)
    down = ticks(min(y), max(y), most=max(2, int(height // 36)))
    left = max(LEFT, room_for(down))
    svg = Svg(left + width + beside, TOP + height + BELOW)
    axes = Axes(svg, (left, TOP, width, height), x, y)
    axes.label_x(f"x ({unit})" if pitch else "column (px)", ticks(min(x), max(x), most=max(2, int(width // 48))))
    axes.label_y(f"y ({unit})" if pitch else "row (px)", down)
    return svg, axes


def _mark(svg: Svg, axes: Axes, marks: Sequence[Mark]) -> None:
    """Boxes on a map, white on black so that they show on every colour; the word stands at the upper right corner."""
    for mark in marks:
        (x0, y0), (x1, y1) = axes.at(mark.left, mark.high), axes.at(mark.right, mark.low)
        for kind in ("mark under", "mark"):
            svg.rect(x0, y0, x1 - x0, y1 - y0, kind)
        inside = x1 + 8 * len(mark.words) < axes.right
        x, anchor = (x1 + 3, "start") if inside else (x0 - 3, "end")
        for kind in ("note under", "note"):
            svg.text(x, max(y0 + 9, axes.top + 10), mark.words, anchor=anchor, kind=kind)


def colour_bar(svg: Svg, axes: Axes, ramp: NDArray[np.floating], scale: Scale) -> tuple[Axes, int]:
    """A colour bar beside a map, high above low; its axes, and the characters of its widest tick."""
    bar = Axes(svg, (axes.right + 16, axes.top, 13, axes.height), (0, 1), (scale.low, scale.high))
    svg.image(png_uri(ramp), bar.left, bar.top, bar.width, bar.height)
    bar.frame()
    marks = ticks(scale.low, scale.high, most=max(2, int(bar.height // 42)))
    for value, words in marks:
        _, y = bar.at(0, value)
        svg.line(bar.right, y, bar.right + 4, y)
        svg.text(bar.right + 7, y + 4, words)
    svg.text(bar.left, axes.top - 9, scale.label, kind="label")
    return bar, max((len(words) for _, words in marks), default=1)


def _histogram(svg: Svg, values: NDArray[np.floating], scale: Scale, box: tuple[float, float, float, float]) -> None:
    """Bars along the colour bar; the outermost ones also count what lies beyond."""
    known = np.clip(values[np.isfinite(values)], scale.low, scale.high)
    counts, _ = np.histogram(known, BINS, (scale.low, scale.high))
    most = float(counts.max())
    if not most:
        return
    length = _log_length if scale.log else float
    axes = Axes(svg, box, (0, length(most)), (scale.low, scale.high))
    edges = np.linspace(scale.low, scale.high, BINS + 1)
    outline = [axes.at(0, scale.low)]
    for count, low, high in zip(counts.tolist(), edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        outline += [axes.at(length(count), low), axes.at(length(count), high)]
    svg.path([*outline, axes.at(0, scale.high)], "bars", closed=True)
    svg.line(axes.left, axes.top, axes.left, axes.bottom)
    svg.line(axes.left, axes.bottom, axes.right, axes.bottom)
    places = [10.0**power for power in range(1, 9)] if scale.log else [10.0 ** math.floor(math.log10(most))]
    if not scale.log:
        places = [places[0] * (most // places[0])]
    inside = [place for place in places if place <= most * 1.001]
    for place in inside[:: 2 if len(inside) > 2 else 1] if scale.log else inside:
        x, y = axes.at(length(place), scale.low)
        svg.line(x, y, x, y + 4)
        svg.text(x, y + 15, _short(place), anchor="middle")
    name = "pixels (log)" if scale.log else "pixels"
    svg.text((axes.left + axes.right) / 2, axes.bottom + 31, name, anchor="middle", kind="label")


def _log_length(count: float) -> float:
    return math.log10(1 + count)


def _short(count: float) -> str:
    for limit, unit in ((1e6, "M"), (1e3, "k")):
        if count >= limit:
            return f"{count / limit:g}{unit}"
    return f"{count:g}"


def _rose(svg: Svg, orientation_rad: NDArray[np.floating], x: float, y: float, radius: float) -> None:
    """A sector for each direction, its area by the number of pixels; both ends of an axis are drawn."""
    known = orientation_rad[np.isfinite(orientation_rad)]
    if not known.size:
        return
    counts, edges = np.histogram(np.mod(known, np.pi), SECTORS, (0, np.pi))
    for count, first, last in zip(counts.tolist(), edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        reach = radius * math.sqrt(count / counts.max())
        for turn in (0.0, math.pi):
            ends = [(x + reach * math.cos(a + turn), y - reach * math.sin(a + turn)) for a in (first, last)]
            if count:
                svg.path([(x, y), *ends], "bars", closed=True)
