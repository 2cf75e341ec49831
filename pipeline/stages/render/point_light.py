"""A holographic sheet under a small light, from its maps of orientation and period."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.pictures import PictureSeries
from pipeline.devices.virtual_light import Lighting, check_lighting, render_sheet, white_level
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse, zero_or_more

_log = logging.getLogger(__name__)

# Lobes are steep: orientations that differed by 1.2e-6 rad were seen to change a pixel by 2.6e-5 of white.
_tolerance_point_light = {"rgb": 5e-4}

_OFFSET_UNKNOWN = "Orientations are known up to one offset: facets may shine under other lights than here"


def point_light(
    orientation: OrientationMap,
    period: PeriodMap,
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float] = [0.0, 0.0, 500.0],  # noqa: B006 - read from the syntax tree, never modified
    light_sigma_mm: float = 12.0,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "D65",
    depth_um: float = 0.12,
    coherence_um: float = 65.0,
    width_mm: float = 15.0,
    wavelength_step_nm: float = 5.0,
    orders: Literal["exact", "second order"] = "exact",
    white_percentile: float = 99.5,
) -> PictureSeries:
    """Render a sheet under a light that is carried around it.

    Each pixel's light is summed over wavelengths and over all diffraction orders that can reach the camera, each order
    as wide as the coherence window and the light's extent make it. Orientations that are known only up to one offset
    make facets shine under the wrong lights: there is a warning, and the caption says so.

    Parameters
    ----------
    orientation, period : OrientationMap, PeriodMap
        Maps of the same shape (M, N).
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
        Width of the sheet where the maps do not know their pixel pitch.
    wavelength_step_nm : float
        Step of the spectral sum.
    orders : {"exact", "second order"}
        Efficiency of the orders by Bessel functions, for any depth, or expanded to second order as in the paper.
    white_percentile : float
        The brightest channel of the lit pixels of all pictures at this percentile becomes 1.

    Returns
    -------
    PictureSeries
        Linear sRGB of shape (lights, M, N, 3).

    Raises
    ------
    InputError
        The maps differ in shape.

    Notes
    -----
    Toisoul, Dhillon and Ghosh 2018, equation 2 and section 6.1; Stam 1999.
    """
    if orientation.orientation_rad.shape != period.period_um.shape:
        raise InputError("the maps of orientation and period differ in shape")
    caption = "Rendered: the measured maps under the same light"
    if not orientation.absolute:
        caption += f". {_OFFSET_UNKNOWN}"
        _log.warning(
            "%s. fit.offset makes them absolute, from photographs under a torch or from known_deg", _OFFSET_UNKNOWN
        )
    pixel_mm = orientation.pixel_mm or period.pixel_mm
    if pixel_mm is None:
        pixel_mm = width_mm / orientation.orientation_rad.shape[1]
        _log.warning(
            "the pixel pitch is not known: the sheet is rendered as %g mm wide; rig.pixel_mm or pixel_mm in "
            "capture.yaml state it",
            width_mm,
        )
    lighting = Lighting(
        lights_mm=np.asarray(lights_mm, dtype=np.float64),
        camera_mm=np.asarray(camera_mm, dtype=np.float64),
        light_sigma_mm=light_sigma_mm,
        illuminant=illuminant,
        depth_um=depth_um,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
        orders=orders,
    )
    rgb = render_sheet(orientation.orientation_rad, period.period_um, lighting, pixel_mm=pixel_mm)
    return PictureSeries(
        rgb=rgb / white_level(rgb, white_percentile),
        light_mm=lighting.lights_mm,
        camera_mm=lighting.camera_mm,
        pixel_mm=pixel_mm,
        caption=caption,
    )


def _check_point_light(
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float],
    light_sigma_mm: float,
    coherence_um: float,
    wavelength_step_nm: float,
    depth_um: float,
    width_mm: float,
    white_percentile: float,
    **_: object,
) -> None:
    """Refuse impossible places and sizes before anything runs."""
    refuse(
        zero_or_more(depth_um=depth_um),
        above_zero(width_mm=width_mm),
        above_zero_up_to(100, white_percentile=white_percentile),
    )
    check_lighting(
        lights_mm=lights_mm,
        camera_mm=camera_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
    )
