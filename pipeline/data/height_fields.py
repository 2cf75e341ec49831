"""Heights of surfaces, and how they repeat."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights of a surface over a plane, on square pixels.

    Attributes
    ----------
    height_um : ndarray of shape (M, N), float32 or float64
        Up, from any zero; NaN where it is not known. Row 0 is the one of largest y, so x goes right and y up.
    pitch_um : float
        Distance of neighbouring samples.
    periodic : bool
        True where the surface goes on as this tile repeated, N pitches wide and M high.
    caption : str
        What it is, and where it comes from.
    """

    height_um: FloatArray
    pitch_um: float
    periodic: bool = False
    caption: str = ""


@dataclass(frozen=True, eq=False)
class Periodicity:
    """Periods of a surface and their directions, that of most variance first; none where K is 0.

    Attributes
    ----------
    period_um, period_error_um : ndarray of shape (K,), float64
        Period and its standard error, which is 0 for whole cycles of a tile that repeats.
    direction_rad, direction_error_rad : ndarray of shape (K,), float64
        Direction in which it repeats, across the lines, in [0, pi); and its standard error.
    rms_um : ndarray of shape (K,), float64
        Root mean square height of what repeats so.
    contrast : ndarray of shape (K,), float64
        Of the peak over the spectrum around it.
    spread : ndarray of shape (K,), float64
        Width of the peak over its frequency: by how much the period varies; 0 where the whole map swings in step.
    power_um2 : ndarray of shape (2 m + 1, 2 n + 1), float32
        Spectrum of the heights around frequency 0, row 0 at the highest y.
    step_per_um : tuple of float
        Frequency from bin to bin along x and y.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    period_um: FloatArray
    period_error_um: FloatArray
    direction_rad: FloatArray
    direction_error_rad: FloatArray
    rms_um: FloatArray
    contrast: FloatArray
    spread: FloatArray
    power_um2: FloatArray
    step_per_um: tuple[float, float]
    metrics: Mapping[str, float]
