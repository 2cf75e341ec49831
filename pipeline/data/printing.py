"""What a printer of gratings is told."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PrintLayout:
    """One small grating, a dot, at every point of a square grid.

    Attributes
    ----------
    orientation_deg : ndarray of shape (M, N), float32
        In which direction each dot diffracts, across its lines, anticlockwise from +x, y up, in [0, 180); NaN where
        there is no dot. Row 0 is on top.
    lines_per_mm : ndarray of shape (M, N), float32
        Line density of each dot; NaN where there is none.
    dot_mm : float
        Distance of neighbouring dots.
    metrics : dict of str to float
        How far the print is from the maps it was made from: each name ends in its unit.
    """

    orientation_deg: FloatArray
    lines_per_mm: FloatArray
    dot_mm: float
    metrics: Mapping[str, float] = field(default_factory=dict)
