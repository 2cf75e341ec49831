"""The tracks of a compact disc: pits in spirals so wide that they are straight here."""

from __future__ import annotations

import numpy as np

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.limits import above_zero_up_to, refuse, zero_or_more
from pipeline.optics.surfaces import CHANNEL_BIT_UM, LONGEST_RUN, pit_marks, pits
from pipeline.stages.simulate._lattice import Lattice, lattice, unturnable
from pipeline.stages.simulate._surfaces import unmakeable


def cd_tracks(
    *,
    period_um: float = 1.6,
    pit_width_um: float = 0.5,
    depth_um: float = 0.12,
    written: bool = True,
    orientation_deg: float = 0.0,
    size_um: float = 20.0,
    pitch_um: float = 0.025,
    periodic: bool = True,
    seed: int = 0,
) -> HeightField:
    """Make parallel tracks with pits of 3 to 11 channel bits of 0.278 um, or with a groove each.

    Parameters
    ----------
    period_um : float
        Pitch of the tracks, along the orientation.
    pit_width_um, depth_um : float
        Of the pits.
    written : bool
        Pits and lands in turn, their lengths by chance; false: grooves without end.
    orientation_deg : float
        Direction across the tracks, in which they diffract, anticlockwise from +x, y up.
    size_um, pitch_um : float
        Side of the surface and distance of its samples. Of a tile that repeats, both give way a little, so that
        ``period_um`` is exact, and so do the channel bits, by less than a pitch over the whole tile.
    periodic : bool
        Make a tile that repeats exactly; the orientation then is a multiple of 90 degrees.
    seed : int
        Of the pits.

    Returns
    -------
    HeightField
        Of about size / pitch samples a side, float32: 0 in a pit, ``depth_um`` elsewhere.

    Raises
    ------
    InputError, InputErrors
        Impossible numbers, pits wider than their tracks, fewer than four samples a period, too many samples, a size
        that holds no pit, or an orientation in which no tile repeats.

    References
    ----------
    ECMA-130, Data interchange on read-only 120 mm optical data disks (CD-ROM), 2nd edition (1996): tracks and bits.
    """
    _check_cd_tracks(
        period_um=period_um,
        pit_width_um=pit_width_um,
        depth_um=depth_um,
        orientation_deg=orientation_deg,
        size_um=size_um,
        pitch_um=pitch_um,
        periodic=periodic,
        seed=seed,
    )
    wanted = Lattice(period_um, CHANNEL_BIT_UM)
    made, u, v = lattice(wanted, orientation_deg=orientation_deg, size_um=size_um, pitch_um=pitch_um, periodic=periodic)
    tracks = made.periods or int(np.ptp(np.floor(u))) + 1
    bits = made.periods_across or int(np.ptp(v)) + 2 * LONGEST_RUN
    rng = np.random.default_rng(seed)
    marks = pit_marks(tracks, bits, rng) if written else np.ones((tracks, bits), np.bool_)
    land = ~pits(u, v, marks, pit_width_um / period_um)
    what = "Pits on the tracks of a compact disc" if written else "Grooves of a compact disc"
    said = f"{what}, every {made.period_um:.6g} µm, {pit_width_um:.4g} µm wide, {depth_um:.4g} µm deep"
    return HeightField(made.laid(np.float32(depth_um) * land), made.pitch_um, periodic, said)


def _check_cd_tracks(
    *,
    period_um: float,
    pit_width_um: float,
    depth_um: float,
    orientation_deg: float,
    size_um: float,
    pitch_um: float,
    periodic: bool,
    seed: int,
    **_: object,
) -> None:
    """Refuse what cannot be made, before anything runs."""
    shortest = 2 * LONGEST_RUN * CHANNEL_BIT_UM
    refuse(
        above_zero_up_to(period_um, pit_width_um=pit_width_um) if period_um > 0 else [],
        zero_or_more(seed=seed),
        unmakeable(period_um=period_um, depth_um=depth_um, size_um=size_um, pitch_um=pitch_um),
        unturnable(orientation_deg=orientation_deg, periodic=periodic),
    )
    if size_um < shortest:
        raise InputError(
            f"size_um is {size_um:g}", where="size_um", expected=f"at least {shortest:.3g}, a longest pit and land"
        )
