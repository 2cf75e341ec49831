"""What a lens and a sensor do to an image."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.optics.photons import photon_counts
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.rigid_sampling import resampled, sample_rigid
from pipeline.optics.spline import quintic_coefficients

Image = NDArray[np.float32]

FINEST_PITCH_MM = 0.00038
"""The shortest visible wavelength: no lens in air resolves less."""


def seen_by_lens(
    scene: Image, *, blur_px: float, shift_px: tuple[float, float] = (0.0, 0.0), turn_rad: float = 0.0
) -> Image:
    """Blur a finely sampled scene by a Gaussian lens, turn it about its centre and displace it.

    Parameters
    ----------
    scene : ndarray of shape (M, N) or (M, N, 3)
        Radiance on a grid finer than the blur; a scene that is turned has one channel.
    blur_px : float
        Standard deviation of the point spread function in pixels of the scene.
    shift_px : tuple of float
        Displacement down and to the right, in pixels of the scene.
    turn_rad : float
        Turn before the displacement, anticlockwise in the displayed picture.
    """
    if turn_rad:
        return _turned(scene, blur_px, shift_px, turn_rad)
    down, right = (_displaced_gaussian(blur_px, shift) for shift in shift_px)
    return cv2.sepFilter2D(np.ascontiguousarray(scene), cv2.CV_32F, right, down, borderType=cv2.BORDER_REPLICATE)


def _turned(scene: Image, blur_px: float, shift_px: tuple[float, float], turn_rad: float) -> Image:
    """Blur, which no turn changes, then one interpolation: what is seen at q comes from where the way back leads.

    The quintic spline does nothing to what a lens has blurred by a pixel; on sharp steps it would ring, so there the
    interpolation is linear.
    """
    margin = int(np.ceil(max(map(abs, shift_px)) + 0.5 * np.hypot(*scene.shape) * abs(turn_rad))) + 3
    padded = np.pad(scene, margin, mode="edge")
    blurred = seen_by_lens(padded, blur_px=blur_px)
    back = RigidMotion(turn_rad, shift_px).inverse
    if blur_px >= 1:
        moved = sample_rigid(quintic_coefficients(blurred), back)
    else:
        moved = resampled(blurred, back, blurred.shape, order=1)
    return moved[margin:-margin, margin:-margin]


def _displaced_gaussian(sigma_px: float, shift_px: float) -> NDArray[np.float32]:
    """Taps of a Gaussian centred ``shift_px`` away; of linear interpolation where there is no blur."""
    radius = int(np.ceil(4 * sigma_px + abs(shift_px))) + 1
    distance = radius - np.arange(2 * radius + 1) - shift_px
    taps = np.exp(-0.5 * (distance / sigma_px) ** 2) if sigma_px > 0 else np.maximum(0.0, 1 - np.abs(distance))
    return (taps / taps.sum()).astype(np.float32)


def area_average(fine: Image, ratio: int) -> Image:
    """Collect the light of ``ratio`` x ``ratio`` fine pixels in one; leftover rows and columns are dropped."""
    rows, columns = fine.shape[0] // ratio, fine.shape[1] // ratio
    return cv2.resize(fine[: rows * ratio, : columns * ratio], (columns, rows), interpolation=cv2.INTER_AREA)


def sensor_signal(
    exposure: Image,
    *,
    full_well_electrons: float,
    read_noise_electrons: float,
    shot_noise: bool,
    bits: int | None,
    rng: np.random.Generator,
) -> tuple[Image, NDArray[np.bool_]]:
    """Photons to numbers: shot noise, read noise, saturation and quantisation.

    Parameters
    ----------
    exposure : ndarray
        Light on the sensor; 1 fills the well.
    full_well_electrons, read_noise_electrons : float
        Size of the well, and standard deviation of the read noise.
    shot_noise : bool
        Whether electrons are counted.
    bits : int or None
        Depth of the converter, or None for none.
    rng : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    signal : ndarray, float32
        In [0, 1], 1 where the converter ends.
    saturated : ndarray, bool
        Where it ended.
    """
    electrons: NDArray[np.floating] = np.maximum(exposure, 0) * full_well_electrons
    if shot_noise:
        electrons = photon_counts(electrons, rng).astype(np.float32)
    if read_noise_electrons > 0:
        electrons = electrons + rng.normal(0.0, read_noise_electrons, exposure.shape)
    signal = np.clip(electrons / full_well_electrons, 0.0, 1.0)
    if bits is not None:
        steps = 2**bits - 1
        signal = np.round(signal * steps) / steps
    return signal.astype(np.float32), signal >= 1.0
