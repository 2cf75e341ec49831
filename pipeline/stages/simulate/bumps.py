"""Regular bumps: boxes on a rectangular lattice."""

from __future__ import annotations

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse
from pipeline.optics import surfaces
from pipeline.stages.simulate._lattice import Lattice, lattice, unturnable
from pipeline.stages.simulate._surfaces import unmakeable


def bumps(
    *,
    period_um: float = 2.5,
    period_across_um: float = 2.0,
    width_um: float = 0.5,
    length_um: float = 1.0,
    depth_um: float = 0.15,
    orientation_deg: float = 0.0,
    size_um: float = 20.0,
    pitch_um: float = 0.025,
    periodic: bool = True,
) -> HeightField:
    """Make boxes that stand in rows, one a period both ways.

    Parameters
    ----------
    period_um, period_across_um : float
        Distance of neighbouring bumps along the orientation and across it.
    width_um, length_um : float
        Of a bump, along the orientation and across it. They end at the nearest sample.
    depth_um : float
        Their height.
    orientation_deg : float
        Anticlockwise from +x, y up.
    size_um, pitch_um : float
        Side of the surface and distance of its samples. Of a tile that repeats, both give way a little, so that
        ``period_um`` is exact, and so does ``period_across_um``, by less than half a pitch.
    periodic : bool
        Make a tile that repeats exactly; the orientation then is a multiple of 90 degrees.

    Returns
    -------
    HeightField
        Of about size / pitch samples a side, float32, from 0 up.

    Raises
    ------
    InputError, InputErrors
        Impossible numbers, bumps that touch, fewer than four samples a period or one period, too many samples, or an
        orientation in which no tile repeats.

    References
    ----------
    Stam, Diffraction shaders (SIGGRAPH 1999): bumps 0.5 um wide, 1 um long and 0.15 um high.
    """
    _check_bumps(
        period_um=period_um,
        period_across_um=period_across_um,
        width_um=width_um,
        length_um=length_um,
        depth_um=depth_um,
        orientation_deg=orientation_deg,
        size_um=size_um,
        pitch_um=pitch_um,
        periodic=periodic,
    )
    wanted = Lattice(period_um, period_across_um)
    made, u, v = lattice(wanted, orientation_deg=orientation_deg, size_um=size_um, pitch_um=pitch_um, periodic=periodic)
    standing = surfaces.bumps(u, v, width_um / made.period_um, length_um / made.across_um)
    said = (
        f"Bumps of {width_um:.4g} by {length_um:.4g} µm, {depth_um:.4g} µm high, every {made.period_um:.6g} and "
        f"{made.across_um:.6g} µm"
    )
    return HeightField(made.laid(np.float32(depth_um) * standing), made.pitch_um, periodic, said)


def _check_bumps(
    *,
    period_um: float,
    period_across_um: float,
    width_um: float,
    length_um: float,
    depth_um: float,
    orientation_deg: float,
    size_um: float,
    pitch_um: float,
    periodic: bool,
) -> None:
    """Refuse what cannot be made, before anything runs."""
    refuse(
        above_zero(period_across_um=period_across_um),
        above_zero_up_to(period_um, width_um=width_um) if period_um > 0 else [],
        above_zero_up_to(period_across_um, length_um=length_um) if period_across_um > 0 else [],
        unmakeable(period_um=period_um, depth_um=depth_um, size_um=size_um, pitch_um=pitch_um),
        unturnable(orientation_deg=orientation_deg, periodic=periodic),
    )
    if size_um < period_across_um:
        right = f"at least period_across_um, {period_across_um:g}"
        raise InputError(f"size_um is {size_um:g}", where="size_um", expected=right)
