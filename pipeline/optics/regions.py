"""Connected regions of a map: centre, area and largest width."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial.distance import pdist

Float64Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True)
class Regions:
    """Where regions lie and how large they are.

    Attributes
    ----------
    centre_mm : ndarray of shape (D, 2), float64
        Centre of the area: x right, y up, origin at the centre of the map.
    area_mm2 : ndarray of shape (D,), float64
        Area.
    width_mm : ndarray of shape (D,), float64
        Largest distance between two corners of its pixels.
    """

    centre_mm: Float64Array
    area_mm2: Float64Array
    width_mm: Float64Array

    @property
    def elongation(self) -> Float64Array:
        """Largest width over the mean width across it; 4 / pi for a disc."""
        return self.width_mm**2 / self.area_mm2


def disc(radius_px: float) -> NDArray[np.uint8]:
    """Pixels within a radius, as a structuring element."""
    reach = np.arange(-int(radius_px), int(radius_px) + 1)
    return (reach[:, None] ** 2 + reach**2 <= radius_px**2 + 1e-9).astype(np.uint8)


def grown(area: BoolArray, radius_px: float) -> BoolArray:
    """The area and all pixels within a radius of it."""
    return cv2.dilate(area.astype(np.uint8), disc(radius_px), borderValue=0).astype(bool)


def eroded(area: BoolArray, radius_px: float) -> BoolArray:
    """Pixels of the area around which it holds all within a radius; what lies beyond the map counts as inside."""
    return cv2.erode(area.astype(np.uint8), disc(radius_px), borderValue=1).astype(bool)


def joined(area: BoolArray, gap_px: float = 0.0) -> tuple[NDArray[np.int32], int]:
    """Label the parts of an area that hang together, corners included, or lie no more than a gap apart."""
    whole = grown(area, gap_px / 2) if gap_px > 0 else area
    labels, count = ndimage.label(whole, np.ones((3, 3), int))
    return np.where(area, labels, 0).astype(np.int32), int(count)


def described(labels: NDArray[np.int32], count: int, pixel_mm: float) -> Regions:
    """Describe the regions labelled 1 to ``count``, of which none is empty."""
    centre, area, width = np.zeros((count, 2)), np.zeros(count), np.zeros(count)
    rows, columns = labels.shape
    for index, window in enumerate(ndimage.find_objects(labels, count)):
        inside = labels[window] == index + 1
        down, right = np.nonzero(inside)
        down, right = down + window[0].start, right + window[1].start
        centre[index] = right.mean() - (columns - 1) / 2, (rows - 1) / 2 - down.mean()
        area[index] = len(down)
        corners = np.concatenate([np.stack([right + a, down + b], axis=1) for a in (0, 1) for b in (0, 1)])
        width[index] = pdist(cv2.convexHull(corners.astype(np.int32))[:, 0].astype(np.float64)).max()
    return Regions(centre * pixel_mm, area * pixel_mm**2, width * pixel_mm)
