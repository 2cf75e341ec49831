"""Photographs whose polariser stood elsewhere than was written down."""

from __future__ import annotations

import dataclasses

import numpy as np

from pipeline.data.photographs import PolarizerSequence
from pipeline.limits import refuse, zero_or_more


def misread_polarizer(
    photos: PolarizerSequence, *, scatter_deg: float = 0.0, stretch: float = 1.0, seed: int = 0
) -> PolarizerSequence:
    """Falsify the stated angles, as a worn scale or a hand does; the photographs stay.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs.
    scatter_deg : float
        Standard deviation of what is added to each angle.
    stretch : float
        Factor on all angles: a step that is taken for another.
    seed : int
        Of the scatter.

    Raises
    ------
    InputError
        The scatter or the seed is negative.
    """
    _check_misread_polarizer(scatter_deg=scatter_deg, seed=seed)
    scatter = np.random.default_rng(seed).normal(0.0, np.deg2rad(scatter_deg), len(photos.polarizer_rad))
    return dataclasses.replace(photos, polarizer_rad=photos.polarizer_rad * stretch + scatter)


def _check_misread_polarizer(*, scatter_deg: float, seed: int, **_: object) -> None:
    """Refuse a negative scatter or seed before anything runs."""
    refuse(zero_or_more(scatter_deg=scatter_deg, seed=seed))
