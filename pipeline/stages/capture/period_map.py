"""A map of periods from a file, or from the run of another experiment."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np

from pipeline.data.gratings import PeriodMap
from pipeline.devices.map_files import in_range, read_map_file, read_mask
from pipeline.devices.run_outputs import output_of
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse

_log = logging.getLogger(__name__)


def period_map(
    *,
    file: Path,
    node: str = "",
    range_um: tuple[float, ...] | None = None,
    range_lines_per_mm: tuple[float, ...] | None = None,
    mask: Path | None = None,
    pixel_mm: float | None = None,
    relative: bool | None = None,
) -> PeriodMap:
    """Read a map of grating periods; row 0 is on top.

    Parameters
    ----------
    file : Path
        The folder of a run (``runs/polarization_logo/3f2a91c0``); one of the EXR files that runs write, with a channel
        ``period_um``; an array of numpy (``.npy``) or a floating-point picture of one channel, in um; or a grey picture
        of integers, whose range has to be told.
    node : str
        Of a run, which node's map; empty: the last one, which no other map of periods was made from.
    range_um, range_lines_per_mm : [float, float], optional
        What black and full scale (255 of 8 bits, 1 of floating-point numbers) stand for, as periods or as line
        densities; ``range_lines_per_mm: [0, 1]`` reads floating-point numbers as lines per mm.
    mask : Path, optional
        A grey picture of the same size, black where nothing diffracts. NaN and periods that are not above 0 diffract
        nowhere.
    pixel_mm : float, optional
        Pitch, where the file does not say it, or instead of what it says.
    relative : bool, optional
        Whether only ratios of periods are known; null: what the file says, true where it says nothing.

    Returns
    -------
    PeriodMap
        float32, NaN where masked.

    Raises
    ------
    InputError
        The file or the run's map is missing, unreadable or no map, its range is not told or told twice, or all of it
        is masked.
    """
    refuse(above_zero(pixel_mm=pixel_mm))
    if range_um is not None and range_lines_per_mm is not None:
        raise InputError("the range is told twice", where="range_um, range_lines_per_mm", expected="one of them")
    if file.is_dir():
        file, chosen = output_of(file, PeriodMap.__name__, node, "period")
        _log.info("the map of node '%s'", chosen)
    found = read_map_file(file, "period_um")
    if range_lines_per_mm is None:
        period = in_range(found, file, "range_um", range_um, or_else=" or range_lines_per_mm")
    else:
        density = in_range(found, file, "range_lines_per_mm", range_lines_per_mm)
        period = np.divide(np.float32(1000), density, out=np.zeros_like(density), where=density > 0)
    diffracts = read_mask(mask, period.shape) & np.isfinite(period) & (period > 0)
    if not diffracts.any():
        raise InputError("no period is known: all is masked", where=str(file), expected="a map of periods")
    return PeriodMap(
        np.where(diffracts, period, np.float32(np.nan)),
        diffracts,
        found.stated("pixel_mm", pixel_mm),
        relative=bool(found.attributes.get("relative", 1.0)) if relative is None else relative,
    )


def _check_period_map(
    *,
    file: Path,
    node: str,
    range_um: tuple[float, ...] | None,
    range_lines_per_mm: tuple[float, ...] | None,
    mask: Path | None,
    pixel_mm: float | None,
    relative: bool | None,
) -> None:
    """Decode the file before anything runs."""
    period_map(
        file=file,
        node=node,
        range_um=range_um,
        range_lines_per_mm=range_lines_per_mm,
        mask=mask,
        pixel_mm=pixel_mm,
        relative=relative,
    )
