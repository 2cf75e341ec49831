"""Sheets as their maps describe them."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.devices.virtual_sheet import Sheet
from pipeline.errors import InputError
from pipeline.limits import different_shapes
from pipeline.optics.sheet.maps import Bumps, slopes_of
from pipeline.optics.sheet.view import View

_log = logging.getLogger(__name__)

_MOST_PIXELS = 300_000_000
_OFFSET_UNKNOWN = "Orientations are known up to one offset: facets may shine under other lights than here"


def sheet_of(
    orientation: OrientationMap,
    period: PeriodMap,
    bumps: HeightField | None,
    *,
    width_mm: float,
    tiles: Sequence[int],
) -> Sheet:
    """The sheet that maps describe, ``width_mm`` wide a tile where they do not know their pitch.

    Raises
    ------
    InputError
        The maps differ in shape, or bumps have no slopes everywhere.
    """
    if orientation.orientation_rad.shape != period.period_um.shape:
        raise different_shapes(orientation=orientation.orientation_rad.shape, period=period.period_um.shape)
    pixel_mm = orientation.pixel_mm or period.pixel_mm
    if pixel_mm is None:
        pixel_mm = width_mm / orientation.orientation_rad.shape[1]
        _log.warning(
            "the pixel pitch is not known: a tile is rendered as %g mm wide (width_mm); of files "
            "graph.orientation.pixel_mm states it, of photographs rig.pixel_mm or pixel_mm in capture.yaml",
            width_mm,
        )
    slopes = None if bumps is None else _slopes(bumps)
    return Sheet(orientation.orientation_rad, period.period_um, pixel_mm, (tiles[0], tiles[1]), slopes)


def check_size(count: int, view: View) -> None:
    """Refuse more pictures of a view than memory holds.

    Raises
    ------
    InputError
        They are too many and too large.
    """
    if count * view.rows * view.columns > _MOST_PIXELS:
        raise InputError(
            f"{count} pictures of {view.columns} x {view.rows} pixels do not fit into memory",
            where="size_px",
            expected=f"at most {_MOST_PIXELS / count:.3g} pixels each",
        )


def offset_note(orientation: OrientationMap) -> str:
    """What a caption adds, and a warning says, where orientations are not absolute; otherwise empty."""
    if orientation.absolute:
        return ""
    _log.warning(
        "%s. fit.offset makes them absolute, from photographs under a torch or from known_deg; of a file that is "
        "known to be, say graph.orientation.absolute=true",
        _OFFSET_UNKNOWN,
    )
    return f". {_OFFSET_UNKNOWN}"


def _slopes(bumps: HeightField) -> Bumps:
    missing = int(np.count_nonzero(~np.isfinite(bumps.height_um)))
    if missing:
        raise InputError(f"{missing} heights of the bumps are not known", expected="align.filled, which fills gaps")
    if min(bumps.height_um.shape) < 2:
        raise InputError("bumps of a single row or column have no slopes")
    slopes = slopes_of(bumps.height_um, bumps.pitch_um, periodic=bumps.periodic)
    return Bumps(slopes, bumps.pitch_um / 1000, bumps.periodic)
