"""Between which limits the half vector and the width of lobes lie in a picture, looked up at some of its pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.sheet.view import View

Float64Array = NDArray[np.float64]
_SAMPLES = 65
_MARGIN = 0.02


@dataclass(frozen=True)
class Extent:
    """What occurs in a picture.

    Attributes
    ----------
    w : tuple of float
        Least and largest component of the half vector along the normal.
    across : float
        Largest component across it.
    light_variance : tuple of float
        Least and largest variance by which the light's size widens lobes; the least where it is foreshortened.
    pixel_variance : float
        The largest by which the half vector's change within a pixel does.
    """

    w: tuple[float, float]
    across: float
    light_variance: tuple[float, float]
    pixel_variance: float

    def __or__(self, other: Extent) -> Extent:
        low, high = (
            tuple(pick(a, b) for a, b in zip(*pair, strict=True))
            for pick, pair in (
                (min, ((self.w[0], self.light_variance[0]), (other.w[0], other.light_variance[0]))),
                (
                    max,
                    (
                        (self.w[1], self.light_variance[1], self.across, self.pixel_variance),
                        (other.w[1], other.light_variance[1], other.across, other.pixel_variance),
                    ),
                ),
            )
        )
        return Extent((low[0], high[0]), high[2], (low[1], high[1]), high[3])


def extent(
    view: View,
    light_mm: Float64Array,
    light_sigma_mm: float,
    slopes: NDArray[np.floating] | None = None,
    pixel_part: float = 1.0,
    size_mm: tuple[float, float] | None = None,
) -> Extent:
    """What occurs under one light where the view shows the sheet.

    Parameters
    ----------
    view : View
        The picture.
    light_mm, light_sigma_mm : ndarray of shape (3,), float
        Place of the light, and standard deviation of its extent.
    slopes : ndarray of shape (2, rows, columns), optional
        Of a sheet that is not flat.
    pixel_part : float
        Side of the area that a value stands for, in pixels.
    size_mm : tuple of float, optional
        Width and height of the sheet, where the picture shows more.
    """
    row, column = _some(view.rows), _some(view.columns)
    across, down = np.meshgrid(column, row)
    place = view.points(across, down)
    half, towards, distance = _half_vectors(place, view.eye_mm, light_mm)
    cosine_sum, cosine = half[..., 2], towards[..., 2]
    limit = np.inf if size_mm is None else np.array(size_mm) / 2 * (1 + _MARGIN)
    seen = np.all(np.abs(place) <= limit, axis=-1)
    if not seen.any():
        return Extent((2.0, 2.0), 0.0, (0.0, 0.0), 0.0)
    change = [
        _half_vectors(view.points(across + dx, down + dy), view.eye_mm, light_mm)[0] - half
        for dx, dy in ((pixel_part, 0), (0, pixel_part))
    ]
    pixel_variance = sum((step**2).sum(axis=-1) for step in change) / 12
    sideways = np.linalg.norm(half[..., :2], axis=-1)
    if slopes is not None:
        p, q = (np.asarray(part[np.ix_(row.astype(int), column.astype(int))], np.float64) for part in slopes)
        cosine_sum, cosine = (
            (one[..., 2] - p * one[..., 0] - q * one[..., 1]) / np.sqrt(1 + p**2 + q**2) for one in (half, towards)
        )
        sideways = np.sqrt(np.maximum((half**2).sum(axis=-1) - cosine_sum**2, 0))
        seen &= (cosine_sum > 0) & (cosine > 0)
    variance = (light_sigma_mm / distance[seen]) ** 2
    w = cosine_sum[seen]
    return Extent(
        (float(w.min()), float(w.max())),
        float(sideways[seen].max()),
        (float((variance * cosine[seen] ** 2).min()), float(variance.max())),
        float(np.nanmax(pixel_variance[seen])),
    )


def _some(count: int) -> Float64Array:
    return np.unique(np.linspace(0, count - 1, min(count, _SAMPLES)).round())


def _half_vectors(place: Float64Array, eye: Float64Array, light: Float64Array) -> tuple[Float64Array, ...]:
    points = np.concatenate([place, np.zeros((*place.shape[:-1], 1))], axis=-1)
    away = [point - points for point in (light, eye)]
    length = [np.linalg.norm(one, axis=-1) for one in away]
    half = away[0] / length[0][..., None] + away[1] / length[1][..., None]
    return half, away[0] / length[0][..., None], length[0]
