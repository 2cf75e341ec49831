"""Least-squares cosine of period 180 degrees through photographs taken at several polariser angles.

``y_k = mean + c cos 2 psi_k + s sin 2 psi_k`` is linear in its unknowns, so each of them is one weighted sum over the
photographs, with weights that are the same for every pixel: one pass, no solver per pixel.
"""

from __future__ import annotations

import numpy as np
from numba import float32, njit
from numpy.typing import ArrayLike, NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

_TILE = 512  # pixels of a row whose accumulators stay in the first-level cache together with the photographs' rows
_PI = np.float32(np.pi)
_HALF_PI = np.float32(np.pi / 2)

# Minimax odd polynomial for atan on [-1, 1] (Remez exchange in double precision), powers 1, 3, ..., 15.
ATAN = tuple(np.float32(c) for c in ATAN_COEFFICIENTS)  # placeholder
