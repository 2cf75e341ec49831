"""Flash photographs as a rendering shows the same sheet, to look at both beside each other."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from pipeline.data.flash import FlashPhotographs
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError

_tolerance_flash_pictures = {"rgb": 1e-3}

_FAINT, _WHITE = 0.02, 1.0
"""Between which a rendering's pixels tell the exposure: neither dark nor in the mirror image of the flash."""


def flash_pictures(photos: FlashPhotographs, rendering: PictureSeries) -> PictureSeries:
    """Bring photographs to the size and, by one factor for all, to the exposure of a rendering of them.

    Parameters
    ----------
    photos : FlashPhotographs
        Rectified.
    rendering : PictureSeries
        Rectified, under as many lights.

    Returns
    -------
    PictureSeries
        Of the rendering's shape. The factor makes the squared difference least where the rendering is neither dark nor
        white.

    Raises
    ------
    InputError
        The pictures are not rectified, of other lights, or black.
    """
    if photos.pixel_mm is None or rendering.pixel_mm is None:
        raise InputError("both have to be rectified", expected="align.rectified, and view: rectified")
    if len(photos.radiance) != len(rendering.rgb):
        raise InputError(
            f"{len(rendering.rgb)} pictures are not of the {len(photos.radiance)} lights of the photographs",
            expected="a rendering under the same lights",
        )
    size = rendering.rgb.shape[2], rendering.rgb.shape[1]
    same = size == (photos.valid.shape[2], photos.valid.shape[1])
    rgb = np.stack([one if same else cv2.resize(one, size, interpolation=cv2.INTER_AREA) for one in photos.radiance])
    brightest = rendering.rgb.max(axis=-1)
    told = (brightest > _FAINT) & (brightest < _WHITE)
    seen, made = rgb[told].astype(np.float64), rendering.rgb[told].astype(np.float64)
    if not seen.any():
        raise InputError("the photographs are black where the rendering is lit", expected="pictures of the same sheet")
    factor = np.float32((seen * made).sum() / (seen**2).sum())
    return replace(rendering, rgb=factor * rgb, caption="Photographed")
