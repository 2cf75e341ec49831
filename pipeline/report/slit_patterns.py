"""Patterns behind slits: curves for each number of slits, and strips of colour, one wavelength above white light."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.diffraction import SlitPatterns
from pipeline.optics.colour import encode_srgb, spectral_colour
from pipeline.report.encoded import png_uri
from pipeline.report.pictures import Figure
from pipeline.report.shades import reduced
from pipeline.report.svg import Axes, Svg

WIDTH, LEFT, TOP = 620, 74, 14
CURVE, STRIP, GAP = 46, 22, 14
STRIP_PIXELS, GAP_PIXELS = 24, 8
LABEL = "place on the screen (mm)"


def strips(value: SlitPatterns) -> NDArray[np.float32]:
    """Pairs of strips, encoded for a display: one wavelength above white light, black between pairs."""
    one = value.intensity[..., None] * spectral_colour(value.wavelength_nm).astype(np.float32)
    gap = np.zeros((GAP_PIXELS, len(value.position_mm), 3), np.float32)
    pairs = [
        np.concatenate([np.repeat(upper[None], STRIP_PIXELS, 0), np.repeat(lower[None], STRIP_PIXELS, 0), gap])
        for upper, lower in zip(one, value.white_rgb, strict=True)
    ]
    return encode_srgb(np.concatenate(pairs)[:-GAP_PIXELS])


def slit_patterns(value: SlitPatterns) -> list[Figure]:
    """The curves, and the strips."""
    return [
        Figure(
            "intensity",
            _curves(value),
            f"{value.caption}: intensity at {value.wavelength_nm:g} nm, relative to the middle, from 0 to 1 for each "
            "number of slits.",
            wide=True,
        ),
        Figure(
            "colours",
            _strips(value),
            f"The same as seen, for each number of slits: {value.wavelength_nm:g} nm above, white light (D65) below. "
            "What a display cannot show is clipped.",
            wide=True,
        ),
    ]


def _curves(value: SlitPatterns) -> Markup:
    count = len(value.slits)
    svg = Svg(LEFT + WIDTH + 12, TOP + count * (CURVE + GAP) + 36)
    for i, (slits, line) in enumerate(zip(value.slits.tolist(), value.intensity, strict=True)):
        axes = _axes(svg, value, TOP + i * (CURVE + GAP), CURVE)
        svg.path([axes.at(*point) for point in zip(value.position_mm.tolist(), line.tolist(), strict=True)], "curve")
        _name(svg, axes, slits)
    axes.label_x(LABEL)
    return svg.markup("intensity on the screen for each number of slits")


def _strips(value: SlitPatterns) -> Markup:
    count = len(value.slits)
    svg = Svg(LEFT + WIDTH + 12, TOP + count * (2 * STRIP + GAP) + 36)
    one = value.intensity[..., None] * spectral_colour(value.wavelength_nm).astype(np.float32)
    for i, (slits, *pair) in enumerate(zip(value.slits.tolist(), one, value.white_rgb, strict=True)):
        axes = _axes(svg, value, TOP + i * (2 * STRIP + GAP), 2 * STRIP)
        for k, colour in enumerate(pair):
            shown = encode_srgb(reduced(colour[None], most=2 * WIDTH))
            svg.image(png_uri(shown), axes.left, axes.top + k * STRIP, axes.width, STRIP)
        _name(svg, axes, slits)
    axes.label_x(LABEL)
    return svg.markup("colours on the screen for each number of slits")


def _axes(svg: Svg, value: SlitPatterns, top: float, height: float) -> Axes:
    ends = float(value.position_mm[0]), float(value.position_mm[-1])
    return Axes(svg, (LEFT, top, WIDTH, height), ends, (0.0, 1.0))


def _name(svg: Svg, axes: Axes, slits: int) -> None:
    axes.frame()
    words = "1 slit" if slits == 1 else f"{slits} slits"
    svg.text(axes.left - 8, axes.top + axes.height / 2 + 4, words, anchor="end")
