"""A holographic sheet under a small light, from its maps of orientation and period."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.data.pictures import PictureSeries
from pipeline.devices.sheet_views import WIDEST_VIEW_DEG, blind_camera, camera_view, rectified_view, unusable_counts
from pipeline.devices.virtual_light import Lighting, check_lighting, white_level
from pipeline.devices.virtual_sheet import MOST_SAMPLES, POINTS, Sheet, automatic_sampling, render_sheet
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, at_least, refuse, within, zero_or_more
from pipeline.optics.gratings import order_efficiency, window_spread
from pipeline.stages.render._sheets import check_size, offset_note, sheet_of

# Lobes are steep: orientations that differed by 1.2e-6 rad were seen to change a pixel by 2.6e-5 of white.
_tolerance_point_light = {"rgb": 5e-4}

_log = logging.getLogger(__name__)

_ANIMATED_PX = 640
_FRAMES_PER_SECOND = 24.0
_LONGEST_ORBIT = 720
_MIDDLE_UM = 0.55
_NOTHING = 1e-3
"""Of a grating that shines, below which a display shows next to nothing."""


def point_light(
    orientation: OrientationMap,
    period: PeriodMap,
    bumps: HeightField | None = None,
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float] = [0.0, 0.0, 500.0],  # noqa: B006 - read from the syntax tree, never modified
    light_sigma_mm: float = 12.0,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "D65",
    depth_um: float = 0.12,
    coherence_um: float = 65.0,
    width_mm: float = 15.0,
    tiles: list[int] = [1, 1],  # noqa: B006
    view: Literal["rectified", "camera"] = "rectified",
    target_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
    up: list[float] = [0.0, 1.0, 0.0],  # noqa: B006
    field_of_view_deg: float | None = None,
    size_px: list[int] | None = None,
    evaluator: Literal["auto", "spectral", "tabulated"] = "auto",
    precision: Literal["single", "double"] = "single",
    wavelength_step_nm: float = 5.0,
    orders: Literal["exact", "second order"] = "exact",
    refractive_index: float | None = None,
    samples: int | None = None,
    anti_aliased: bool = True,
    tolerance: float = 0.01,
    together: bool = False,
    orbit: int | None = None,
    white_percentile: float = 99.5,
) -> PictureSeries:
    """Render a sheet under a light that is carried around it.

    Each pixel's light is summed over wavelengths and over all diffraction orders that can reach the camera, each order
    as wide as the coherence window, the light's extent and the pixel's area make it. Orientations that are known only
    up to one offset make facets shine under the wrong lights: there is a warning, and the caption says so.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Maps of the same shape (M, N), of one tile.
    bumps : HeightField, optional
        Unevenness of the sheet, in the middle of it; one that repeats goes on. Its slopes tilt the gratings.
    lights_mm : list of [x, y, z]
        Positions of the light: x right, y up, z towards the camera, origin at the centre of the sheet.
    camera_mm : [x, y, z]
        Position of the camera.
    light_sigma_mm : float
        Standard deviation of the light's Gaussian extent.
    illuminant : {"D65", "A", "inverse A", "E"}
        Spectrum of the light; colours are balanced so that white paper under it is white.
    depth_um : float
        Peak-to-valley depth of the gratings.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.
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
        Of the picture. By default a rectified one has a pixel for each point of the maps, of several tiles at most 1920
        along a side, and a camera's is 960 by 720.
    evaluator : {"auto", "spectral", "tabulated"}
        The sum over wavelengths in double precision, or a look-up in a table of colours. ``auto`` takes the table for
        large pictures if it keeps the tolerance on some of their pixels, and says what it took.
    precision : {"single", "double"}
        Of the look-ups; single is faster, and as exact as a table is.
    wavelength_step_nm : float
        Step of the spectral sum.
    orders : {"exact", "second order"}
        Efficiency of the orders by Bessel functions, for any depth, or expanded to second order as in the paper.
    refractive_index : float, optional
        Of a film over the gratings whose Schlick reflectance grows towards grazing light; by default a mirror's.
    samples : int, optional
        Points along each side of a pixel; by default one for each point of the maps that it shows.
    anti_aliased : bool
        Average over a pixel's area; otherwise what lies in its middle is all that it shows.
    tolerance : float
        Error relative to white that look-ups, and lobes taken as constant within a pixel, may make.
    together : bool
        All lights are on at once, in one picture.
    orbit : int, optional
        Carry the light once around the sheet's normal in so many steps, as an animation of 24 pictures a second, by
        default of 640 pixels along the longer side.
    white_percentile : float
        The brightest channel of the lit pixels of all pictures at this percentile becomes 1. Where nothing shines, 1
        is what a grating would send whose first order goes to the camera, and there is a warning.

    Returns
    -------
    PictureSeries
        Linear sRGB of shape (lights, rows, columns, 3), or (1, rows, columns, 3) with all lights together.

    Raises
    ------
    InputError
        The maps differ in shape, or the pictures are too many and too large.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, equation 2 and section 6.1; Stam 1999.
    """
    sheet = sheet_of(orientation, period, bumps, width_mm=width_mm, tiles=tiles)
    caption = "Rendered from maps of orientation and period" + offset_note(orientation)
    lighting = Lighting(
        lights_mm=_carried_around(lights_mm[0], orbit) if orbit else np.asarray(lights_mm, dtype=np.float64),
        camera_mm=np.asarray(camera_mm, dtype=np.float64),
        light_sigma_mm=light_sigma_mm,
        illuminant=illuminant,
        depth_um=depth_um,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
        orders=orders,
        refractive_index=refractive_index,
    )
    if view == "rectified":
        seen = rectified_view(sheet, lighting.camera_mm, size_px, most_px=_ANIMATED_PX if orbit else None)
    else:
        size = size_px or ((_ANIMATED_PX, _ANIMATED_PX * 3 // 4) if orbit else None)
        seen = camera_view(sheet, lighting.camera_mm, target_mm, up, field_of_view_deg, size)
    count = 1 if together else len(lighting.lights_mm)
    check_size(count, seen)
    rgb = render_sheet(
        sheet,
        seen,
        lighting,
        evaluator=evaluator,
        sampling=automatic_sampling(sheet, seen, lighting, samples=samples, tolerance=tolerance)
        if anti_aliased
        else POINTS,
        tolerance=tolerance,
        precision=precision,
        together=together,
    )
    return PictureSeries(
        rgb=rgb / (white_level(rgb, white_percentile) if _lit(rgb, sheet, lighting) else _shining(lighting)),
        light_mm=lighting.lights_mm,
        camera_mm=lighting.camera_mm,
        pixel_mm=float(seen.homography[0, 0]) if view == "rectified" else None,
        caption=caption,
        together=together,
        frames_per_second=_FRAMES_PER_SECOND if orbit else None,
    )


def _lit(rgb: NDArray[np.float32], sheet: Sheet, lighting: Lighting) -> bool:
    """Whether pictures show anything but the last tails of lobes, which brightened would be noise."""
    if rgb.max() > _NOTHING * _shining(lighting):
        return True
    if np.isfinite(sheet.period_um).any():
        _log.warning(
            "Nothing shines here: no grating sends light of lights_mm to camera_mm, and the pictures are black. A "
            "grating shows its first order, green at 0.55 um, where light and camera lie (0.55 um / period) x distance "
            "apart along its orientation."
        )
    return False


def _shining(lighting: Lighting) -> float:
    """Least radiance, under any of the lights, of a grating whose first order goes to the camera."""
    distance = np.linalg.norm(lighting.lights_mm, axis=1)
    window = float(window_spread(_MIDDLE_UM, lighting.coherence_um)) ** 2
    light = (lighting.light_sigma_mm / distance.min()) ** 2
    share = float(order_efficiency(1, 4 * np.pi * lighting.depth_um / _MIDDLE_UM))
    return share * window / (window + float(light))


def _carried_around(light_mm: list[float], steps: int) -> NDArray[np.float64]:
    angle = 2 * np.pi * np.arange(steps) / steps
    x, y, z = light_mm
    around = [x * np.cos(angle) - y * np.sin(angle), x * np.sin(angle) + y * np.cos(angle), np.full(steps, z)]
    return np.stack(around, axis=1)


def _check_point_light(
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float],
    light_sigma_mm: float,
    coherence_um: float,
    wavelength_step_nm: float,
    depth_um: float,
    width_mm: float,
    tiles: list[int],
    target_mm: list[float],
    up: list[float],
    field_of_view_deg: float | None,
    size_px: list[int] | None,
    refractive_index: float | None,
    samples: int | None,
    tolerance: float,
    together: bool,
    orbit: int | None,
    white_percentile: float,
    **_: object,
) -> None:
    """Refuse impossible places and sizes before anything runs."""
    refuse(
        zero_or_more(depth_um=depth_um),
        above_zero(width_mm=width_mm),
        above_zero_up_to(100, white_percentile=white_percentile),
        within(1e-4, 0.5, tolerance=tolerance),
        [] if refractive_index is None else at_least(1.01, "denser than air", refractive_index=refractive_index),
        within(1, MOST_SAMPLES, samples=samples),
        within(2, _LONGEST_ORBIT, orbit=orbit),
        _unmovable(len(lights_mm), together) if orbit else [],
        above_zero_up_to(WIDEST_VIEW_DEG, field_of_view_deg=field_of_view_deg),
        unusable_counts("tiles", tiles, "[columns, rows] of tiles"),
        [] if size_px is None else unusable_counts("size_px", size_px, "[columns, rows] in pixels"),
    )
    check_lighting(
        lights_mm=lights_mm,
        camera_mm=camera_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
    )
    refuse(blind_camera(camera_mm, target_mm, up))


def _unmovable(lights: int, together: bool) -> list[InputError]:
    if lights == 1 and not together:
        return []
    return [
        InputError(
            "an orbit carries one light around",
            where="orbit",
            expected="a single place in lights_mm, and together: false",
        )
    ]
