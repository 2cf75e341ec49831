"""Figures of what flash photographs tell: highlights marked in the photographs, and distributions of gratings."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.flash_maps import GratingDistribution, Highlights
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png_uri, webp_uri
from pipeline.report.maps import Scale, colour_bar
from pipeline.report.pictures import Figure
from pipeline.report.shades import colours
from pipeline.report.svg import Axes, Svg

SIDE = 330.0
_WHITE_PERCENTILE = 98.0


def highlights(value: Highlights) -> list[Figure]:
    """Each photograph with a circle of two standard deviations around its highlight, and a cross where it should be."""
    cells = [
        Markup('<div class="cell"><span>{}</span>{}</div>').format(_words(value, index), _marked(value, index))
        for index in range(len(value.photographs))
    ]
    extent = "" if value.light_sigma_mm is None else f" The flash's extent follows: {value.light_sigma_mm:.3g} mm."
    return [
        Figure(
            "highlights",
            Markup('<div class="sheet few">{}</div>').format(Markup("").join(cells)),
            "Brightness of each photograph, exposed for what lies around the highlight. Circle: two standard "
            "deviations of the highlight that was found; cross: where the stated places of flash and camera put it."
            f"{extent}",
            wide=True,
        )
    ]


def distribution(value: GratingDistribution) -> list[Figure]:
    """How common each orientation and period is."""
    svg = Svg(SIDE + 190, SIDE + 70)
    step_um = float(value.period_um[1] - value.period_um[0]) / 2
    axes = Axes(
        svg,
        (56, 22, SIDE, SIDE),
        (float(value.period_um[0]) - step_um, float(value.period_um[-1]) + step_um),
        (0.0, 180.0),
    )
    share = 100 * np.where(value.seen, value.share, np.nan)[::-1]
    scale = Scale("share (%)", 0.0, max(float(np.nanmax(share, initial=0.0)), 1e-6))
    svg.image(png_uri(_enlarged(share, scale)), axes.left, axes.top, axes.width, axes.height)
    axes.frame()
    axes.label_x("period (µm)")
    axes.label_y("orientation (°)", [(float(angle), f"{angle}") for angle in range(0, 181, 30)])
    ramp = colours(np.linspace(scale.high, scale.low, 256, dtype=np.float32)[:, None], scale.low, scale.high, "viridis")
    colour_bar(svg, axes, ramp, scale)
    rows, columns = value.share.shape
    return [
        Figure(
            "distribution",
            svg.markup("share of gratings over orientation and period"),
            f"Share of the sheet's gratings in each of {rows} × {columns} bins; grey: bins that the photograph does "
            "not show.",
        )
    ]


def shown_distribution(value: GratingDistribution) -> NDArray[np.float32]:
    """The distribution as a picture, orientation up."""
    share = np.where(value.seen, value.share, np.nan)[::-1]
    return _enlarged(share, Scale("share", 0.0, max(float(np.nanmax(share, initial=0.0)), 1e-9)))


def _enlarged(share: NDArray[np.floating], scale: Scale) -> NDArray[np.float32]:
    shown = colours(share.astype(np.float32), scale.low, scale.high, "viridis")
    times = [max(1, round(SIDE / size)) for size in share.shape]
    return np.repeat(np.repeat(shown, times[0], axis=0), times[1], axis=1)


def _words(value: Highlights, index: int) -> str:
    if value.outside[index]:
        return "no highlight in the picture"
    x, y = value.place_mm[index]
    words = f"({x:.1f}, {y:.1f}) mm, σ {value.sigma_mm[index]:.2g} mm"
    return f"{words}, saturated" if value.saturated[index] else words.replace("-", "−")


def _marked(value: Highlights, index: int) -> Markup:
    photograph = value.photographs[index]
    known = photograph[np.isfinite(photograph)]
    white = float(np.percentile(known, _WHITE_PERCENTILE)) if known.size else 1.0
    grey = encode_srgb(np.nan_to_num(photograph) / (white or 1.0))
    rows, columns = photograph.shape
    svg = Svg(columns, rows)
    svg.image(webp_uri(np.repeat(grey[..., None], 3, axis=2)), 0, 0, columns, rows)
    for kind in ("mark under", "mark"):
        if np.isfinite(value.sigma_mm[index]):
            column, row = _pixel(value, value.place_mm[index], (rows, columns))
            radius = 2 * float(value.sigma_mm[index]) / value.pixel_mm
            turn = np.linspace(0, 2 * np.pi, 65)
            svg.path([(column + radius * np.cos(t), row + radius * np.sin(t)) for t in turn], kind, closed=True)
        if np.isfinite(value.stated_mm[index]).all():
            column, row = _pixel(value, value.stated_mm[index], (rows, columns))
            svg.line(column - 8, row, column + 8, row, kind)
            svg.line(column, row - 8, column, row + 8, kind)
    return svg.markup("photograph with its highlight")


def _pixel(value: Highlights, place_mm: NDArray[np.floating], shape: tuple[int, int]) -> tuple[float, float]:
    rows, columns = shape
    return (
        float(place_mm[0] / value.pixel_mm + (columns - 1) / 2),
        float((rows - 1) / 2 - place_mm[1] / value.pixel_mm),
    )
