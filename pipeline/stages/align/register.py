"""Photographs of a polariser sequence brought onto the first."""

from __future__ import annotations

import dataclasses
import logging
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.data.arrays import BoolArray
from pipeline.data.photographs import SIMULTANEOUS, PolarizerSequence
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.coarse_registration import coarse_motion
from pipeline.optics.intensity_registration import ecc_motion, gradient_image, phase_correlation_motion
from pipeline.optics.registration import DRIFTING_PX, Motions
from pipeline.optics.registration_evidence import Agreement, judged
from pipeline.optics.rigid import RigidMotion, corner_px
from pipeline.optics.rigid_sampling import resampled, sample_rigid
from pipeline.optics.spline import quintic_coefficients
from pipeline.parallel import over_rows
from pipeline.progress import advance
from pipeline.stages.align._edge_motions import edge_motions, edges_of, strangers

_log = logging.getLogger(__name__)

Float32Array = NDArray[np.float32]
_UNSETTLED_PX = 0.02
"""Motions that still change by so much are not worth a resampling."""

_SEARCHED = 1.5
"""Turns are looked for up to so many times the largest one, so that those beyond it are seen to be."""

Method = Literal["edges", "ecc", "ecc_edges", "phase_correlation", "none"]

# A step of 14 bits in a simulated photograph, and what interpolation adds to it.
_tolerance_register = {"images": 1e-4}


def register(
    photos: PolarizerSequence,
    *,
    method: Literal["edges", "ecc", "ecc_edges", "phase_correlation", "none"] = "edges",
    motion: Literal["auto", "shift", "rigid"] = "auto",
    largest_shift_px: float = 40.0,
    largest_turn_deg: float = 5.0,
    least_shift_px: float = 0.05,
) -> PolarizerSequence:
    """Move and turn every photograph onto the first, by fractions of a pixel.

    Photographs of a sequence change contrast with the polariser, and two that are 90 degrees apart can be each
    other's negatives; what stays is where the edges are. ``edges`` finds to a pixel how far each photograph's edges, as
    sharp as they are and whatever their sign, have to be turned and shifted to lie on the first one's. Then it models
    small patches around edges as one pattern each, whose contrast is free in each photograph, sign included, and finds
    the motions that all patches agree on. The others are OpenCV's: ``ecc`` and ``phase_correlation`` on intensities,
    ``ecc_edges`` on gradient magnitudes.

    ``motion="auto"`` models turns only where some photograph's turn moves the picture's corners by more than
    ``least_shift_px`` and by more than four times what noise and drifting edges leave open, and where the edges then
    fit better than with shifts alone; a scene that does not tell turns (a spiral in a round outline) gets shifts.
    OpenCV's methods state no standard deviation, so with them ``auto`` is ``shift``. Which it was, and why, is said.

    Photographs stay where they are, with a warning, where there are too few edges, where these agree with the first
    one's no better than those of unrelated photographs would, or as well many pixels away (fringes or stripes without
    an end), or where two ways of finding a motion differ by three pixels. The others are registered without them.

    A shift or a turn counts where it exceeds ``least_shift_px`` (a turn at the corners) and three times its own
    standard deviation; a photograph without either is left exactly as it was: resampling costs sharpness and would gain
    nothing. Others are resampled once, by a quintic spline, and pixels whose content came from outside the photograph
    or from invalid neighbours become invalid. What was found is reported with its standard deviation, which covers
    noise and what parts of the picture disagree on.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs.
    method : {"edges", "ecc", "ecc_edges", "phase_correlation", "none"}
        How the motions are found.
    motion : {"auto", "shift", "rigid"}
        Whether photographs may have turned.
    largest_shift_px, largest_turn_deg : float
        A larger shift or turn is not believed: the photograph is left as it was, with a warning.
    least_shift_px : float
        A smaller shift is not corrected.

    Returns
    -------
    PolarizerSequence
        The same photographs in the frame of the first.

    Raises
    ------
    InputError
        A limit is negative, or one of the largest zero.
    """
    _check_register(largest_shift_px=largest_shift_px, largest_turn_deg=largest_turn_deg, least_shift_px=least_shift_px)
    if method == "none" or len(photos.images) < 2:
        return photos
    if photos.metadata.get(SIMULTANEOUS) == "yes":
        _log.info("All photographs come from one exposure: none can have moved.")
        return photos
    images = np.stack([_finite(image) for image in photos.images])
    searched_rad = _SEARCHED * np.deg2rad(largest_turn_deg)
    if method == "edges":
        motions, doubts = edge_motions(
            images,
            photos.valid,
            motion,
            largest_px=largest_shift_px,
            largest_rad=searched_rad,
            least_px=least_shift_px,
        )
    else:
        motions, doubts = _by_opencv(
            method, images, photos.valid, motion == "rigid", largest_px=largest_shift_px, largest_rad=searched_rad
        )
    moved = _believed(motions, doubts, photos, largest_shift_px, largest_turn_deg, least_shift_px)
    return _resampled(photos, images, motions, moved)


def _check_register(*, largest_shift_px: float, largest_turn_deg: float, least_shift_px: float, **_: object) -> None:
    """Refuse impossible motions before anything runs."""
    refuse(
        above_zero(largest_shift_px=largest_shift_px, largest_turn_deg=largest_turn_deg),
        zero_or_more(least_shift_px=least_shift_px),
    )


def _finite(image: Float32Array) -> Float32Array:
    """The photograph with non-finite pixels filled from the nearest finite one."""
    missing = ~np.isfinite(image)
    if not missing.any() or missing.all():
        return np.nan_to_num(image)
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(image[tuple(nearest)], np.float32)


def _by_opencv(
    method: Method, images: Float32Array, valid: BoolArray, rigid: bool, *, largest_px: float, largest_rad: float
) -> tuple[Motions, dict[int, str]]:
    """Each photograph against the first, and which show something else.

    OpenCV states no standard deviation, so it is given as 0.
    """
    count = len(images)
    edges, agreed = edges_of(images), [Agreement()] * count
    if method == "ecc_edges":
        images = np.stack([gradient_image(image) for image in images])
    shift, turn = np.zeros((count, 2)), np.zeros(count)
    for k in range(1, count):
        try:
            if method == "phase_correlation":
                shift[k], turn[k] = phase_correlation_motion(images[0], images[k], rigid=rigid)
            else:
                start = RigidMotion()
                if method == "ecc_edges":
                    start = coarse_motion(edges[0][-1], edges[k][-1], largest_px=largest_px).motion
                shift[k], turn[k] = ecc_motion(images[0], images[k], valid, start.shift_px, rigid=rigid)
        except cv2.error as error:
            _log.warning("Photo %d was left where it was: OpenCV found no motion (%s).", k, error.err)
        advance(k, count - 1)

    def judge(start: int, stop: int) -> None:
        for k in range(max(start, 1), stop):
            agreed[k] = judged(edges[0], edges[k], largest_px=largest_px, largest_rad=largest_rad, turn_rad=turn[k])

    over_rows(judge, count, tile=1)
    return Motions(shift, turn, np.zeros((count, 3, 3))), strangers(agreed, largest_px)


def _believed(
    motions: Motions,
    doubts: dict[int, str],
    photos: PolarizerSequence,
    largest_px: float,
    largest_turn_deg: float,
    least_px: float,
) -> BoolArray:
    """Which photographs are moved; says what was found and why the others stay."""
    length, deviation = np.hypot(*motions.shift_px.T), motions.deviation_px
    lever = max(corner_px(photos.valid.shape), 1.0)
    turn_px, turn_deviation_px = np.abs(motions.turn_rad) * lever, motions.deviation_rad * lever
    reasons: dict[int, str] = {}
    for k in range(1, len(length)):
        if k in doubts:
            reasons[k] = doubts[k]
        elif not np.isfinite([deviation[k], turn_deviation_px[k], length[k], turn_px[k]]).all():
            reasons[k] = "too few edges to tell its motion"
        elif motions.drift_px > DRIFTING_PX:
            reasons[k] = f"the edges drift by {motions.drift_px:.2f} px, as no motion of photographs makes them"
        elif motions.last_step_px > _UNSETTLED_PX:
            reasons[k] = "the edges do not settle on a motion"
        elif length[k] > largest_px:
            reasons[k] = f"a shift of {length[k]:.1f} px is not believed"
        elif abs(motions.turn_rad[k]) > np.deg2rad(largest_turn_deg):
            reasons[k] = f"a turn of {np.rad2deg(motions.turn_rad[k]):.2f} degrees is not believed"
    for k, reason in reasons.items():
        _log.warning("Photo %d (%g deg) was left where it was: %s.", k, np.rad2deg(photos.polarizer_rad[k]), reason)
    moved = (length > np.maximum(least_px, 3 * deviation)) | (turn_px > np.maximum(least_px, 3 * turn_deviation_px))
    moved[[0, *reasons]] = False
    _log.info(
        "Shifts found, right and down in pixels: %s%s. Moved: %s; the rest lie within %g px or three deviations.",
        ", ".join(f"({column:+.3f}, {row:+.3f})" for row, column in motions.shift_px),
        _turns_in_words(motions),
        ", ".join(str(k) for k in np.flatnonzero(moved)) or "none",
        least_px,
    )
    return np.asarray(moved)


def _turns_in_words(motions: Motions) -> str:
    shifts = f"; standard deviations up to {_largest(motions.deviation_px):.4f}"
    if not motions.turn_rad.any():
        return shifts
    degrees = ", ".join(f"{turn:+.4f}" for turn in np.rad2deg(motions.turn_rad))
    return (
        f"{shifts}. Turns, anticlockwise in degrees: {degrees}; up to {np.rad2deg(_largest(motions.deviation_rad)):.4f}"
    )


def _largest(deviation: NDArray[np.float64]) -> float:
    """Of the photographs whose motion can be told."""
    return float(np.max(deviation, where=np.isfinite(deviation), initial=0.0))


def _resampled(
    photos: PolarizerSequence, finite: Float32Array, motions: Motions, moved: BoolArray
) -> PolarizerSequence:
    if not moved.any():
        return photos
    images = np.empty(photos.images.shape, np.float32)
    clear = np.empty(photos.images.shape, np.bool_)
    near_valid = cv2.erode(photos.valid.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)

    def resample(start: int, stop: int) -> None:
        for k in range(start, stop):
            if moved[k]:
                motion = motions.of(k)
                images[k] = sample_rigid(quintic_coefficients(finite[k]), motion)
                clear[k] = resampled(near_valid, motion, near_valid.shape, order=0, outside=0.0) > 0
            else:
                images[k], clear[k] = photos.images[k], photos.valid

    over_rows(resample, len(images), tile=1)
    return dataclasses.replace(photos, images=images, valid=np.logical_and.reduce(clear, axis=0))
