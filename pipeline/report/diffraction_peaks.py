"""Diffraction in the plane of incidence: the response with its peaks and the grating equation, and the periods."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.diffraction import DiffractionPeaks
from pipeline.optics.diffraction.order_peaks import order_angle
from pipeline.report.encoded import png_uri
from pipeline.report.maps import Scale, colour_bar
from pipeline.report.pictures import Figure
from pipeline.report.shades import colours
from pipeline.report.svg import Axes, Svg, room_for, ticks

DECADES = 3.5
"""Span of the colours, down from the brightest peak."""
MOST_ROWS = 720
LEAST_RANGE_NM = 0.02
SIDE, HEIGHT, TOP, BELOW, BESIDE = 430, 430, 24, 44, 112
LABEL = "wavelength (nm)"


def grating_angles(value: DiffractionPeaks) -> NDArray[np.float64]:
    """Where the grating equation sees the order of the mean period at each wavelength, in radians; NaN without one."""
    period_um = value.metrics.get("period_um", float("nan"))
    return order_angle(period_um, value.wavelength_nm / 1000, value.order, value.light_rad)


def diffraction_peaks(value: DiffractionPeaks) -> list[Figure]:
    """The map, and where peaks stand out the curve of periods."""
    return [_map(value), *([_periods(value)] if np.isfinite(value.period_um).any() else [])]


def _map(value: DiffractionPeaks) -> Figure:
    view_deg = np.rad2deg(value.view_rad)
    every = -(-len(view_deg) // MOST_ROWS)
    brightest = np.maximum.reduceat(value.response.T[::-1], np.arange(0, len(view_deg), every))
    power = np.log10(np.maximum(brightest, np.finfo(np.float32).tiny))
    high = float(np.log10(_brightest_peak(value)))
    scale = Scale("log₁₀ response", high - DECADES, high)
    marks = [(float(degrees), f"{degrees}".replace("-", "−")) for degrees in range(-80, 81, 20)]
    left = room_for(marks)
    svg = Svg(left + SIDE + BESIDE, TOP + HEIGHT + BELOW)
    half = (value.wavelength_nm[1] - value.wavelength_nm[0]) / 2
    ends = float(value.wavelength_nm[0] - half), float(value.wavelength_nm[-1] + half)
    axes = Axes(svg, (left, TOP, SIDE, HEIGHT), ends, (float(view_deg[0]), float(view_deg[-1])))
    svg.image(png_uri(colours(power, scale.low, scale.high, scale.shades)), axes.left, axes.top, SIDE, HEIGHT)
    for part in _unbroken(value.wavelength_nm, np.rad2deg(grating_angles(value))):
        svg.path([axes.at(*point) for point in part], "order")
    for length, degrees in zip(value.wavelength_nm.tolist(), np.rad2deg(value.peak_rad).tolist(), strict=True):
        if np.isfinite(degrees):
            svg.dot(*axes.at(length, degrees), 1.0, "maximum")
    axes.frame()
    axes.label_x(LABEL)
    axes.label_y("angle of view (°)", marks)
    ramp = np.linspace(scale.high, scale.low, 256, dtype=np.float32)[:, None]
    colour_bar(svg, axes, colours(ramp, scale.low, scale.high, scale.shades), scale)
    found = value.metrics
    line = "No peak stands out. "
    if "period_um" in found:
        line = (
            f"Red: the brightest angle of order {value.order} at {found['peaks']:.0f} of {len(value.wavelength_nm)} "
            f"wavelengths. Blue: the grating equation for their mean period, {1000 * found['period_um']:.3f} nm. "
        )
    return Figure(
        "response",
        svg.markup("response over wavelength and angle of view"),
        f"{value.caption}{'. ' if value.caption else ''}Response in the plane of incidence at "
        f"{np.rad2deg(value.azimuth_rad):.4g}°, light at {np.rad2deg(value.light_rad):.4g}°, relative to a mirror; "
        f"angles of view are negative beyond the normal. {line}Evaluator: {value.evaluator}.",
    )


def _brightest_peak(value: DiffractionPeaks) -> float:
    """Response at the brightest of the order's peaks, or of all where there are none."""
    found = np.flatnonzero(np.isfinite(value.peak_rad))
    nearest = np.searchsorted(value.view_rad, value.peak_rad[found])
    peaks = value.response[found, nearest] if found.size else value.response
    return max(float(peaks.max()), float(np.finfo(np.float32).tiny))


def _periods(value: DiffractionPeaks) -> Figure:
    period = 1000 * value.period_um
    mean, spread = 1000 * value.metrics["period_um"], value.metrics["period_spread_nm"]
    margin = max(0.08 * float(np.nanmax(period) - np.nanmin(period)), LEAST_RANGE_NM / 2)
    low, high = float(np.nanmin(period)) - margin, float(np.nanmax(period)) + margin
    marks = ticks(low, high)
    left = room_for(marks)
    svg = Svg(left + 450, 272)
    axes = Axes(svg, (left, 12, 430, 212), (float(value.wavelength_nm[0]), float(value.wavelength_nm[-1])), (low, high))
    svg.line(*axes.at(axes.x[0], mean), *axes.at(axes.x[1], mean))
    for part in _unbroken(value.wavelength_nm, period):
        svg.path([axes.at(*point) for point in part], "curve")
    for length, nm in zip(value.wavelength_nm.tolist(), period.tolist(), strict=True):
        if np.isfinite(nm):
            svg.dot(*axes.at(length, nm), 1.5, title=f"{length:g} nm: {nm:.4f} nm")
    axes.frame()
    axes.label_x(LABEL)
    axes.label_y("period (nm)", marks)
    said = value.metrics.get("spectrum_period_um")
    spectrum = f" The surface's own spectrum says {1000 * said:.4g} nm." if said is not None else ""
    return Figure(
        "period",
        svg.markup("period over wavelength"),
        f"Period by the grating equation from each wavelength's peak: {mean:.3f} nm, the line, with a standard "
        f"deviation of {spread:.3g} nm.{spectrum}",
    )


def _unbroken(x: NDArray[np.floating], y: NDArray[np.floating]) -> list[list[tuple[float, float]]]:
    """A curve in pieces, cut where it is not known."""
    known = np.isfinite(y)
    cuts = np.flatnonzero(np.diff(known.astype(np.int8))) + 1
    pieces = zip(np.split(x, cuts), np.split(y, cuts), strict=True)
    return [list(zip(a.tolist(), b.tolist(), strict=True)) for a, b in pieces if np.isfinite(b[0])]
