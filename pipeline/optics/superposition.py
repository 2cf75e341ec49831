"""Two orientation maps of one product laid on each other, although gratings are turned and their angles have no zero.

An item that lies turned by an angle has its orientations turned by the same angle, and a map from polarisation has an
offset of its own. As the vector ``w = I exp(2 i theta)`` of a map both are one phase, common to all pixels: the modulus
of the correlation of two such vectors does not see it. ``I`` itself brings outlines and brightness.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import fft, ndimage

from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled

Float64Array = NDArray[np.float64]
Channels = NDArray[np.float32]

_COARSE_PX = 160
_MOST_SAMPLES = 60_000
_LEVELS = (8, 4, 2, 1)
_ITERATIONS = 30
_STILL_PX = 5e-4
_TIE = 0.01


@dataclass(frozen=True)
class Superposition:
    """How one map lies in another.

    Attributes
    ----------
    motion : RigidMotion
        Where the reference's pixels lie in the other map.
    deviation_px : float
        Standard deviation of a place at the edge of the map, from the scatter of the residuals.
    agreement : float
        Correlation of the two maps' vectors, 0 to 1, where both are known.
    """

    motion: RigidMotion
    deviation_px: float
    agreement: float


def channels_of(intensity: NDArray[np.floating], orientation_rad: NDArray[np.floating]) -> Channels:
    """``I`` and both parts of ``I exp(2 i theta)``, shape (3, M, N), the brightest 1; the latter 0 where not known."""
    bright = np.nan_to_num(np.asarray(intensity, np.float32))
    top = np.percentile(bright, 99) or 1.0
    bright = np.clip(bright / np.float32(top), 0, 2)
    known = np.isfinite(orientation_rad)
    doubled = 2 * np.where(known, orientation_rad, 0)
    return np.stack([bright, bright * known * np.cos(doubled), bright * known * np.sin(doubled)]).astype(np.float32)


def superpose(reference: Channels, other: Channels, *, scale: float, largest_turn_rad: float) -> Superposition:
    """Find how ``other`` lies against ``reference``: every turn on a coarse copy first, then Gauss-Newton.

    Pixels whose residual is larger than most (defects) lose weight by Cauchy's law.

    Parameters
    ----------
    reference, other : ndarray of shape (3, M, N) and (3, P, Q), float32
        From :func:`channels_of`.
    scale : float
        Pixels of ``other`` in one of ``reference``.
    largest_turn_rad : float
        Turns beyond are not looked for; of turns that fit equally well the smallest is taken.
    """
    motion = _searched(reference, other, scale, largest_turn_rad)
    deviation = np.inf
    for factor in _LEVELS:
        small = min(*reference.shape[1:], *other.shape[1:]) // factor
        if small < 24 and factor > 1:
            continue
        one, two = _shrunk(reference, factor), _shrunk(other, factor)
        start = RigidMotion(motion.turn_rad, (motion.shift_px[0] / factor, motion.shift_px[1] / factor), scale)
        found, deviation = _refined(one, two, start)
        motion = RigidMotion(found.turn_rad, (found.shift_px[0] * factor, found.shift_px[1] * factor), scale)
    return Superposition(motion, deviation, _agreement(reference, other, motion))


def _shrunk(channels: Channels, factor: int) -> Channels:
    if factor == 1:
        return channels
    rows, columns = (n // factor for n in channels.shape[1:])
    trim = [(n - factor * m) // 2 for n, m in zip(channels.shape[1:], (rows, columns), strict=True)]
    inner = channels[:, trim[0] : trim[0] + factor * rows, trim[1] : trim[1] + factor * columns]
    return np.stack([cv2.resize(c, (columns, rows), interpolation=cv2.INTER_AREA) for c in inner])


def _searched(reference: Channels, other: Channels, scale: float, largest_turn_rad: float) -> RigidMotion:
    """The best of all turns in steps of a degree, with its shift to a coarse pixel."""
    longest = max(*reference.shape[1:], *(n / scale for n in other.shape[1:]))
    factor = max(1, int(np.ceil(longest / _COARSE_PX)))
    one, two = _shrunk(reference, factor), _shrunk(other, factor)
    shape = one.shape[1:]
    size = [fft.next_fast_len(2 * n) for n in shape]
    spectrum, spectrum_w = fft.fft2(one[0], size), fft.fft2(one[1] + 1j * one[2], size)
    turns = np.deg2rad(np.arange(np.floor(np.rad2deg(largest_turn_rad)) + 1))
    best, found = -np.inf, RigidMotion(scale=scale)
    for turn in sorted({*turns, *-turns}, key=abs):
        motion = RigidMotion(float(turn), (0.0, 0.0), scale)
        back = [resampled(c, motion, shape, order=1, outside=0.0) for c in two]
        bright = fft.ifft2(np.conj(spectrum) * fft.fft2(back[0], size)).real
        vector = np.abs(fft.ifft2(np.conj(spectrum_w) * fft.fft2(back[1] + 1j * back[2], size)))
        score = bright + vector
        peak = np.unravel_index(np.argmax(score), score.shape)
        if score[peak] > best * (1 + _TIE * bool(abs(turn) > abs(found.turn_rad) + np.deg2rad(5))):
            best = float(score[peak])
            whole = np.array([p - n if p > n / 2 else p for p, n in zip(peak, size, strict=True)], np.float64)
            # What lies at p in the reference lies at p + whole in the picture turned back.
            found = motion.after(0.0, whole)
    return RigidMotion(found.turn_rad, (found.shift_px[0] * factor, found.shift_px[1] * factor), scale)


def _refined(reference: Channels, other: Channels, motion: RigidMotion) -> tuple[RigidMotion, float]:
    """Gauss-Newton on the pixels of the strongest gradients; the motion, and the deviation at the edge in pixels."""
    shape = reference.shape[1:]
    smooth = np.stack([ndimage.gaussian_filter(c, 1.0) for c in reference])
    slopes = np.stack([np.stack(np.gradient(c)) for c in smooth])
    strength = np.sum(slopes**2, axis=(0, 1))
    strength[[0, 1, -1, -2]] = strength[:, [0, 1, -1, -2]] = 0
    chosen = np.argsort(strength, axis=None)[::-1][:_MOST_SAMPLES]
    chosen = chosen[strength.ravel()[chosen] > 0]
    place = np.stack(np.unravel_index(chosen, shape)).astype(np.float64)
    values = smooth.reshape(3, -1)[:, chosen].astype(np.float64)
    slope = slopes.reshape(3, 2, -1)[:, :, chosen].astype(np.float64)
    down, right = place - (np.array(shape)[:, None] - 1) / 2
    turning = slope[:, 0] * -right + slope[:, 1] * down
    jacobian = np.concatenate([slope, turning[:, None]], axis=1)  # (3 channels, 3 unknowns, P)
    radius = float(np.hypot(*shape)) / 2
    read = np.stack([ndimage.spline_filter(ndimage.gaussian_filter(c, motion.scale), order=3) for c in other])
    weight = np.ones(len(chosen))
    deviation = np.inf
    for _ in range(_ITERATIONS):
        there = motion.apply(place, shape, other.shape[1:])
        limits = np.array(other.shape[1:])[:, None] - 1
        inside = np.all((there >= 0) & (there <= limits), axis=0)
        moved = np.stack([ndimage.map_coordinates(c, there, order=3, prefilter=False, mode="nearest") for c in read])
        residual = _residual(values, moved, weight * inside)
        size = np.sum(residual**2, axis=0)
        typical = np.median(size[inside]) if inside.any() else 0.0
        weight = inside / (1 + size / (4 * typical + 1e-12))
        normal = np.einsum("cup,cvp,p->uv", jacobian, jacobian, weight)
        pull = np.einsum("cup,cp->up", jacobian, residual) * weight
        # A round thing of tangential gratings looks the same however it is turned: the least step that explains it.
        inverse = np.linalg.pinv(normal, rcond=1e-10, hermitian=True)
        step = inverse @ pull.sum(axis=1)
        spread = inverse @ (pull @ pull.T) @ inverse
        deviation = float(np.sqrt(spread[0, 0] + spread[1, 1] + radius**2 * spread[2, 2]))
        back = RigidMotion(-step[2]).matrix
        motion = motion.after(-step[2], -back @ step[:2])
        if max(np.hypot(*step[:2]), radius * abs(step[2])) < _STILL_PX:
            break
    return motion, deviation


def _residual(values: Float64Array, moved: Float64Array, weight: Float64Array) -> Float64Array:
    """What is left of the moved channels after their own brightness and phase are taken away, shape (3, P)."""
    gain = np.sum(weight * values[0] * moved[0]) / max(np.sum(weight * values[0] ** 2), 1e-12)
    vector, there = values[1] + 1j * values[2], moved[1] + 1j * moved[2]
    phase = np.exp(-1j * np.angle(np.sum(weight * np.conj(vector) * there)))
    left = there * phase / max(gain, 1e-6) - vector
    return np.stack([moved[0] / max(gain, 1e-6) - values[0], left.real, left.imag])


def _agreement(reference: Channels, other: Channels, motion: RigidMotion) -> float:
    there = np.stack([resampled(c, motion, reference.shape[1:], order=1, outside=0.0) for c in other[1:]])
    one, two = reference[1] + 1j * reference[2], there[0] + 1j * there[1]
    total = np.sqrt(np.sum(np.abs(one) ** 2) * np.sum(np.abs(two) ** 2))
    return float(np.abs(np.vdot(one, two)) / total) if total > 0 else 0.0
