"""What a polariser sees of gratings of every orientation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.data.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PolarizerResponse:
    """Intensity behind the polariser for every angle of it and every orientation of the grating.

    Attributes
    ----------
    intensity : ndarray of shape (T, P), float64
        A row an orientation, a column an angle of the polariser; 1 is a grating with R = 1 without a film.
    polarizer_rad : ndarray of shape (P,), float64
        Equal steps over [0, pi).
    orientation_rad : ndarray of shape (T,), float64
        Equal steps over [0, pi).
    row_maximum_rad : ndarray of shape (T,), float64
        Angle of the polariser at which each row is brightest, in [0, pi); NaN where it is flat.
    amplitude_ratio, phase_rad : float
        ``R = r exp(i zeta)``, complex ratio of s to p amplitude in the zeroth order.
    retardation_rad, film_axis_rad : float
        Retardation of one pass through the film, and the direction of its optical axis.
    offset_rad : float or None
        Of the line ``psi = theta + offset`` on which the row maxima lie without a film; None where there are none.
    label : str
        What the map shows.
    prenormalized : bool
        True where each column's mean over the orientations has been subtracted.
    """

    intensity: FloatArray
    polarizer_rad: FloatArray
    orientation_rad: FloatArray
    row_maximum_rad: FloatArray
    amplitude_ratio: float
    phase_rad: float
    retardation_rad: float
    film_axis_rad: float
    offset_rad: float | None
    label: str
    prenormalized: bool = False


@dataclass(frozen=True, eq=False)
class LineDeviation:
    """How far the row maxima of a polariser's response lie from a straight line.

    Attributes
    ----------
    orientation_rad : ndarray of shape (T,), float64
        Orientation of each row.
    deviation_rad : ndarray of shape (T,), float64
        Row maximum minus orientation minus offset, in [-pi/2, pi/2); NaN where a row is flat.
    prenormalized_rad : ndarray of shape (T,), float64
        The same after pre-normalisation, from its own line; NaN where that was not asked for.
    metrics : dict of str to float
        Figures for the table: each name ends in its unit, where it has one.
    """

    orientation_rad: FloatArray
    deviation_rad: FloatArray
    prenormalized_rad: FloatArray
    metrics: Mapping[str, float]
