"""Photographs of a polariser sequence brought onto the first."""

from __future__ import annotations

import dataclasses
import logging
from collections.abc import Callable
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.data import SIMULTANEOUS, BoolArray, PolarizerSequence
from pipeline.limits import above_zero, refuse, zero_or_more
from pipeline.optics.registration import Shifts, coarse_shift, edge_image, edge_shifts
from pipeline.optics.translation import quintic_coefficients, sample_translated
from pipeline.parallel import over_rows
from pipeline.progress import advance

_log = logging.getLogger(__name__)

Float32Array = NDArray[np.float32]

# A step of 14 bits in a simulated photograph, and what interpolation adds to it.
_tolerance_register = {"images": 1e-4}


def register(
    photos: PolarizerSequence,
    *,
    method: Literal["edges", "ecc", "phase_correlation", "none"] = "edges",
    largest_shift_px: float = 40.0,
    least_shift_px: float = 0.05,
) -> PolarizerSequence:
    """Move every photograph onto the first by a fraction of a pixel.

    Photographs of a sequence change contrast with the polariser, and two that are 90 degrees apart can be each
    other's negatives; what stays is where the edges are. ``edges`` models every small patch as one pattern whose
    contrast is free, sign included, in each photograph, and finds the shifts that all patches agree on: first by phase
    correlation of edge images, then by Gauss-Newton. ``ecc`` and ``phase_correlation`` are OpenCV's, on intensities.

    A photograph is left exactly as it was where its shift is below ``least_shift_px`` or three times its own standard
    deviation: resampling costs sharpness and would gain nothing. Others are resampled by a quintic spline, and pixels
    whose content came from outside the photograph or from invalid neighbours become invalid. The shifts found are
    reported.

    Parameters
    ----------
    photos : PolarizerSequence
        K photographs.
    method : {"edges", "ecc", "phase_correlation", "none"}
        How the shifts are found.
    largest_shift_px : float
        A larger shift is not believed: the photograph is left as it was, with a warning.
    least_shift_px : float
        A smaller shift is not corrected.

    Returns
    -------
    PolarizerSequence
        The same photographs in the frame of the first.

    Raises
    ------
    InputError
        A shift is negative, or ``largest_shift_px`` zero.
    """
    _check_register(largest_shift_px=largest_shift_px, least_shift_px=least_shift_px)
    if method == "none" or len(photos.images) < 2:
        return photos
    if photos.metadata.get(SIMULTANEOUS) == "yes":
        _log.info("All photographs come from one exposure: none can have moved.")
        return photos
    images = [_finite(image) for image in photos.images]
    coefficients = np.empty(photos.images.shape, np.float32)

    def prefilter(start: int, stop: int) -> None:
        for k in range(start, stop):
            coefficients[k] = quintic_coefficients(images[k])

    over_rows(prefilter, len(images), tile=1)
    shifts = _estimate(method, images, coefficients, photos.valid, largest_shift_px)
    moved = _believed(shifts, photos, largest_shift_px, least_shift_px)
    return _resampled(photos, coefficients, shifts.shift_px, moved)


def _check_register(*, largest_shift_px: float, least_shift_px: float, **_: object) -> None:
    """Refuse impossible shifts before anything runs."""
    refuse(above_zero(largest_shift_px=largest_shift_px), zero_or_more(least_shift_px=least_shift_px))


def _finite(image: Float32Array) -> Float32Array:
    """The photograph with non-finite pixels filled from the nearest finite one."""
    missing = ~np.isfinite(image)
    if not missing.any() or missing.all():
        return np.nan_to_num(image)
    nearest = ndimage.distance_transform_edt(missing, return_distances=False, return_indices=True)
    return np.asarray(image[tuple(nearest)], np.float32)


def _estimate(
    method: str, images: list[Float32Array], coefficients: Float32Array, valid: BoolArray, largest_px: float
) -> Shifts:
    count = len(images)
    if method == "edges":
        edges: list[Float32Array] = [np.zeros(0, np.float32)] * count
        start = np.zeros((count, 2))

        def find_edges(first: int, last: int) -> None:
            for k in range(first, last):
                edges[k] = edge_image(images[k])

        def find_start(first: int, last: int) -> None:
            for k in range(first, last):
                start[k] = coarse_shift(edges[0], edges[k], largest_px) if k else 0.0

        over_rows(find_edges, count, tile=1)
        over_rows(find_start, count, tile=1)
        return edge_shifts(coefficients, start, valid)
    find: Callable[[Float32Array, Float32Array, BoolArray], tuple[float, float]] = (
        _ecc if method == "ecc" else _phase_correlation
    )
    shift = np.zeros((count, 2))
    for k in range(1, count):
        try:
            shift[k] = find(images[0], images[k], valid)
        except cv2.error as error:
            _log.warning("Photo %d was left where it was: OpenCV found no shift (%s).", k, error.err)
        advance(k, count - 1)
    return Shifts(shift, np.zeros(count))


def _ecc(reference: Float32Array, image: Float32Array, valid: BoolArray) -> tuple[float, float]:
    warp = np.eye(2, 3, dtype=np.float32)
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-6)
    mask = valid.astype(np.uint8)
    _, warp = cv2.findTransformECC(reference, image, warp, cv2.MOTION_TRANSLATION, criteria, mask, 5)
    return float(warp[1, 2]), float(warp[0, 2])


def _phase_correlation(reference: Float32Array, image: Float32Array, valid: BoolArray) -> tuple[float, float]:
    window = cv2.createHanningWindow(reference.shape[::-1], cv2.CV_32F)
    # OpenCV 5.0 multiplies its arguments by the window in place, so it gets copies.
    (column, row), _ = cv2.phaseCorrelate(reference.copy(), image.copy(), window)
    return float(row), float(column)


def _believed(shifts: Shifts, photos: PolarizerSequence, largest_px: float, least_px: float) -> BoolArray:
    """Which photographs are moved; says what was found and why the others stay."""
    length = np.hypot(*shifts.shift_px.T)
    unknown = ~np.isfinite(shifts.deviation_px) | ~np.isfinite(length)
    too_far = ~unknown & (length > largest_px)
    still = length < np.maximum(least_px, 3 * shifts.deviation_px)
    unknown[0] = too_far[0] = False
    for k in np.flatnonzero(unknown | too_far):
        reason = "too few edges to tell its shift" if unknown[k] else f"a shift of {length[k]:.1f} px is not believed"
        _log.warning("Photo %d (%g deg) was left where it was: %s.", k, np.rad2deg(photos.polarizer_rad[k]), reason)
    moved = ~(unknown | too_far | still)
    moved[0] = False
    _log.info(
        "Shifts found, right and down in pixels: %s. Moved: %s; the rest lie within %g px or three deviations.",
        ", ".join(f"({column:+.3f}, {row:+.3f})" for row, column in shifts.shift_px),
        ", ".join(str(k) for k in np.flatnonzero(moved)) or "none",
        least_px,
    )
    return np.asarray(moved)


def _resampled(
    photos: PolarizerSequence, coefficients: Float32Array, shift_px: NDArray[np.float64], moved: BoolArray
) -> PolarizerSequence:
    if not moved.any():
        return photos
    images = np.empty(photos.images.shape, np.float32)
    clear = np.empty(photos.images.shape, np.bool_)
    near_valid = cv2.erode(photos.valid.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1)

    def resample(start: int, stop: int) -> None:
        for k in range(start, stop):
            row, column = shift_px[k]
            if moved[k]:
                images[k] = sample_translated(coefficients[k], (row, column))
                clear[k] = ndimage.shift(near_valid, (-round(row), -round(column)), order=0, cval=0).astype(bool)
                clear[k] &= _inside(clear[k].shape, row, column)
            else:
                images[k] = photos.images[k]
                clear[k] = photos.valid

    over_rows(resample, len(images), tile=1)
    return dataclasses.replace(photos, images=images, valid=np.logical_and.reduce(clear, axis=0))


def _inside(shape: tuple[int, ...], row: float, column: float) -> BoolArray:
    """Pixels whose content lies within the photograph after the shift."""
    rows = np.arange(shape[0]) + row
    columns = np.arange(shape[1]) + column
    down = (rows >= 0) & (rows <= shape[0] - 1)
    across = (columns >= 0) & (columns <= shape[1] - 1)
    return down[:, None] & across[None, :]
