"""The orientations of a drawn sample, as if they had been measured without error."""

from __future__ import annotations

from pipeline.data.gratings import GratingSample, OrientationMap


def drawn_orientation(sample: GratingSample) -> OrientationMap:
    """Take the orientations that were drawn.

    Parameters
    ----------
    sample : GratingSample
        Of shape (M, N).

    Returns
    -------
    OrientationMap
        Of the same shape and pitch, absolute; no photographs, hence no correlation and no intensity.
    """
    return OrientationMap.of_angles(sample.orientation_rad, pixel_mm=sample.pixel_mm, absolute=True)
