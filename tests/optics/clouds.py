"""Points on a response curve as photographs with shot noise show them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.curve_search import Points
from pipeline.optics.response_curve import FilmedGrating, harmonic_design, relative_stokes

EQUAL = np.arange(12) * np.pi / 12


def photographs(
    grating: FilmedGrating,
    theta: NDArray[np.float64],
    *,
    polarizer_rad: NDArray[np.float64] = EQUAL,
    electrons: float = 5000,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Electrons of every pixel in every photograph, shape (K, *theta.shape)."""
    m, s1, s2 = relative_stokes(theta, grating)
    c, s = harmonic_design(polarizer_rad)[:, 1:].T.reshape(2, -1, *[1] * theta.ndim)
    return np.random.default_rng(seed).poisson(electrons * m * (1 + s1 * c + s2 * s)).astype(np.float64)


def cloud(
    grating: FilmedGrating,
    theta: NDArray[np.float64],
    *,
    polarizer_rad: NDArray[np.float64] = EQUAL,
    electrons: float = 5000,
    seed: int = 0,
) -> Points:
    photos = photographs(grating, theta, polarizer_rad=polarizer_rad, electrons=electrons, seed=seed)
    weights = 1 / photos.mean(axis=1)
    weights /= weights.mean()
    root = np.sqrt(weights)[:, None]
    mean, c, s = (np.linalg.pinv(harmonic_design(polarizer_rad) * root) * root.T) @ photos
    return Points(np.stack([c, s], axis=1) / mean[:, None], 1 / np.sqrt(mean), polarizer_rad, weights, systematic=0.05)
