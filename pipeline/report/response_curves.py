"""The curve that a fit found, over the points that it was fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import OrientationMap
from pipeline.optics.response_curve import FilmedGrating, response_curve
from pipeline.report.encoded import png_uri
from pipeline.report.maps import BELOW, SIDE, TOP
from pipeline.report.pictures import Figure
from pipeline.report.svg import Axes, Svg, room_for, ticks

_CELLS = 120
_INK = (0.84, 0.15, 0.24)
_NAMED_DEG = range(0, 180, 30)


def response_curves(value: OrientationMap) -> list[Figure]:
    """Relative Stokes parameters as a density, and the curve of the map's parameters through them."""
    if value.stokes is None or not len(value.stokes):
        return []
    found = value.parameters
    angles = np.deg2rad([found[name] for name in ("phase_deg", "retardation_deg", "film_axis_deg")])
    curve = response_curve(FilmedGrating(found["amplitude_ratio"], *angles.tolist()))
    limit = 1.1 * float(max(np.abs(curve.stokes).max(), np.percentile(np.abs(value.stokes), 99.5)))
    places = ticks(-limit, limit)
    left = room_for(places)
    svg = Svg(left + SIDE + 30, TOP + SIDE + BELOW)
    axes = Axes(svg, (left, TOP, SIDE, SIDE), (-limit, limit), (-limit, limit))
    svg.image(png_uri(_density(value.stokes, limit)), axes.left, axes.top, axes.width, axes.height)
    svg.line(*axes.at(-limit, 0), *axes.at(limit, 0))
    svg.line(*axes.at(0, -limit), *axes.at(0, limit))
    svg.path([axes.at(*point) for point in curve.stokes.tolist()], "curve", closed=True)
    for degrees in _NAMED_DEG:
        x, y = axes.at(*curve.stokes[round(degrees / 180 * len(curve.stokes))].tolist())
        svg.dot(x, y, 3)
        svg.text(x + 6, y - 4, f"{degrees}°")
    axes.frame()
    axes.label_x("s₁", places)
    axes.label_y("s₂", places)
    return [
        Figure(
            "response curve",
            svg.markup("response curve through the measured Stokes parameters"),
            f"Relative Stokes parameters of {len(value.stokes)} pixels, and the curve that they lie on; along it the "
            f"orientation, every 30°. R = {found['amplitude_ratio']:.3f} exp(i {found['phase_deg']:.1f}°), film of "
            f"{found['retardation_deg']:.2f}° along {found['film_axis_deg']:.1f}°; the pixels lie "
            f"{found['curve_misfit']:.2f} times their noise from it.",
        )
    ]


def _density(stokes: NDArray[np.floating], limit: float) -> NDArray[np.floating]:
    """How many points lie in each cell, as an ink whose opacity is the logarithm: shape (C, C, 4), y up."""
    edges = np.linspace(-limit, limit, _CELLS + 1)
    count = np.histogram2d(stokes[:, 1], stokes[:, 0], (edges, edges))[0][::-1]
    shown = np.log1p(count) / np.log1p(max(float(count.max()), 1.0))
    return np.dstack([np.broadcast_to(np.array(_INK, np.float32), (*count.shape, 3)), shown])
