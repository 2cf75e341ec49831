"""A polariser's response as a map over both angles with its row maxima, and how far these lie from a line."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.polarization import LineDeviation, PolarizerResponse
from pipeline.optics.row_maxima import normalized_rows
from pipeline.report.encoded import png_uri
from pipeline.report.maps import BELOW, SIDE, TOP, Scale, colour_bar, spread
from pipeline.report.pictures import Figure
from pipeline.report.shades import colours, reduced
from pipeline.report.svg import Axes, Svg, room_for, ticks

BESIDE = 90.0
"""Room for the colour bar."""

PSI, THETA = "polariser ψ (°)", "orientation θ (°)"
PLACES = [(float(degrees), str(degrees)) for degrees in range(0, 180, 30)]


def shown_rows(value: PolarizerResponse) -> NDArray[np.float64]:
    """``I_norm`` as a picture, orientations upwards; NaN where a row is flat."""
    rows = normalized_rows(value.intensity)
    rows[np.isnan(value.row_maximum_rad)] = np.nan
    return rows[::-1]


def responses(value: PolarizerResponse) -> list[Figure]:
    """The map with normalised rows, as the paper shows it, and the intensity itself."""
    flat = int(np.isnan(value.row_maximum_rad).sum())
    rows, columns = value.intensity.shape
    settings = (
        f"{value.label[:1].upper()}{value.label[1:]}: R = {value.amplitude_ratio:.6g} exp(i "
        f"{np.rad2deg(value.phase_rad):.4g}°); the film retards by {np.rad2deg(value.retardation_rad):.4g}° a pass "
        f"along {np.rad2deg(value.film_axis_rad):.4g}°. "
    )
    line = "Without a film no row would have a maximum. "
    if value.offset_rad is not None:
        line = f"Black: where they would lie without a film, ψ = θ + {np.rad2deg(value.offset_rad):.2f}°. "
    flatness = f"Grey: {flat} of {rows} rows, which the polariser leaves as they are. " if flat else ""
    taken = "The mean over all orientations was subtracted from each column. " if value.prenormalized else ""
    scale = spread(value.intensity, "intensity", 0)
    variation = np.ptp(value.intensity, axis=1)
    return [
        Figure(
            "normalised rows",
            _map(value, shown_rows(value), Scale("I norm", -1.0, 1.0)),
            f"{settings}{taken}Each row less its mean, by its scaled standard deviation. Red: row maxima. {line}"
            f"{flatness}{columns} × {rows} angles.",
        ),
        Figure(
            "intensity",
            _map(value, value.intensity[::-1], scale),
            f"{taken}The same before rows were normalised; a grating with R = 1 without a film has 1. Over ψ the "
            f"weakest row varies by {variation.min():.3g}, the strongest by {variation.max():.3g}.",
        ),
    ]


def deviations(value: LineDeviation) -> list[Figure]:
    """Deviation of the row maxima from their line over the orientation, before and after pre-normalisation."""
    theta = np.rad2deg(value.orientation_rad)
    curves = [
        (np.rad2deg(rad), kind)
        for rad, kind in ((value.deviation_rad, "curve"), (value.prenormalized_rad, "second"))
        if np.isfinite(rad).any()
    ]
    if not curves:
        return []
    limit = max(0.01, 1.1 * max(float(np.nanmax(np.abs(curve))) for curve, _ in curves))
    marks = ticks(-limit, limit)
    left = room_for(marks)
    svg = Svg(left + 370, 232)
    axes = Axes(svg, (left, 12, 350, 172), (0, 180), (-limit, limit))
    axes.frame()
    axes.label_x(THETA, [*PLACES, (180.0, "180")])
    axes.label_y("deviation (°)", marks)
    _, zero = axes.at(0, 0)
    svg.line(axes.left, zero, axes.right, zero)
    for curve, kind in curves:
        for part in _unbroken(theta, curve):
            svg.path([axes.at(x, y) for x, y in part], kind)
    both = "; dashed: after pre-normalisation, from a line of its own" if len(curves) == 2 else ""
    return [
        Figure(
            "deviation",
            svg.markup("deviation of the row maxima from a line"),
            f"Row maxima minus the line ψ = θ + offset that fits them best, anticlockwise positive{both}. Curves are "
            "broken where they pass ±90°, which are one.",
        )
    ]


def _map(value: PolarizerResponse, picture: NDArray[np.floating], scale: Scale) -> Markup:
    half_x, half_y = (90 / count for count in reversed(value.intensity.shape))
    left = room_for(PLACES)
    svg = Svg(left + SIDE + BESIDE, TOP + SIDE + BELOW)
    axes = Axes(svg, (left, TOP, SIDE, SIDE), (-half_x, 180 - half_x), (-half_y, 180 - half_y))
    shown = colours(reduced(picture), scale.low, scale.high, scale.shades)
    svg.image(png_uri(shown), axes.left, axes.top, axes.width, axes.height)
    if value.offset_rad is not None:
        _line(svg, axes, float(np.rad2deg(value.offset_rad)))
    maxima = np.rad2deg(value.row_maximum_rad)
    every = max(1, len(maxima) // 180)
    for psi, theta in zip(maxima[::every].tolist(), np.rad2deg(value.orientation_rad)[::every].tolist(), strict=True):
        if np.isfinite(psi):
            # A maximum in the last half step belongs to the column at 0.
            svg.dot(*axes.at(psi if psi < 180 - half_x else psi - 180, theta), 1.5, "maximum")
    axes.frame()
    axes.label_x(PSI, PLACES)
    axes.label_y(THETA, PLACES)
    ramp = np.linspace(scale.high, scale.low, 256, dtype=np.float32)[:, None]
    colour_bar(svg, axes, colours(ramp, scale.low, scale.high, scale.shades), scale)
    return svg.markup(f"{scale.label} over the angles of polariser and grating")


def _line(svg: Svg, axes: Axes, offset_deg: float) -> None:
    """``psi = theta + offset`` across the map, in the pieces that the wrap at 180 degrees cuts it into."""
    (left, right), (low, high) = axes.x, axes.y
    for turn in (-180.0, 0.0, 180.0):
        start, stop = max(low, left - offset_deg + turn), min(high, right - offset_deg + turn)
        if start < stop:
            svg.path([axes.at(theta + offset_deg - turn, theta) for theta in (start, stop)], "expected")


def _unbroken(x: NDArray[np.floating], y: NDArray[np.floating]) -> list[list[tuple[float, float]]]:
    """A curve in pieces, cut where an axial angle jumps by more than a right angle or is unknown."""
    parts: list[list[tuple[float, float]]] = [[]]
    for a, b in zip(x.tolist(), y.tolist(), strict=True):
        if not np.isfinite(b) or (parts[-1] and abs(b - parts[-1][-1][1]) > 90):
            parts.append([])
        if np.isfinite(b):
            parts[-1].append((a, b))
    return [part for part in parts if len(part) > 1]
