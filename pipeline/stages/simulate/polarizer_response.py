"""Intensity behind a turning polariser for all orientations of a grating, without camera or noise."""

from __future__ import annotations

import cmath
import logging
from typing import Literal

import numpy as np

from pipeline.data.polarization import PolarizerResponse
from pipeline.limits import refuse, within
from pipeline.optics import jones
from pipeline.optics.fresnel import zeroth_order_ratio
from pipeline.optics.metals import METALS
from pipeline.optics.row_maxima import row_maxima

LEAST_ANGLES = 4
LEAST_ORIENTATIONS = 12
MOST_STEPS = 3600
LARGEST_RATIO = 1e4

log = logging.getLogger(__name__)

_tolerance_polarizer_response = {"intensity": 1e-9, "row_maximum_rad": 1e-6, "offset_rad": 1e-6}


def polarizer_response(
    *,
    metal: Literal["silver", "aluminium", "gold", "copper", "brass", "iron", "platinum"] | None = None,
    amplitude_ratio: float = 1.0,
    phase_deg: float = 0.0,
    incidence_deg: float = 1.0,
    film_index: float = 1.468,
    p_axis: Literal["reversed", "kept"] = "reversed",
    retardation_deg: float = 0.0,
    film_axis_deg: float = 0.0,
    polarizer_count: int = 180,
    orientation_count: int = 180,
) -> PolarizerResponse:
    """Map the intensity over the polariser's angle and the grating's orientation, each over half a turn.

    Parameters
    ----------
    metal : str, optional
        Metal under the film at 530 nm, whose Fresnel coefficients multiply R; none: R is as the next two say.
    amplitude_ratio, phase_deg : float
        ``r exp(i zeta)``, ratio of s to p amplitude that the grating itself gives the zeroth order. 1 and 0 with a
        metal: the flat metal alone, as in the paper's figure 15a.
    incidence_deg : float
        Angle of incidence on the metal, in air.
    film_index : float
        Mean index of the film on the metal; cellophane's, as in the paper. 1 is none.
    p_axis : {"reversed", "kept"}
        Axes of the field that the metal reflects, see :func:`pipeline.optics.fresnel.zeroth_order_ratio`: reversed,
        as in the paper, R is near 1; kept, near -1, and a turning flat metal goes unseen.
    retardation_deg, film_axis_deg : float
        Birefringence of the film: retardation of one pass, and direction of the axis. No retardation is Case I of the
        paper, any other Case II.
    polarizer_count, orientation_count : int
        Steps over 180 degrees.

    Returns
    -------
    PolarizerResponse
        Of shape (orientation_count, polarizer_count).

    Raises
    ------
    InputError
        A count, an index or a ratio out of its range; an incidence not in [0, 90) degrees.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 5.3, figures 14 and 15.
    """
    _check_polarizer_response(
        amplitude_ratio=amplitude_ratio,
        incidence_deg=incidence_deg,
        film_index=film_index,
        polarizer_count=polarizer_count,
        orientation_count=orientation_count,
    )
    ratio = cmath.rect(amplitude_ratio, np.deg2rad(phase_deg))
    if metal is not None:
        incidence = float(np.deg2rad(incidence_deg))
        ratio *= zeroth_order_ratio(METALS[metal].index, incidence_rad=incidence, film_index=film_index, p_axis=p_axis)
    r, zeta = abs(ratio), cmath.phase(ratio)
    polarizer = np.pi * np.arange(polarizer_count) / polarizer_count
    orientation = np.pi * np.arange(orientation_count) / orientation_count
    intensity = jones.polarizer_response(
        polarizer,
        orientation[:, None],
        amplitude_ratio=r,
        phase_rad=zeta,
        retardation_rad=float(np.deg2rad(retardation_deg)),
        film_axis_rad=float(np.deg2rad(film_axis_deg)),
    )
    maxima = row_maxima(intensity, polarizer).polarizer_rad
    flat = np.count_nonzero(np.isnan(maxima))
    if flat:
        log.warning("%d of %d rows are flat: with R = %.6g the polariser changes nothing there.", flat, len(maxima), r)
    return PolarizerResponse(
        intensity=intensity,
        polarizer_rad=polarizer,
        orientation_rad=orientation,
        row_maximum_rad=maxima,
        amplitude_ratio=r,
        phase_rad=zeta,
        retardation_rad=float(np.deg2rad(retardation_deg)),
        film_axis_rad=float(np.deg2rad(film_axis_deg)),
        offset_rad=jones.offset_without_film(r, zeta),
        label=f"{metal} at {incidence_deg:g}° incidence" if metal else "a grating of given R",
    )


def _check_polarizer_response(
    *,
    amplitude_ratio: float,
    incidence_deg: float,
    film_index: float,
    polarizer_count: int,
    orientation_count: int,
    **_: object,
) -> None:
    """Refuse what has no map, before anything runs."""
    refuse(
        within(0, LARGEST_RATIO, amplitude_ratio=amplitude_ratio),
        within(0, 89.9, incidence_deg=incidence_deg),
        within(1, 4, film_index=film_index),
        within(LEAST_ANGLES, MOST_STEPS, polarizer_count=polarizer_count),
        within(LEAST_ORIENTATIONS, MOST_STEPS, orientation_count=orientation_count),
    )
