"""A virtual sample as a polariser shows it: the forward model over a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data import GratingSample
from pipeline.optics.jones import polarizer_response


class SampleUnderPanel:
    """A sample under the panel, as seen through a polariser: few orientations, so few different responses.

    Parameters
    ----------
    sample : GratingSample
        The sample.
    """

    def __init__(self, sample: GratingSample) -> None:
        self.sample = sample
        diffracts = sample.diffracts
        longest = float(np.nanmax(sample.period_um))
        self._ground = np.float32(sample.ground_reflectance)
        orientations = np.where(diffracts, sample.orientation_rad, 0.0)
        self._orientations = np.unique(orientations)
        # Several times faster than unique's own inverse, which sorts every pixel's index.
        self._index = np.searchsorted(self._orientations, orientations)
        # The zeroth order falls as 1 / K^2 when the period falls as 1 / K (section 5.4 of the paper).
        self._efficiency = np.where(diffracts, (sample.period_um / longest) ** 2, 0.0).astype(np.float32)
        self._unpolarised = np.where(diffracts, 0.0, self._ground).astype(np.float32)

    def through_polarizer(self, polarizer_rad: float) -> NDArray[np.float32]:
        """Radiance of every point of the sample; 1 is the longest period's through an open polariser."""
        response = polarizer_response(
            polarizer_rad,
            self._orientations,
            amplitude_ratio=self.sample.amplitude_ratio,
            phase_rad=self.sample.phase_rad,
            retardation_rad=self.sample.retardation_rad,
            film_axis_rad=self.sample.film_axis_rad,
        ).astype(np.float32)
        modulated = response[self._index] * self._efficiency
        return modulated + self._unpolarised
