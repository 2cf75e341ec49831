"""Where the four corners of a sheet lie in a photograph, found from its outline."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

LEAST_SHARE = 0.05
"""Of the photograph, that the sheet has to fill."""
_PROFILES = 160
_LONG = 0.9
"""Of the outline, that four sides make up."""
_REACHES_PX = (20.0, 8.0, 4.0)
_STEP_PX = 0.25
_WIDTH_PX = 2.0
"""Half width of a step that a lens has blurred."""
_STEEP = 0.4
"""Of the steepest step, that the sheet's edge reaches."""
_MARGIN = 0.04
"""Of each side, left out at its ends."""


def ordered(corners_px: Float64Array) -> Float64Array:
    """Corners (4, 2) as top left, top right, bottom right, bottom left of the picture, whose rows run down."""
    away = corners_px - corners_px.mean(axis=0)
    around = corners_px[np.argsort(np.arctan2(away[:, 1], away[:, 0]))]
    return np.asarray(np.roll(around, -int(np.argmin(around.sum(axis=1))), axis=0), np.float64)


def outlined_corners(grey: Float32Array) -> tuple[Float64Array, float]:
    """Corners of the bright quadrilateral in a photograph, and how far its edges lie off straight lines.

    Parameters
    ----------
    grey : ndarray of shape (M, N), float32
        The sheet is brighter than what lies around it.

    Returns
    -------
    corners_px : ndarray of shape (4, 2)
        Column and row, as :func:`ordered`: where straight lines through the outermost steep steps of each side
        meet.
    residual_px : float
        Root mean square distance of the steps from the lines.

    Raises
    ------
    ValueError
        No quadrilateral stands out.
    """
    corners = _quadrilateral(grey)
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    for reach in _REACHES_PX:
        lines, residuals = zip(*(_edge(smooth, corners[k], corners[(k + 1) % 4], reach) for k in range(4)), strict=True)
        corners = np.array([_crossing(lines[k - 1], lines[k]) for k in range(4)])
    return corners, float(np.sqrt(np.mean(np.square(residuals))))


def _quadrilateral(grey: Float32Array) -> Float64Array:
    """Where the four long sides of the largest bright region's convex hull meet, to a pixel or two.

    A dark part of the pattern in a corner cuts it off, which is a short side more.
    """
    top = float(np.percentile(grey, 99)) or 1.0
    levels = np.uint8(np.clip(grey / top, 0, 1) * 255)
    blurred = cv2.GaussianBlur(levels, (0, 0), 2.0)
    _, bright = cv2.threshold(blurred, 0, 255, cv2.THRESH_BINARY | cv2.THRESH_OTSU)
    bright = cv2.morphologyEx(bright, cv2.MORPH_CLOSE, np.ones((15, 15), np.uint8))
    outlines, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=cv2.contourArea, default=None)
    if outline is None or cv2.contourArea(outline) < LEAST_SHARE * grey.size:
        raise ValueError("nothing that fills a good part of the photograph is brighter than what lies around it")
    hull = cv2.convexHull(outline)
    length = cv2.arcLength(hull, True)
    for share in np.geomspace(0.002, 0.1, 32):
        corners = cv2.approxPolyDP(hull, share * length, True)[:, 0].astype(np.float64)
        sides = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(*sides.T)
        long = np.sort(np.argsort(lengths)[-4:])
        if len(corners) >= 4 and lengths[long].sum() >= _LONG * lengths.sum():
            lines = [(*sides[k], *corners[k]) for k in long]
            return ordered(np.array([_crossing(lines[k - 1], lines[k]) for k in range(4)]))
    raise ValueError("the outline of the brightest region has no four corners")


def _edge(
    grey: Float32Array, start: Float64Array, end: Float64Array, reach_px: float
) -> tuple[tuple[float, ...], float]:
    """A line ``(dx, dy, x, y)`` through the steepest steps across a side, and their distance from it."""
    along = (end - start) / np.linalg.norm(end - start)
    across = np.array([-along[1], along[0]])
    share = np.linspace(_MARGIN, 1 - _MARGIN, _PROFILES)[:, None, None]
    reach = np.arange(-reach_px, reach_px + _STEP_PX / 2, _STEP_PX)
    places = (start + share * (end - start) + reach[None, :, None] * across).astype(np.float32)
    profiles = cv2.remap(grey, places[..., 0], places[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    slope = np.abs(np.gradient(profiles, axis=1))
    # The outermost steep step: the pattern has steps, too. Corners run clockwise, so that profiles run inwards.
    peak = (slope >= np.roll(slope, 1, axis=1)) & (slope >= np.roll(slope, -1, axis=1))
    peak &= slope >= _STEEP * slope.max(axis=1, keepdims=True)
    near = np.abs(reach - reach[np.argmax(peak, axis=1)][:, None]) <= _WIDTH_PX
    middle = (reach * slope * near).sum(axis=1) / np.maximum((slope * near).sum(axis=1), 1e-12)
    steps = places[:, len(reach) // 2] + middle[:, None] * across
    line = cv2.fitLine(steps.astype(np.float32), cv2.DIST_HUBER, 0, 0.001, 0.001).ravel().tolist()
    dx, dy, x, y = line
    away = (steps[:, 0] - x) * dy - (steps[:, 1] - y) * dx
    return (dx, dy, x, y), float(np.sqrt(np.mean(np.sort(away**2)[: int(0.9 * len(away))])))


def _crossing(one: tuple[float, ...], other: tuple[float, ...]) -> Float64Array:
    across = np.array([[one[0], -other[0]], [one[1], -other[1]]])
    reach = np.linalg.solve(across, [other[2] - one[2], other[3] - one[3]])
    return np.array([one[2] + reach[0] * one[0], one[3] + reach[0] * one[1]])
