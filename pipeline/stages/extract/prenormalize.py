"""The paper's pre-normalisation, of a simulated map."""

from __future__ import annotations

from dataclasses import replace

from pipeline.data.polarization import PolarizerResponse
from pipeline.optics.row_maxima import ROUNDING, row_maxima

_tolerance_prenormalize = {"intensity": 1e-9, "row_maximum_rad": 1e-6, "offset_rad": 1e-6}


def prenormalize(response: PolarizerResponse) -> PolarizerResponse:
    """Subtract from each angle of the polariser the mean over all orientations.

    A column of the map stands for a photograph in which all orientations are equally common; what the film adds to all
    of them alike goes with the mean.

    Parameters
    ----------
    response : PolarizerResponse
        Of shape (T, P).

    Returns
    -------
    PolarizerResponse
        Of the same shape, its row maxima found anew.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, section 5.3, figure 15d, right.
    """
    intensity = response.intensity - response.intensity.mean(axis=0)
    rounding = ROUNDING * float(response.intensity.max())
    maxima = row_maxima(intensity, response.polarizer_rad, least_amplitude=rounding)
    return replace(response, intensity=intensity, row_maximum_rad=maxima.polarizer_rad, prenormalized=True)
