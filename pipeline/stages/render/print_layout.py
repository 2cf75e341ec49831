"""What a printer of gratings needs: one dot of one orientation and line density a point."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.printing import PrintLayout
from pipeline.errors import InputError
from pipeline.limits import above_zero, different_shapes, refuse
from pipeline.optics.dot_grid import cells_under, nearest_angles, nearest_multiples, nearest_of

Float64Array = NDArray[np.float64]

_log = logging.getLogger(__name__)


def print_layout(
    orientation: OrientationMap,
    period: PeriodMap,
    *,
    dot_mm: float = 0.05,
    angle_step_deg: float = 1.0,
    density_step_per_mm: float = 10.0,
    lines_per_mm: tuple[float, ...] | None = None,
    pixel_mm: float | None = None,
) -> PrintLayout:
    """Lay dots on a grid, each with the grating under its centre, as nearly as the printer can make it.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Of the same shape (M, N).
    dot_mm : float
        Distance of neighbouring dots.
    angle_step_deg : float
        Of the printer's orientations, multiples of a step that divides 180.
    density_step_per_mm : float
        Of the printer's line densities, multiples of a step.
    lines_per_mm : tuple of float, optional
        The line densities that the printer can make, instead of a step.
    pixel_mm : float, optional
        Pitch of the maps where they do not know it, or instead of what they know.

    Returns
    -------
    PrintLayout
        Its ``outputs`` are a table (CSV), two TIFF files and an EXR file with the channels of maps. Its metrics:
        ``orientation_step_mean_deg``, ``orientation_step_max_deg``, ``period_step_mean_um`` and
        ``period_step_max_um`` are what the printer's steps cost at the dots; the same with ``print`` compare the print
        with the maps at every pixel that both cover, so that what lies between dots counts too; ``coverage_percent`` is
        how much of the maps' gratings dots cover, ``dots`` how many there are.

    Raises
    ------
    InputError, InputErrors
        The maps differ in shape, their pitch is not known, no dot falls on a grating, or a step is impossible.
    """
    _check_print_layout(
        dot_mm=dot_mm,
        angle_step_deg=angle_step_deg,
        density_step_per_mm=density_step_per_mm,
        lines_per_mm=lines_per_mm,
        pixel_mm=pixel_mm,
    )
    shape = orientation.orientation_rad.shape
    if shape != period.period_um.shape:
        raise different_shapes(orientation=shape, period=period.period_um.shape)
    pitch = pixel_mm or orientation.pixel_mm or period.pixel_mm
    if pitch is None:
        raise InputError("the maps do not know their pixel pitch", where="pixel_mm", expected="pixel_mm: the pitch")
    if not orientation.absolute:
        _log.warning("orientations are known up to one offset, by which the print may be turned")
    if period.relative:
        _log.warning("only ratios of the periods were measured: line densities stand on the longest that was given")
    known = orientation.mask & period.mask
    angle = np.where(known, np.rad2deg(orientation.orientation_rad.astype(np.float64)), np.nan)
    density = 1000 / np.where(known, period.period_um.astype(np.float64), np.nan)
    dots = tuple(max(1, round(side * pitch / dot_mm)) for side in shape)
    place = np.ix_(*(cells_under(n, dot_mm, side, pitch) for n, side in zip(dots, shape, strict=True)))
    printed_angle = nearest_angles(angle[place], angle_step_deg)
    printed_density = (
        nearest_multiples(density[place], density_step_per_mm)
        if lines_per_mm is None
        else nearest_of(density[place], lines_per_mm)
    )
    filled = np.isfinite(printed_angle)
    if not filled.any():
        raise InputError("no dot falls on a grating", where="dot_mm", expected=f"finer dots than {dot_mm:g} mm")
    back = np.ix_(*(cells_under(side, pitch, n, dot_mm) for n, side in zip(dots, shape, strict=True)))
    metrics = {
        **_differences("step", printed_angle, printed_density, angle[place], density[place]),
        **_differences("print", printed_angle[back], printed_density[back], angle, density),
        "coverage_percent": 100 * float(np.mean(filled[back][known])),
        "dots": float(np.count_nonzero(filled)),
    }
    return PrintLayout(printed_angle.astype(np.float32), printed_density.astype(np.float32), dot_mm, metrics)


def _differences(
    name: str, printed_deg: Float64Array, printed_density: Float64Array, deg: Float64Array, density: Float64Array
) -> dict[str, float]:
    """How far orientations and periods are from those that were wanted, where both are known."""
    turn = np.abs(printed_deg - deg)
    angle = np.minimum(turn, 180 - turn)
    period = np.abs(1000 / printed_density - 1000 / density)
    both = np.isfinite(angle)
    if not both.any():
        return {}
    return {
        f"orientation_{name}_mean_deg": float(angle[both].mean()),
        f"orientation_{name}_max_deg": float(angle[both].max()),
        f"period_{name}_mean_um": float(period[both].mean()),
        f"period_{name}_max_um": float(period[both].max()),
    }


def _check_print_layout(
    *,
    dot_mm: float,
    angle_step_deg: float,
    density_step_per_mm: float,
    lines_per_mm: tuple[float, ...] | None,
    pixel_mm: float | None,
) -> None:
    """Refuse what no printer can do, before anything runs."""
    refuse(
        above_zero(
            dot_mm=dot_mm, angle_step_deg=angle_step_deg, density_step_per_mm=density_step_per_mm, pixel_mm=pixel_mm
        )
    )
    steps = 180 / angle_step_deg
    if abs(steps - round(steps)) > 1e-6:
        raise InputError(
            f"angle_step_deg is {angle_step_deg:g}", where="angle_step_deg", expected="a step that divides 180"
        )
    if lines_per_mm is not None and (not lines_per_mm or min(lines_per_mm) <= 0):
        raise InputError(
            f"lines_per_mm is {list(lines_per_mm)}", where="lines_per_mm", expected="line densities above 0"
        )
