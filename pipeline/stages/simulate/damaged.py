"""A sample with its defects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.data.inspection import Defects
from pipeline.errors import InputError
from pipeline.optics.angles import wrap_axial


def damaged(sample: GratingSample, defects: Defects) -> GratingSample:
    """Damage a sample: gratings vanish, are turned, or change their period where the defects say.

    Parameters
    ----------
    sample : GratingSample
        Of shape (M, N).
    defects : Defects
        On the sample's grid, from ``simulate.defects``.

    Returns
    -------
    GratingSample
        The same sample elsewhere.

    Raises
    ------
    InputError
        The defects are on another grid.
    """
    if defects.labels.shape != sample.orientation_rad.shape:
        raise InputError(
            f"defects on a grid of {defects.labels.shape} and a sample of {sample.orientation_rad.shape}",
            expected="defects that were drawn for this sample",
        )
    orientation, period = sample.orientation_rad.copy(), sample.period_um.copy()
    for index, kind in enumerate(defects.kind):
        area = defects.labels == index + 1
        if kind in {"missing", "scratch"}:
            orientation[area] = period[area] = np.nan
        else:
            orientation[area] = wrap_axial(orientation[area] + defects.turn_rad[index])
            period[area] *= np.float32(defects.period_ratio[index])
    orientation[orientation >= np.float32(np.pi)] = 0
    return replace(sample, orientation_rad=orientation, period_um=period)
