"""BRDF maps on black: a disc of directions of view for each direction of light."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.diffraction import BrdfMap
from pipeline.optics.colour import LUMINANCE, encode_srgb
from pipeline.report.encoded import webp_uri
from pipeline.report.pictures import PICTURE_PIXELS, Figure
from pipeline.report.shades import reduced

_WHITE_PERCENTILE = 99.0


def exposed(
    rgb: NDArray[np.floating], white_percentile: float = _WHITE_PERCENTILE
) -> tuple[NDArray[np.float32], float]:
    """Pictures encoded for a display, and what is shown as white: brighter than most, not than a mirror."""
    bright = (np.clip(rgb, 0, None) @ LUMINANCE)[rgb.any(axis=-1)]
    white = float(np.percentile(bright, white_percentile)) if bright.size else 1.0
    return encode_srgb(rgb / (white or 1.0)), white or 1.0


def brdf_maps(value: BrdfMap) -> list[Figure]:
    """One disc for each light."""
    shown, white = exposed(value.rgb)
    cells = [
        Markup('<div class="cell"><span>light {}</span><img alt="BRDF over all views" src="{}"></div>').format(
            _place(light), webp_uri(reduced(picture, most=PICTURE_PIXELS))
        )
        for light, picture in zip(value.light, shown, strict=True)
    ]
    return [
        Figure(
            "BRDF",
            Markup('<div class="sheet few">{}</div>').format(Markup("").join(cells)),
            f"{value.caption}{'. ' if value.caption else ''}Seen from all directions above: the middle of a disc is "
            f"the normal, its edge grazing, x to the right, y up. Relative to a mirror at normal incidence; white is "
            f"{white:.3g}. Evaluator: {value.evaluator}.",
            wide=True,
        )
    ]


def _place(light: NDArray[np.floating]) -> str:
    x, y, z = (float(c) for c in light)
    theta = np.rad2deg(np.arctan2(np.hypot(x, y), z))
    if theta < 0.05:
        return "from above"
    return f"{theta:.3g}° from the normal, azimuth {np.rad2deg(np.arctan2(y, x)) + 0.0:.3g}°".replace("-", "−")
