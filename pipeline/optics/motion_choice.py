"""How much motion to model: shifts alone, or turns too where the scene shows them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.registration import LEAST_MARGIN_PX, Motions, fine_motions
from pipeline.optics.rigid import corner_px

Float32Array = NDArray[np.float32]

_SIGNIFICANT = 4.0
"""Deviations; three would be exceeded by chance by one of a dozen turns in one run of thirty."""


@dataclass(frozen=True)
class Choice:
    """Motions, and why these.

    Attributes
    ----------
    motions : Motions
        Of all photographs; without turns where none are modelled.
    reason : str
        Why turns are modelled, or why not.
    doubtful : bool
        Whether there seem to be turns that are not modelled.
    """

    motions: Motions
    reason: str
    doubtful: bool = False


def chosen_motions(
    coefficients: Float32Array,
    shifted: Motions,
    turned: Motions,
    valid: NDArray[np.bool_],
    *,
    motion: Literal["auto", "shift", "rigid"],
    least_px: float,
) -> Choice:
    """Motions by the edges of K photographs, with turns where they are asked for, or shown by the scene.

    Parameters
    ----------
    coefficients : ndarray of shape (K, M, N), float32
        From :func:`pipeline.optics.edge_patches.edge_coefficients`.
    shifted, turned : Motions
        Shifts alone, and shifts with turns, to start from, right to about a pixel; one of the two may be wrong.
    valid : ndarray of shape (M, N), bool
        Pixels that can be used.
    motion : {"auto", "shift", "rigid"}
        Auto models turns where one exceeds ``least_px`` at the picture's corners, and four times its deviation joined
        with what edges drift by themselves, and where the photographs fit each other better with turns than without.
    least_px : float
        Displacement of the corners below which turns are not worth a parameter.
    """
    if motion == "shift":
        return Choice(fine_motions(coefficients, shifted, valid, rigid=False), "Only shifts were asked for.")
    begun = _better(coefficients, shifted, turned, valid)
    margin = int(np.ceil(begun.reach_px(valid.shape))) + LEAST_MARGIN_PX
    fine = fine_motions(coefficients, begun, valid, rigid=True, margin=margin)
    if motion == "rigid" and fine.tells_turns:
        return Choice(fine, "Turns were asked for.")
    corner, deviation = np.abs(fine.turn_rad) * corner_px(valid.shape), fine.deviation_rad * corner_px(valid.shape)
    known = np.isfinite(deviation)
    doubt = np.hypot(deviation, fine.turn_drift_px)
    significant = known & (corner > np.maximum(least_px, _SIGNIFICANT * doubt))
    largest = int(np.argmax(np.where(known, corner, 0)))
    found = f"{corner[largest]:.3f} px at the corners, give or take {doubt[largest]:.3f} px"
    if fine.settled and not significant.any():
        shifts = fine_motions(coefficients, fine, valid, rigid=False, margin=margin)
        return Choice(shifts, f"Shifts are enough: the largest turn seems to be {found}.")
    if fine.tells_turns:
        shifts = fine_motions(coefficients, fine, valid, rigid=False, margin=margin, steps=2)
        if fine.misfit < shifts.misfit:
            return Choice(fine, f"Shifts are not enough: the largest turn is {found}.")
    return Choice(
        fine_motions(coefficients, shifted, valid, rigid=False),
        "Turns of the photographs cannot be told from what the polariser changes in this scene; only shifts are "
        "corrected.",
        doubtful=bool(significant.any()),
    )


def _better(coefficients: Float32Array, shifted: Motions, turned: Motions, valid: NDArray[np.bool_]) -> Motions:
    """The start that leaves less unexplained after a few steps: spokes that turn with the polariser lead one astray.

    The same patches judge both, those along the border too: an outline there may be all that stays.
    """
    if not turned.turn_rad.any():
        return shifted
    tried = [
        fine_motions(coefficients, one, valid, rigid=True, steps=2, margin=LEAST_MARGIN_PX) for one in (shifted, turned)
    ]
    return min(tried, key=lambda motions: motions.misfit)
