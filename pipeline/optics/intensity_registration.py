"""OpenCV's registration of one photograph onto another, which takes what is bright in one to be bright in the other."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.optics.rigid import RigidMotion, centre_of

Float32Array = NDArray[np.float32]
Shift = tuple[float, float]

_ANGLES = 1440
"""Rows of a spectrum in polar coordinates; the peak is found to a fraction of one."""


def ecc_motion(
    reference: Float32Array, image: Float32Array, valid: NDArray[np.bool_], start_px: Shift, *, rigid: bool
) -> tuple[Shift, float]:
    """Shift and turn of ``image`` against ``reference`` that give the highest correlation.

    Parameters
    ----------
    reference, image : ndarray of shape (M, N), float32
        Two photographs, or the :func:`gradient_image` of each.
    valid : ndarray of shape (M, N), bool
        Pixels of the reference that count.
    start_px : tuple of float
        Rows down and columns to the right to start from.
    rigid : bool
        Whether the photograph may have turned.

    Raises
    ------
    cv2.error
        The iteration does not converge.

    References
    ----------
    Evangelidis and Psarakis, Parametric image alignment using enhanced correlation coefficient maximization, IEEE
    Trans. Pattern Analysis and Machine Intelligence 30 (2008).
    """
    warp = np.eye(2, 3, dtype=np.float32)
    warp[:, 2] = start_px[1], start_px[0]
    criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 100, 1e-6)
    model = cv2.MOTION_EUCLIDEAN if rigid else cv2.MOTION_TRANSLATION
    _, warp = cv2.findTransformECC(reference, image, warp, model, criteria, valid.astype(np.uint8), 5)
    turn = float(np.arctan2(warp[0, 1], warp[0, 0]))
    # OpenCV turns about the upper left pixel.
    centre = centre_of(reference.shape)
    row, column = RigidMotion(turn).matrix @ centre - centre + warp[::-1, 2]
    return (float(row), float(column)), turn


def gradient_image(image: Float32Array) -> Float32Array:
    """Soft gradient magnitude in [0, 1), in which a facet's edge stays bright when the facet turns dark."""
    smooth = cv2.GaussianBlur(image, (0, 0), 1.0)
    magnitude = cv2.magnitude(*(cv2.Sobel(smooth, cv2.CV_32F, across, 1 - across, ksize=3) for across in (1, 0)))
    level = np.float32(2 * np.mean(magnitude) + np.finfo(np.float32).tiny)
    return np.asarray(magnitude / (magnitude + level), np.float32)


def phase_correlation_motion(reference: Float32Array, image: Float32Array, *, rigid: bool) -> tuple[Shift, float]:
    """Shift by phase correlation; before it, where wanted, the turn, by that of the spectra in polar coordinates.

    References
    ----------
    De Castro and Morandi, Registration of translated and rotated images using finite Fourier transforms, IEEE Trans.
    Pattern Analysis and Machine Intelligence 9 (1987). A logarithm of the radius would only be there for the scale.
    """
    turn = _turn_of_spectrum(reference, image) if rigid else 0.0
    back = _turned_back(image, turn) if turn else image
    window = cv2.createHanningWindow(reference.shape[::-1], cv2.CV_32F)
    # OpenCV 5.0 multiplies its arguments by the window in place, so it gets copies.
    (column, row), _ = cv2.phaseCorrelate(reference.copy(), back.copy(), window)
    # The shift was found in the frame that is turned back.
    row, column = RigidMotion(turn).matrix @ np.array([row, column])
    return (float(row), float(column)), turn


def _turn_of_spectrum(reference: Float32Array, image: Float32Array) -> float:
    size = min(reference.shape)
    middle = size // 2
    taper = np.hanning(size).astype(np.float32)
    spectra = []
    for picture in (reference, image):
        square = (picture[:size, :size] - picture[:size, :size].mean()) * taper * taper[:, None]
        spectrum = np.log1p(np.abs(np.fft.fftshift(np.fft.fft2(square)))).astype(np.float32)
        polar = cv2.warpPolar(spectrum, (middle, _ANGLES), (middle, middle), middle, cv2.INTER_LINEAR)
        # Half a turn says all; low frequencies are the taper's, and the fall towards high ones is no direction.
        rings = polar[: _ANGLES // 2, middle // 2 :]
        spectra.append((rings - rings.mean(axis=0)) / (rings.std(axis=0) + np.finfo(np.float32).tiny))
    (_, rows), _ = cv2.phaseCorrelate(*spectra)
    # OpenCV's polar angle runs clockwise as seen.
    return float(-rows * 2 * np.pi / _ANGLES)


def _turned_back(image: Float32Array, turn_rad: float) -> Float32Array:
    height, width = image.shape
    row, column = centre_of(image.shape)
    back = cv2.getRotationMatrix2D((float(column), float(row)), -np.rad2deg(turn_rad), 1.0)
    return cv2.warpAffine(image, back, (width, height), flags=cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
