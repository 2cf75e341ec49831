"""A blazed grating: a sawtooth."""

from __future__ import annotations

from pipeline.data.height_fields import HeightField
from pipeline.limits import refuse
from pipeline.optics import surfaces
from pipeline.stages.simulate._surfaces import repeated, undirected, unmakeable


def blaze(
    *,
    period_um: float = 2.5,
    depth_um: float = 0.246,
    orientation_deg: float = 0.0,
    size_um: float = 20.0,
    pitch_um: float = 0.025,
    periodic: bool = True,
) -> HeightField:
    """Make a grating that rises along its orientation over each period, and falls at once.

    The highest sample of a period lies a pitch before the fall, so it misses ``depth_um`` by one part in as many as
    there are samples. Period, depth and pitch are those of the blaze that Single's thesis evaluates.

    Parameters
    ----------
    period_um, depth_um : float
        Of the grating; the full height.
    orientation_deg : float
        Direction in which it rises, anticlockwise from +x, y up.
    size_um, pitch_um : float
        Side of the surface and distance of its samples. Of a tile that repeats, both give way a little, so that the
        period is exact; its direction then is the nearest that such a tile can have, see
        :func:`pipeline.optics.surfaces.grating_tile`.
    periodic : bool
        Make a tile that repeats exactly.

    Returns
    -------
    HeightField
        Of about size / pitch samples a side, float32, from 0 up.

    Raises
    ------
    InputError, InputErrors
        Impossible numbers, fewer than four samples a period or one period, too many samples, or an orientation so near
        an axis that no tile of that size repeats.

    References
    ----------
    Single, Diffraction Shader, bachelor thesis, University of Bern (2014), chapter 3.
    """
    _check_blaze(
        period_um=period_um,
        depth_um=depth_um,
        orientation_deg=orientation_deg,
        size_um=size_um,
        pitch_um=pitch_um,
        periodic=periodic,
    )
    return repeated(
        surfaces.blaze,
        "Blazed grating",
        period_um=period_um,
        depth_um=depth_um,
        orientation_deg=orientation_deg,
        size_um=size_um,
        pitch_um=pitch_um,
        periodic=periodic,
    )


def _check_blaze(
    *, period_um: float, depth_um: float, orientation_deg: float, size_um: float, pitch_um: float, periodic: bool
) -> None:
    """Refuse what cannot be made, before anything runs."""
    refuse(unmakeable(period_um=period_um, depth_um=depth_um, size_um=size_um, pitch_um=pitch_um))
    refuse(undirected(period_um=period_um, orientation_deg=orientation_deg, size_um=size_um, periodic=periodic))
