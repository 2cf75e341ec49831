"""Flash photographs whose flash and camera stood at other distances than were written down."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.data.flash import FlashPhotographs
from pipeline.errors import InputError
from pipeline.limits import refuse


def misread_distances(
    photos: FlashPhotographs, *, light_percent: float = 0.0, camera_percent: float = 0.0
) -> FlashPhotographs:
    """Falsify the stated distances of flash and camera from the sheet; x, y and the photographs stay.

    Parameters
    ----------
    photos : FlashPhotographs
        Whose places are known.
    light_percent, camera_percent : float
        By how much what is written down exceeds the true distance.

    Raises
    ------
    InputError
        A distance would not be above 0.
    """
    _check_misread_distances(light_percent=light_percent, camera_percent=camera_percent)
    light, camera = photos.light_mm.astype(np.float64), photos.camera_mm.astype(np.float64)
    light[:, 2] *= 1 + light_percent / 100
    camera[2] *= 1 + camera_percent / 100
    return dataclasses.replace(photos, light_mm=light, camera_mm=camera)


def _check_misread_distances(*, light_percent: float, camera_percent: float, **_: object) -> None:
    """Refuse places behind the sheet before anything runs."""
    stated = {"light_percent": light_percent, "camera_percent": camera_percent}
    refuse(
        [
            InputError(f"{name} is {value:g}", where=name, expected="more than -100")
            for name, value in stated.items()
            if not value > -100
        ]
    )
