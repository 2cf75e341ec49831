"""An item laid on a reference item of the same product, pixel by pixel: what is gone, what is new, what differs."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.angles import axial_difference, axial_median, wrap_axial
from pipeline.optics.deviation import Deviation, calibrated, deviation
from pipeline.optics.regions import eroded, grown, joined
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled

Float32Array = NDArray[np.float32]
BoolArray = NDArray[np.bool_]

_LEAST_ERROR_PX = 0.1
_EDGE_DEG_PX = 3.0
_EDGE_BRIGHTNESS_PX = 0.03
_NOISE_WINDOW_PX = 9
_LEAST_NOISE = 0.2
_MOST_NOISE = 4.0
_RIM_PX = 2.0
_CLEAR = 8.0
_DARK = 1e-6


@dataclass(frozen=True)
class Gratings:
    """What was measured of one item, each of shape (M, N).

    Attributes
    ----------
    orientation_rad, correlation, intensity : ndarray of float
        As in an orientation map; the correlation may be NaN everywhere.
    mask : ndarray of bool
        Pixels that diffract.
    log_period : ndarray of float
        Logarithm of the period, up to a constant.
    """

    orientation_rad: NDArray[np.floating]
    correlation: NDArray[np.floating]
    intensity: NDArray[np.floating]
    mask: BoolArray
    log_period: NDArray[np.floating]

    @property
    def known(self) -> BoolArray:
        """Pixels that diffract and of which the orientation is known."""
        return np.asarray(self.mask & np.isfinite(self.orientation_rad))

    @property
    def vector(self) -> NDArray[np.complex64]:
        """``exp(2 i theta)``, outside the mask that of the nearest pixel inside."""
        return np.exp(2j * filled(self.orientation_rad, self.known)).astype(np.complex64)

    @property
    def noise(self) -> Float32Array:
        """Noise of the orientation at every pixel, up to one factor.

        Of what varies in a pixel over the photographs the cosine explains the share ``correlation ** 2``; the rest is
        noise. Their ratio, taken over the neighbourhood, is the variance of the phase. Without a correlation the noise
        goes as photons are counted.
        """
        explained = np.square(self.correlation, dtype=np.float32)
        known = self.known & np.isfinite(explained)
        if not known.any():
            return np.asarray(1 / np.sqrt(np.maximum(np.nan_to_num(self.intensity), _DARK)), np.float32)
        signal, rest = (
            cv2.blur(
                np.where(known, share, 0).astype(np.float32), (_NOISE_WINDOW_PX,) * 2, borderType=cv2.BORDER_CONSTANT
            )
            for share in (explained, 1 - explained)
        )
        return filled(np.sqrt(np.maximum(rest, 0) / np.maximum(signal, _DARK)), known)


@dataclass(frozen=True)
class GratingPair:
    """The reference, the item laid on it, and how they differ; all maps of shape (M, N), on the reference's pixels.

    Attributes
    ----------
    expected, present : ndarray of bool
        Where the reference diffracts, and where the item does.
    lost : ndarray of bool
        Gratings that the item lacks, up to their outline.
    surely_lost : ndarray of bool
        Those so far inside the reference's outline that no misplacement explains them.
    added : ndarray of bool
        Gratings that the item has too many, so far outside.
    edges : ndarray of bool
        Where the reference jumps.
    judged : ndarray of bool
        Where gratings are compared.
    turn_rad, log_ratio : ndarray of float32
        Orientation of the item beyond the reference's, and logarithm of the ratio of its period to the reference's,
        also where they are not judged.
    turn, ratio, brightness : Deviation
        Of these two where they are judged, and of half the logarithm of the intensity wherever there are gratings.
    unmodulated : ndarray of bool
        Where the polariser hardly changes the item any more, though it does the reference.
    offset_rad : float
        What was taken from all orientations, in [-pi/2, pi/2).
    item : Gratings
        The item on the reference, turned back and without the offset.
    reach_px : float
        So wide are strips that are not judged, at outlines and edges.
    """

    expected: BoolArray
    present: BoolArray
    lost: BoolArray
    surely_lost: BoolArray
    added: BoolArray
    edges: BoolArray
    judged: BoolArray
    turn_rad: Float32Array
    log_ratio: Float32Array
    turn: Deviation
    ratio: Deviation
    brightness: Deviation
    unmodulated: BoolArray
    offset_rad: float
    item: Gratings
    reach_px: float

    def completed(self, area: BoolArray, difference: Float32Array, noise: Float32Array) -> BoolArray:
        """Regions with the pixels beside them that are not judged, where these differ in the same way.

        Only of regions that stand clear of the noise of single pixels.
        """
        whole = area.copy()
        nearby = self.expected & self.present & ~self.judged
        labels, count = joined(area)
        for label, window in enumerate(ndimage.find_objects(labels, count), 1):
            wide = widened(window, int(self.reach_px) + 1)
            inside = labels[wide] == label
            height = float(np.median(difference[wide][inside]))
            if abs(height) < _CLEAR * float(np.median(noise[wide][inside])):
                continue
            alike = difference[wide] * np.sign(height) > abs(height) / 2
            whole[wide] |= grown(inside, self.reach_px) & nearby[wide] & alike
        return whole


def compared(
    reference: Gratings,
    item: Gratings,
    motion: RigidMotion,
    *,
    deviation_px: float = 0.0,
    border_px: float = 2.0,
    least_pixels: int = 1,
    relative: bool = True,
) -> GratingPair:
    """Lay an item on the reference and take the differences, with their noise.

    Parameters
    ----------
    reference, item : Gratings
        Of shape (M, N) and (P, Q).
    motion : RigidMotion
        Where the reference's pixels lie in the item's picture.
    deviation_px : float
        Standard deviation of that.
    border_px : float
        Width of the strip along outlines in which nothing is judged.
    least_pixels : int
        Fewer lost pixels in a group do not keep those around them from being judged.
    relative : bool
        The periods are known up to a factor, which is removed.

    Raises
    ------
    ValueError
        No pixel can be judged.
    """
    shape = reference.mask.shape
    moved = _moved(item, motion, shape)
    shown = np.isfinite(moved.intensity)
    expected, present = reference.known, moved.mask
    inner = eroded(expected, border_px) & shown
    lost = expected & shown & ~present
    surely = lost & inner
    lost = _to_half(lost & grown(surely, border_px + 1), reference.intensity, moved.intensity, expected & present)

    vector, brightness = reference.vector, _brightness(reference.intensity)
    slope_turn, slope_brightness = _slope(vector) / 2, _slope(brightness)
    noise = np.hypot(reference.noise, resampled(item.noise, motion, shape, order=1, outside=1.0))
    both = expected & present
    noise = np.maximum(noise, _LEAST_NOISE * np.median(noise[both]) if both.any() else 1.0).astype(np.float32)
    turn = axial_difference(moved.orientation_rad, reference.orientation_rad).astype(np.float32)
    interior = inner & present & np.isfinite(reference.log_period) & np.isfinite(moved.log_period)
    # A slope that noise makes by itself is no edge.
    rough = calibrated(_neighbours(turn), noise[:, 1:], interior[:, 1:] & interior[:, :-1])
    steepest = max(np.deg2rad(_EDGE_DEG_PX), rough * float(np.median(noise[interior])) if interior.any() else 0.0)
    edges = grown((slope_turn > steepest) | (slope_brightness > _EDGE_BRIGHTNESS_PX), 1.0)
    judged = interior & ~edges & ~grown(_large(surely, least_pixels), border_px + 1)
    if not judged.any():
        raise ValueError("no pixel of the two maps can be compared")

    offset = float(axial_difference(axial_median(turn[judged]), 0.0))
    turn = axial_difference(turn, offset).astype(np.float32)
    ratio = (
        _centred(moved.log_period - reference.log_period, judged)
        if relative
        else moved.log_period - reference.log_period
    )
    dimmer = _centred(_brightness(moved.intensity) - brightness, judged)
    error_px = float(np.hypot(_LEAST_ERROR_PX, deviation_px))
    steady = np.minimum(noise, _MOST_NOISE * np.median(noise[judged])).astype(np.float32)
    orientation = wrap_axial(moved.orientation_rad - offset).astype(np.float32)
    orientation[orientation >= np.float32(np.pi)] = 0
    return GratingPair(
        expected=expected,
        present=present,
        lost=lost,
        surely_lost=surely,
        added=present & ~grown(expected, border_px),
        edges=edges,
        judged=judged,
        turn_rad=turn,
        log_ratio=ratio,
        turn=_deviating(turn, noise, error_px * slope_turn, judged),
        ratio=_deviating(ratio, noise, error_px * slope_brightness, judged),
        brightness=_deviating(dimmer, steady, 0.0, (expected | present) & shown, judged),
        unmodulated=np.asarray(moved.correlation < np.nan_to_num(reference.correlation) / 2),
        offset_rad=offset,
        item=Gratings(
            np.where(present, orientation, np.float32(np.nan)),
            np.where(present, moved.correlation, np.float32(np.nan)),
            moved.intensity,
            present,
            moved.log_period,
        ),
        reach_px=border_px + 2,
    )


def filled(values: NDArray[np.floating], known: BoolArray) -> Float32Array:
    """Values outside the known pixels taken from the nearest known one."""
    known = known & np.isfinite(values)
    if known.all() or not known.any():
        return np.asarray(values, np.float32)
    nearest = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(values[tuple(nearest)], np.float32)


def widened(window: tuple[slice, ...], margin: int) -> tuple[slice, ...]:
    """A window with a margin around it."""
    return tuple(slice(max(0, s.start - margin), s.stop + margin) for s in window)


def _moved(item: Gratings, motion: RigidMotion, shape: tuple[int, ...]) -> Gratings:
    """The item on the reference's pixels, its orientations turned back; NaN outside its picture."""
    vector, known = item.vector, item.known
    real, imaginary = resampled(vector.real, motion, shape), resampled(vector.imag, motion, shape)
    return Gratings(
        np.arctan2(imaginary, real) / 2 - np.float32(motion.turn_rad),
        resampled(filled(item.correlation, known), motion, shape, order=1),
        resampled(np.nan_to_num(item.intensity), motion, shape),
        resampled(known.astype(np.float32), motion, shape, order=1, outside=0.0) >= 0.5,
        resampled(filled(item.log_period, known), motion, shape),
    )


def _to_half(
    lost: BoolArray, reference: NDArray[np.floating], item: NDArray[np.floating], intact: BoolArray
) -> BoolArray:
    """Lost gratings up to half way in brightness, which is where their outline is."""
    if not lost.any() or not intact.any():
        return lost
    area = lost.copy()
    level = item / float(np.median(item[intact] / reference[intact]))
    labels, count = joined(lost)
    for label, window in enumerate(ndimage.find_objects(labels, count), 1):
        wide = widened(window, int(_RIM_PX) + 1)
        inside = labels[wide] == label
        half = (reference[wide] + float(np.median(level[wide][inside]))) / 2
        area[wide] |= grown(inside, _RIM_PX) & (level[wide] < half) & (intact[wide] | inside)
    return area


def _large(area: BoolArray, least_pixels: int) -> BoolArray:
    """Connected parts of an area that have so many pixels."""
    labels, count = joined(area)
    size = np.bincount(labels.ravel(), minlength=count + 1)
    return area & (size[labels] >= least_pixels)


def _brightness(intensity: NDArray[np.floating]) -> Float32Array:
    return np.asarray(np.log(np.maximum(intensity, _DARK)) / 2, np.float32)


def _neighbours(values: Float32Array) -> Float32Array:
    """Differences of neighbours in a row, which scatter as the values do where these are constant."""
    return np.asarray(axial_difference(values[:, 1:], values[:, :-1]) / np.sqrt(2), np.float32)


def _slope(values: NDArray[np.generic]) -> Float32Array:
    """Length of the gradient, per pixel, of a map that may be complex."""
    parts = [values.real, values.imag] if np.iscomplexobj(values) else [values]
    smooth = [ndimage.gaussian_filter(np.asarray(part, np.float32), 1.0) for part in parts]
    return np.asarray(np.sqrt(sum(g**2 for part in smooth for g in np.gradient(part))), np.float32)


def _centred(values: NDArray[np.floating], judged: BoolArray) -> Float32Array:
    return np.asarray(values - np.median(values[judged]), np.float32)


def _deviating(
    difference: Float32Array,
    shape: Float32Array,
    error: NDArray[np.floating] | float,
    judged: BoolArray,
    quiet: BoolArray | None = None,
) -> Deviation:
    """The difference against its noise, scaled to the scatter of the quiet pixels, and an error besides."""
    factor = calibrated(difference, shape, judged if quiet is None else quiet)
    noise = np.hypot(factor * shape, error).astype(np.float32)
    return deviation(difference, np.maximum(noise, np.float32(1e-7)), judged)
