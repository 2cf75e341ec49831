"""A holographic sheet in a light probe, from its maps of orientation and period."""

from __future__ import annotations

from typing import Literal

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.data.light_probes import LightProbe
from pipeline.data.pictures import Pictures
from pipeline.devices.sheet_theory import warn_of_theory
from pipeline.devices.sheet_views import WIDEST_VIEW_DEG, blind_camera, camera_view, rectified_view, unusable_counts
from pipeline.devices.virtual_environment import Gratings, render_in_environment
from pipeline.devices.virtual_light import WAVELENGTH_STEPS_NM
from pipeline.devices.virtual_sheet import MOST_SAMPLES
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, at_least, refuse, within, zero_or_more
from pipeline.optics.environment.probe import Probe, pose
from pipeline.stages.render._sheets import check_size, offset_note, sheet_of

_SEVERAL_TILES = 960
"""Pixels along the longer side, of which each is the mean of many points."""

_tolerance_environment = {"rgb": 1e-3}


def environment(
    orientation: OrientationMap,
    period: PeriodMap,
    probe: LightProbe,
    bumps: HeightField | None = None,
    *,
    rotation_deg: list[float] = [0.0],  # noqa: B006 - read from the syntax tree, never modified
    tilt_deg: float = 0.0,
    camera_mm: list[float] = [0.0, 0.0, 500.0],  # noqa: B006
    depth_um: float = 0.12,
    coherence_um: float = 65.0,
    width_mm: float = 15.0,
    tiles: list[int] = [1, 1],  # noqa: B006
    view: Literal["rectified", "camera"] = "rectified",
    target_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
    up: list[float] = [0.0, 1.0, 0.0],  # noqa: B006
    field_of_view_deg: float | None = None,
    size_px: list[int] | None = None,
    evaluator: Literal["auto", "reference", "ordered", "low_rank", "brute"] = "auto",
    wavelength_step_nm: float | None = None,
    orders: Literal["exact", "second order"] = "exact",
    refractive_index: float | None = None,
    samples: int | None = None,
    tolerance: float = 0.01,
) -> Pictures:
    """Render a sheet in the light of all that surrounds it.

    Each order and wavelength shows the probe in the direction that the grating sends to the camera, as if the coherence
    window were infinitely wide; the zeroth order is the probe in a mirror. A probe's colours are taken as the smooth
    spectra of Mallett and Yuksel under D65. Pixels without a grating stay dark.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Maps of the same shape (M, N), of one tile.
    probe : LightProbe
        What surrounds the sheet, which is small against the distance of it.
    bumps : HeightField, optional
        Unevenness of the sheet, in the middle of it; one that repeats goes on. Its slopes tilt the gratings.
    rotation_deg : list of float
        By which the probe is turned around the vertical, anticlockwise from above; a picture for each. At 0 the
        probe's middle is straight behind the viewer; at 180 it is behind the sheet, as is usual among probes.
    tilt_deg : float
        By which the sheet leans back: 0 upright, 90 flat on a table.
    camera_mm : [x, y, z]
        Position of the camera: x right, y up along the sheet, z its normal.
    depth_um : float
        Peak-to-valley depth of the gratings.
    coherence_um : float
        Width 4 sigma_s of the coherence window, which brute force alone takes into account.
    width_mm : float
        Width of the tile where the maps do not know their pixel pitch.
    tiles : [columns, rows]
        How often the tile is repeated.
    view : {"rectified", "camera"}
        The sheet as it lies, lit as the camera sees it, or the camera's picture.
    target_mm : [x, y, z]
        What lies in the middle of the camera's picture.
    up : [x, y, z]
        What points up in it.
    field_of_view_deg : float, optional
        Across its width; by default as wide as shows the whole sheet.
    size_px : [columns, rows], optional
        Of the picture; by default a pixel for each point of the maps, of several tiles at most 960 along a side.
    evaluator : {"auto", "reference", "ordered", "low_rank", "brute"}
        ``reference``: all orders every 5 nm, in double precision. ``ordered``: only as many look-ups, the most
        important first, as the tolerance needs. ``low_rank``: from values at few directions of view, orientations and
        periods, where the sheet is flat. ``brute``: the sum over the whole probe of the BRDF with its Gaussian
        coherence window, which takes milliseconds a pixel. ``auto`` takes what is fast within the tolerance, and
        says what.
    wavelength_step_nm : float, optional
        Step of the spectral sum; by default 5 nm, and where look-ups are ordered as many as the tolerance needs.
    orders : {"exact", "second order"}
        Efficiency of the orders by Bessel functions, for any depth, or expanded to second order as in the paper.
    refractive_index : float, optional
        Of a film over the gratings whose Schlick reflectance grows towards grazing light; by default a mirror's.
    samples : int, optional
        Points along each side of a pixel; by default as many of the points of the maps that it shows as change it by
        more than the tolerance, or by 16.
    tolerance : float
        Error relative to the largest value that fast evaluators may make on all but a thousandth of the pixels, share
        of the light that they may leave out, and root mean square of what more samples may change.

    Returns
    -------
    Pictures
        Linear sRGB in the unit of the probe, of shape (rotations, rows, columns, 3).

    Raises
    ------
    InputError
        The maps differ in shape, the pictures are too many and too large, or brute force is asked for with a window
        so wide that the probe would be cut into too many parts.

    References
    ----------
    Toisoul, Dhillon and Ghosh 2018, section 6.3; Mallett and Yuksel 2019.
    """
    sheet = sheet_of(orientation, period, bumps, width_mm=width_mm, tiles=tiles)
    camera = np.asarray(camera_mm, np.float64)
    if view == "rectified":
        seen = rectified_view(sheet, camera, size_px, most_px=_SEVERAL_TILES if sheet.tiles != (1, 1) else None)
    else:
        seen = camera_view(sheet, camera, target_mm, up, field_of_view_deg, size_px)
    check_size(len(rotation_deg), seen)
    warn_of_theory(sheet.period_um, depth_um=depth_um, orders=orders, illuminant="D65", tolerance=tolerance)
    gratings = Gratings(depth_um, orders, refractive_index, coherence_um)
    pictures = [
        render_in_environment(
            sheet,
            seen,
            Probe(np.ascontiguousarray(probe.rgb, np.float32), pose(np.deg2rad(degrees), np.deg2rad(tilt_deg))),
            gratings,
            evaluator=evaluator,
            wavelength_step_nm=wavelength_step_nm,
            samples=samples,
            tolerance=tolerance,
        )
        for degrees in rotation_deg
    ]
    place = probe.caption[:1].lower() + probe.caption[1:]
    return Pictures(
        np.stack(pictures),
        tuple(f"turned by {degrees:g}°" for degrees in rotation_deg),
        f"The sheet in {place or 'a light probe'}{offset_note(orientation)}",
    )


def _check_environment(
    *,
    rotation_deg: list[float],
    tilt_deg: float,
    camera_mm: list[float],
    depth_um: float,
    coherence_um: float,
    width_mm: float,
    tiles: list[int],
    target_mm: list[float],
    up: list[float],
    field_of_view_deg: float | None,
    size_px: list[int] | None,
    wavelength_step_nm: float | None,
    refractive_index: float | None,
    samples: int | None,
    tolerance: float,
    **_: object,
) -> None:
    """Refuse impossible places and sizes before anything runs."""
    problems = []
    if not rotation_deg or not np.isfinite(rotation_deg).all():
        expected = "at least one angle in degrees"
        problems.append(InputError(f"{list(rotation_deg)} are no rotations", where="rotation_deg", expected=expected))
    if len(camera_mm) != 3 or not np.isfinite(camera_mm).all() or camera_mm[2] <= 0:
        expected = "[x, y, z] in mm, z above the sheet's 0"
        problems.append(InputError(f"{list(camera_mm)} is no place", where="camera_mm", expected=expected))
    refuse(
        problems,
        within(0, 90, tilt_deg=tilt_deg),
        zero_or_more(depth_um=depth_um),
        above_zero(coherence_um=coherence_um, width_mm=width_mm),
        within(1e-4, 0.5, tolerance=tolerance),
        within(*WAVELENGTH_STEPS_NM, wavelength_step_nm=wavelength_step_nm),
        [] if refractive_index is None else at_least(1.01, "denser than air", refractive_index=refractive_index),
        within(1, MOST_SAMPLES, samples=samples),
        above_zero_up_to(WIDEST_VIEW_DEG, field_of_view_deg=field_of_view_deg),
        unusable_counts("tiles", tiles, "[columns, rows] of tiles, whole numbers from 1"),
        []
        if size_px is None
        else unusable_counts("size_px", size_px, "[columns, rows] in pixels, whole numbers from 1"),
    )
    refuse(blind_camera(camera_mm, target_mm, up))
