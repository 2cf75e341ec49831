"""A virtual sample as a polariser shows it: the forward model over a map."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.data.arrays import FloatArray
from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError
from pipeline.optics.jones import stokes_parameters
from pipeline.parallel import over_rows


def sample_pixels_across(camera_pixel_mm: float, sample_pixel_mm: float) -> int:
    """How many of a sample's pixels lie side by side under one of a camera's.

    Raises
    ------
    InputError
        No odd number of them, so that the camera's pixel centres would not meet the sample's.
    """
    ratio = camera_pixel_mm / sample_pixel_mm
    if abs(ratio - round(ratio)) > 1e-6 or round(ratio) % 2 == 0:
        raise InputError(
            f"the camera's pixel_mm, {camera_pixel_mm:g}, is {ratio:.4g} times the sample's, {sample_pixel_mm:g}",
            expected=f"an odd whole multiple, such as {3 * sample_pixel_mm:g}",
        )
    return round(ratio)


class SampleUnderPanel:
    """A sample under the panel, as seen through a polariser: three maps, from which every photograph is a sum.

    Parameters
    ----------
    sample : GratingSample
        The sample.
    """

    def __init__(self, sample: GratingSample) -> None:
        self.sample = sample
        self._longest = float(np.nanmax(sample.period_um))
        self._mean, self._cosine, self._sine = (np.empty(sample.period_um.shape, np.float32) for _ in range(3))
        over_rows(self._fill, len(self._mean), tile=32)

    def through_polarizer(self, polarizer_rad: float) -> NDArray[np.float32]:
        """Radiance of every point of the sample; 1 is the longest period's through an open polariser."""
        seen = self._cosine * np.float32(np.cos(2 * polarizer_rad))
        seen += self._sine * np.float32(np.sin(2 * polarizer_rad))
        seen += self._mean
        return seen

    def _fill(self, start: int, stop: int) -> None:
        sample, rows = self.sample, slice(start, stop)
        diffracts = np.isfinite(sample.orientation_rad[rows])
        stokes = stokes_parameters(
            sample.orientation_rad[rows],
            amplitude_ratio=_at(sample.amplitude_ratio, rows),
            phase_rad=_at(sample.phase_rad, rows),
            retardation_rad=_at(sample.retardation_rad, rows),
            film_axis_rad=_at(sample.film_axis_rad, rows),
        )
        # The zeroth order falls as 1 / K^2 when the period falls as 1 / K (section 5.4 of the paper).
        efficiency = (sample.period_um[rows] / self._longest) ** 2 / 2
        unpolarised = np.where(diffracts, 0.0, sample.ground_reflectance) + _at(sample.veil, rows)
        for image, part, rest in zip(
            (self._mean, self._cosine, self._sine), stokes, (unpolarised, 0.0, 0.0), strict=True
        ):
            image[rows] = np.where(diffracts, part * efficiency, 0.0) + rest


def _at(value: float | FloatArray, rows: slice) -> float | FloatArray:
    return value[rows] if isinstance(value, np.ndarray) else value
