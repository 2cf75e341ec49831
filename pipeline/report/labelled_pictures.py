"""Pictures of one scene beside each other, all at one exposure."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.pictures import Pictures
from pipeline.report.brdf_maps import exposed
from pipeline.report.encoded import webp_uri
from pipeline.report.pictures import PICTURE_PIXELS, Figure
from pipeline.report.shades import reduced

_WHITE_PERCENTILE = 98.0
"""So that highlights, which are hundreds of times as bright, do not darken the rest."""


def exposed_pictures(value: Pictures) -> tuple[NDArray[np.float32], float]:
    """Pictures encoded for a display, and what is shown as white."""
    return exposed(value.rgb, _WHITE_PERCENTILE)


def labelled_pictures(value: Pictures) -> list[Figure]:
    """Every picture under its label."""
    shown, white = exposed_pictures(value)
    cells = [
        Markup('<div class="cell"><span>{0}</span><img alt="{0}" src="{1}"></div>').format(
            label, webp_uri(reduced(picture, most=PICTURE_PIXELS))
        )
        for label, picture in zip(value.labels, shown, strict=True)
    ]
    rows, columns = value.rgb.shape[1:3]
    return [
        Figure(
            "pictures",
            Markup('<div class="sheet few">{}</div>').format(Markup("").join(cells)),
            f"{value.caption}{'. ' if value.caption else ''}{columns} × {rows} pixels. In all of "
            f"them black is 0 and white {white:.3g} of a white matt surface that faces the light.",
            wide=True,
        )
    ]
