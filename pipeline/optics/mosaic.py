"""Full-resolution images from the mosaic of a polarisation camera: polarisers on the pixels, in repeated 2 x 2 blocks.

Each of the four angles is sampled at a quarter of the pixels, one pixel apart from the others. Filling in the rest
turns edges of brightness into false polarisation, unless it is done with regard to the edges.
"""

from __future__ import annotations

from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

FloatImage = NDArray[np.float32]
BoolImage = NDArray[np.bool_]
Demosaic = Literal["bilinear", "guided"]

REACH = {"bilinear": 1, "guided": 3}
"""Rows and columns by which one bad pixel spoils its surroundings."""

_TENT = np.array([0.5, 1, 0.5], np.float32)
_FLOOR = 1e-3
"""Part of the mean signal below which neither gradients nor the intensity are told from noise."""


def demosaic(raw: FloatImage, *, method: Demosaic = "bilinear") -> FloatImage:
    """Fill in the image of the whole sensor for each of the four places of the 2 x 2 block.

    Parameters
    ----------
    raw : ndarray of shape (M, N), float32
        Frame as the sensor gives it. NaN stay, and spoil what lies within ``REACH`` of them.
    method : {"bilinear", "guided"}
        ``bilinear`` interpolates each angle by itself. ``guided`` interpolates the ratio of each angle to the
        intensity, which is known at every pixel on its own side of an edge, so that edges of brightness make little
        false polarisation.

    Returns
    -------
    ndarray of shape (4, M, N), float32
        In the order of the block: top left, top right, bottom left, bottom right. Where an angle was measured, its
        value is the measured one.

    Notes
    -----
    The intensity that guides is one of Morimatsu, Monno, Tanaka and Okutomi, "Monochrome and color polarization
    demosaicking using edge-aware residual interpolation", ICIP 2020: the mean of the four 2 x 2 blocks that hold a
    pixel, weighted by the inverse of the gradient towards each. Interpolating ratios rather than residuals keeps the
    degree and angle of polarisation along an edge where only the reflectance changes; a ratio lies in [0, 4].
    """
    if raw.ndim != 2 or min(raw.shape) < 4:
        raise ValueError(f"a mosaic of shape {raw.shape} is no image of at least 4 x 4 pixels")
    bad = ~np.isfinite(raw)
    whole: FloatImage = np.where(bad, np.float32(0), raw).astype(np.float32, copy=False)
    if method == "guided":
        floor = np.float32(max(_FLOOR * float(np.mean(np.abs(whole))), 1e-30))
        guide = np.maximum(_intensity(whole, floor), floor)
        ratio: FloatImage = np.divide(whole, guide, dtype=np.float32)
        planes = np.stack([guide * _fill(ratio, place) for place in range(4)])
    else:
        planes = np.stack([_fill(whole, place) for place in range(4)])
    for place, plane in enumerate(planes):
        top, left = divmod(place, 2)
        plane[top::2, left::2] = whole[top::2, left::2]
    if bad.any():
        planes[:, spread(bad, REACH[method])] = np.nan
    return planes


def spread(bad: BoolImage, reach: int) -> BoolImage:
    """Mark all pixels within ``reach`` rows and columns of a marked one."""
    size = 2 * reach + 1
    return np.asarray(cv2.dilate(bad.astype(np.uint8), np.ones((size, size), np.uint8)), bool)


def _fill(image: FloatImage, place: int) -> FloatImage:
    """Bilinear interpolation of one place of the block; mirroring about the outermost pixels keeps its parity."""
    top, left = divmod(place, 2)
    samples = np.zeros_like(image)
    samples[top::2, left::2] = image[top::2, left::2]
    return np.asarray(cv2.sepFilter2D(samples, cv2.CV_32F, _TENT, _TENT, borderType=cv2.BORDER_REFLECT_101))


def _intensity(raw: FloatImage, floor: np.float32) -> FloatImage:
    """Mean over the four angles at every pixel, from the blocks that lie on the pixel's own side of an edge."""
    rows, columns = raw.shape
    wide = cv2.copyMakeBorder(raw, 2, 2, 2, 2, cv2.BORDER_REFLECT_101)
    blocks = cv2.blur(wide, (2, 2), anchor=(0, 0), borderType=cv2.BORDER_REFLECT_101)

    def shifted(image: FloatImage, down: int, right: int) -> FloatImage:
        return image[2 + down : 2 + down + rows, 2 + right : 2 + right + columns]

    def gradient(down: int, right: int) -> FloatImage:
        along = (3, 1) if down else (1, 3)
        change = np.abs(raw - shifted(wide, 2 * down, 2 * right))
        return np.asarray(cv2.blur(change, along, borderType=cv2.BORDER_REFLECT_101))

    up, down, left, right = gradient(-1, 0), gradient(1, 0), gradient(0, -1), gradient(0, 1)
    total, weights = np.zeros(raw.shape, np.float32), np.zeros(raw.shape, np.float32)
    for row, column, change in ((0, 0, down + right), (0, -1, down + left), (-1, 0, up + right), (-1, -1, up + left)):
        weight = 1 / (change + floor)
        total += weight * shifted(blocks, row, column)
        weights += weight
    return total / weights
