"""Maps of orientation and period drawn from geometry: x right, y up, origin at the centre, later shapes on top."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Point = tuple[float, float]
Map = Callable[[Float64Array, Float64Array], Float64Array]
"""A function of x and y in mm."""


@dataclass(frozen=True)
class Window:
    """The pixels around a shape, with the coordinates of their centres.

    Attributes
    ----------
    rows, columns : slice
        Where they lie on the map.
    x_mm : ndarray of shape (1, n)
        Across.
    y_mm : ndarray of shape (m, 1)
        Up.
    """

    rows: slice
    columns: slice
    x_mm: Float64Array
    y_mm: Float64Array


class Drawing:
    """A map that is drawn on; a pixel belongs to a shape if its centre does.

    Parameters
    ----------
    columns : int
        Pixels across, and up where ``rows`` says nothing else.
    pixel_mm : float
        Their pitch.
    rows : int, optional
        Pixels up.

    Attributes
    ----------
    x_mm, y_mm : ndarray of shape (columns,) and (rows,)
        Centres of the columns and of the rows.
    orientation_rad, period_um : ndarray of shape (rows, columns), float32
        What is drawn; NaN where nothing is.
    """

    def __init__(self, columns: int, pixel_mm: float, rows: int | None = None) -> None:
        self.rows, self.columns = columns if rows is None else rows, columns
        self.pixel_mm = pixel_mm
        self.x_mm = np.asarray((np.arange(columns) + 0.5 - columns / 2) * pixel_mm, np.float64)
        self.y_mm = -np.asarray((np.arange(self.rows) + 0.5 - self.rows / 2) * pixel_mm, np.float64)
        self.orientation_rad = np.full((self.rows, columns), np.nan, np.float32)
        self.period_um = np.full((self.rows, columns), np.nan, np.float32)

    def window(self, left: float, low: float, right: float, high: float) -> Window:
        """The pixels of a rectangle, given in mm, as far as they lie on the map."""
        across, up, pixel = self.columns, self.rows, self.pixel_mm
        columns = slice(max(int(left / pixel + across / 2), 0), min(int(right / pixel + across / 2) + 1, across))
        rows = slice(max(int(up / 2 - high / pixel), 0), min(int(up / 2 - low / pixel) + 1, up))
        return Window(rows, columns, self.x_mm[None, columns], self.y_mm[rows, None])

    def paint(self, window: Window, inside: BoolArray, orientation_rad: float | Map, period_um: float | Map) -> None:
        """Give the pixels ``inside`` a window an orientation, of any number of half turns, and a period."""
        inside = np.broadcast_to(inside, (window.y_mm.size, window.x_mm.size))
        x = np.broadcast_to(window.x_mm, inside.shape)[inside]
        y = np.broadcast_to(window.y_mm, inside.shape)[inside]
        orientation = np.mod(_value(orientation_rad, x, y), np.pi).astype(np.float32)
        # Just below pi, float32 rounds up to a number that is above it.
        orientation = np.where(orientation >= np.pi, np.float32(0), orientation)
        self.orientation_rad[window.rows, window.columns][inside] = orientation
        self.period_um[window.rows, window.columns][inside] = _value(period_um, x, y)

    def polygon(self, vertices_mm: Float64Array, orientation_rad: float | Map, period_um: float | Map) -> None:
        """Fill a convex polygon, its vertices of shape (n, 2) anticlockwise."""
        window = self.window(*vertices_mm.min(axis=0), *vertices_mm.max(axis=0))
        inside = np.ones((window.y_mm.size, window.x_mm.size), bool)
        for (x0, y0), (x1, y1) in zip(vertices_mm, np.roll(vertices_mm, -1, axis=0), strict=True):
            inside &= (x1 - x0) * (window.y_mm - y0) - (y1 - y0) * (window.x_mm - x0) >= 0
        self.paint(window, inside, orientation_rad, period_um)

    def annulus(
        self, centre_mm: Point, radii_mm: tuple[float, float], orientation_rad: float | Map, period_um: float | Map
    ) -> None:
        """Fill what lies between two circles around a centre; a disc where the inner radius is 0."""
        (x, y), (inner, outer) = centre_mm, radii_mm
        window = self.window(x - outer, y - outer, x + outer, y + outer)
        radius = np.hypot(window.x_mm - x, window.y_mm - y)
        self.paint(window, (radius >= inner) & (radius <= outer), orientation_rad, period_um)


def polar(radius: float, angle_deg: float, centre: Point = (0.0, 0.0)) -> Point:
    """The point at a distance from a centre, in a direction anticlockwise from +x."""
    angle = np.deg2rad(angle_deg)
    return float(centre[0] + radius * np.cos(angle)), float(centre[1] + radius * np.sin(angle))


def azimuth(centre: Point = (0.0, 0.0)) -> Map:
    """Direction in which a point lies from a centre, anticlockwise from +x, in (-pi, pi]."""
    return lambda x, y: np.arctan2(y - centre[1], x - centre[0])


def ray(radii: tuple[float, float], angle_deg: float, width: float, centre: Point = (0.0, 0.0)) -> Float64Array:
    """A bar of constant width that points away from a centre."""
    across = np.array(polar(width / 2, angle_deg + 90))
    start, stop = (np.array(polar(radius, angle_deg, centre)) for radius in radii)
    return np.array([start - across, stop - across, stop + across, start + across])


def star(centre: Point, radius: float, *, points: int, waist: float, turn_deg: float) -> Iterator[Float64Array]:
    """The kites, one a point, that make up a star whose notches lie at ``waist`` times its radius."""
    half = 180 / points
    for index in range(points):
        tip = turn_deg + 2 * half * index
        corners = [(0.0, tip), (waist * radius, tip - half), (radius, tip), (waist * radius, tip + half)]
        yield np.array([polar(distance, angle, centre) for distance, angle in corners])


def _value(field: float | Map, x: Float64Array, y: Float64Array) -> float | Float64Array:
    return field(x, y) if callable(field) else field
