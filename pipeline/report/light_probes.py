"""A light probe as a picture."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.light_probes import LightProbe
from pipeline.report.brdf_maps import exposed
from pipeline.report.encoded import webp_uri
from pipeline.report.pictures import PICTURE_PIXELS, Figure
from pipeline.report.shades import reduced

_WHITE_PERCENTILE = 99.0
"""So that lamps do not darken the rest."""


def exposed_probe(value: LightProbe) -> tuple[NDArray[np.float32], float]:
    """The probe encoded for a display, and what is shown as white."""
    return exposed(value.rgb, _WHITE_PERCENTILE)


def light_probe(value: LightProbe) -> list[Figure]:
    """The probe in latitude and longitude."""
    shown, white = exposed_probe(value)
    rows, columns = value.rgb.shape[:2]
    return [
        Figure(
            "light probe",
            Markup('<img alt="all directions" src="{}">').format(webp_uri(reduced(shown, most=PICTURE_PIXELS))),
            f"{value.caption}{'. ' if value.caption else ''}{columns} × {rows} pixels, straight up on top, straight "
            f"behind the viewer in the middle, as seen from the sheet. White is {white:.3g}, the brightest "
            f"value {float(value.rgb.max()):.3g}.",
            wide=True,
        )
    ]
