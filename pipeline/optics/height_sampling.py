"""Heights at other places than those that were measured."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.interpolate import make_interp_spline
from scipy.signal import resample

Float64Array = NDArray[np.float64]


def squared(height: NDArray[np.floating], pitch_x: float, pitch_y: float) -> tuple[Float64Array, float]:
    """A map with pixels of two pitches brought to square ones of the smaller pitch, by cubic splines.

    Parameters
    ----------
    height : ndarray of shape (M, N)
        NaN where it is not known.
    pitch_x, pitch_y : float
        Distance of columns and of rows.

    Returns
    -------
    height : ndarray
        Of the same extent, up to one pixel.
    pitch : float
        The smaller one.
    """
    pitch = min(pitch_x, pitch_y)
    rows, columns = height.shape
    row = np.arange(math.floor((rows - 1) * pitch_y / pitch + 1e-9) + 1) * pitch / pitch_y
    column = np.arange(math.floor((columns - 1) * pitch_x / pitch + 1e-9) + 1) * pitch / pitch_x
    return at_places(height, row, column), pitch


def at_places(height: NDArray[np.floating], row: Float64Array, column: Float64Array) -> Float64Array:
    """Heights on the grid of fractional rows and columns, by a cubic spline; NaN where the nearest one is not known."""
    known = np.isfinite(height)
    found = _along(_along(filled(height), row, 0), column, 1)
    nearest = known[np.ix_(np.rint(row).astype(int), np.rint(column).astype(int))]
    return np.where(nearest, found, np.nan)


def _along(height: Float64Array, places: Float64Array, axis: int) -> Float64Array:
    count = height.shape[axis]
    return np.asarray(make_interp_spline(np.arange(count), height, min(3, count - 1), axis=axis)(places))


def filled(height: NDArray[np.floating]) -> Float64Array:
    """The map with the nearest known height wherever none is known; zeros where nothing is."""
    whole, known = np.asarray(height, np.float64), np.isfinite(height)
    if known.all():
        return whole
    if not known.any():
        return np.zeros(whole.shape)
    row, column = ndimage.distance_transform_edt(~known, return_distances=False, return_indices=True)
    return np.asarray(whole[row, column])


def resampled(height: NDArray[np.floating], factor: float) -> Float64Array:
    """A map whose pitch is ``factor`` times as large, without what the new pitch cannot hold.

    Before a coarser sampling a Gaussian takes away what would fold over, of standard deviation ``sqrt(factor^2 - 1) /
    2`` old pitches: from a factor of 2 on, at most 2.5 percent are left of what would fold onto zero.

    Parameters
    ----------
    height : ndarray of shape (M, N)
        NaN where it is not known.
    factor : float
        New pitch over old one.

    Returns
    -------
    ndarray
        The first sample stays where it is; the last lies within the map.
    """
    row, column = (np.arange(math.floor((count - 1) / factor + 1e-9) + 1) * factor for count in height.shape)
    return at_places(_blurred(height, math.sqrt(max(factor**2 - 1, 0)) / 2), row, column)


def resampled_tile(height: NDArray[np.floating], rows: int, columns: int) -> Float64Array:
    """A tile that repeats, on another number of samples: the same Fourier series, cut where the new tile ends.

    Parameters
    ----------
    height : ndarray of shape (M, N)
        All known.
    rows, columns : int
        Of the new tile.
    """
    once = resample(np.asarray(height, np.float64), rows, axis=0)
    return np.asarray(resample(once, columns, axis=1))


def _blurred(height: NDArray[np.floating], sigma: float) -> NDArray[np.floating]:
    """Gaussian mean of what is known."""
    if sigma == 0:
        return height
    known = np.isfinite(height)
    total = ndimage.gaussian_filter(np.where(known, height, 0.0).astype(np.float64), sigma, mode="nearest")
    share = ndimage.gaussian_filter(known.astype(np.float64), sigma, mode="nearest")
    return np.where(known, total / np.maximum(share, 1e-12), np.nan)
