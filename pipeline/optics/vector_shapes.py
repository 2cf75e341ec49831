"""Shapes bounded by polygons of any form, and bands along lines, as sets of pixels."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.drawing import BoolArray, Drawing, Float64Array, Window


def bounds(contours: Sequence[Float64Array], around_mm: float = 0.0) -> tuple[float, float, float, float]:
    """Left, low, right and high of contours of shape (n, 2), and so much around them."""
    points = np.concatenate(contours)
    (left, low), (right, high) = points.min(axis=0) - around_mm, points.max(axis=0) + around_mm
    return float(left), float(low), float(right), float(high)


def filled(contours: Sequence[Float64Array], window: Window, *, even_odd: bool) -> BoolArray:
    """The pixels of a window whose centres lie inside closed contours.

    On each row, pixels to the right of an edge gain its sense of winding; what then is not 0, or odd, lies inside.

    Parameters
    ----------
    contours : sequence of ndarray of shape (n, 2)
        Vertices in mm, y up; the last is joined to the first.
    window : Window
        Of shape (m, n).
    even_odd : bool
        Whether overlaps of an even number are holes; otherwise those whose senses cancel.
    """
    x, y = window.x_mm.ravel(), window.y_mm.ravel()
    turns = np.zeros((y.size, x.size + 1), np.int32)
    for contour in contours:
        (x0, y0), (x1, y1) = contour.T, np.roll(contour, -1, axis=0).T
        # Of each edge the rows from its upper end, which does not belong to it, to its lower one, which does.
        first = np.searchsorted(-y, -np.maximum(y0, y1), side="right")
        crossed = np.searchsorted(-y, -np.minimum(y0, y1), side="right") - first
        edge = np.repeat(np.arange(len(contour)), crossed)
        row = np.arange(edge.size) + np.repeat(first - np.cumsum(crossed) + crossed, crossed)
        at = x0[edge] + (x1 - x0)[edge] * (y[row] - y0[edge]) / (y1 - y0)[edge]
        np.add.at(turns, (row, np.searchsorted(x, at)), np.where(y1 > y0, 1, -1)[edge])
    winding = turns.cumsum(axis=1)[:, :-1]
    return winding % 2 == 1 if even_odd else winding != 0


def band(lines: Sequence[Float64Array], width_mm: float, drawing: Drawing) -> tuple[Window, BoolArray, Float64Array]:
    """The pixels within half a width of lines, and the direction of the line that each is nearest to.

    Ends and corners are round.

    Parameters
    ----------
    lines : sequence of ndarray of shape (n, 2)
        Points of each line in mm, y up.
    width_mm : float
        Of the band.
    drawing : Drawing
        Whose pixels.

    Returns
    -------
    window : Window
        Around the band, of shape (m, n).
    inside : ndarray of shape (m, n), bool
        What belongs to it.
    direction_rad : ndarray of shape (m, n)
        Anticlockwise from +x, modulo pi; NaN outside.
    """
    half = width_mm / 2
    window = drawing.window(*bounds(lines, half))
    shape = (window.y_mm.size, window.x_mm.size)
    nearest, direction = np.full(shape, half**2), np.full(shape, np.nan)
    for line in lines:
        for start, stop in pairwise(line):
            along: NDArray[np.float64] = stop - start
            length2 = float(along @ along)
            if length2 == 0:
                continue
            here = drawing.window(*bounds([np.stack([start, stop])], half))
            rows = slice(here.rows.start - window.rows.start, here.rows.stop - window.rows.start)
            columns = slice(here.columns.start - window.columns.start, here.columns.stop - window.columns.start)
            dx, dy = here.x_mm - start[0], here.y_mm - start[1]
            t = np.clip((dx * along[0] + dy * along[1]) / length2, 0, 1)
            distance2 = (dx - t * along[0]) ** 2 + (dy - t * along[1]) ** 2
            closer = distance2 <= nearest[rows, columns]
            nearest[rows, columns][closer] = distance2[closer]
            direction[rows, columns][closer] = np.mod(np.arctan2(along[1], along[0]), np.pi)
    return window, np.isfinite(direction), direction
