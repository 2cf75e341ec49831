"""A virtual light over a virtual sheet: the reference's row loop on as many cores as are free."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, within, zero_or_more
from pipeline.optics.colour import Spectrum
from pipeline.optics.gratings import Form, window_spread
from pipeline.optics.sheet.extent import extent
from pipeline.optics.sheet.spectral import aliasing, shade_rows, spectral_table
from pipeline.optics.sheet.view import View, rectified
from pipeline.parallel import over_rows
from pipeline.progress import advance

Image = NDArray[np.float32]

WAVELENGTH_STEPS_NM = (0.1, 100.0)
"""Finer than any table of spectra; a handful of steps in the visible range."""

_TOLERATED_ALIASING = 0.01
_SHORT_WAVE_UM = 0.45

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Lighting:
    """A light carried from place to place above a sheet, and the camera that watches.

    Attributes
    ----------
    lights_mm : ndarray of shape (L, 3), float64
        Places of the light: x right, y up, z towards the camera, origin at the centre of the sheet.
    camera_mm : ndarray of shape (3,), float64
        Place of the camera.
    light_sigma_mm : float
        Standard deviation of the light's Gaussian extent.
    illuminant : str
        Spectrum of the light.
    depth_um, coherence_um : float
        Peak-to-valley depth of the gratings, and width of the coherence window.
    wavelength_step_nm : float
        Step of the spectral sum.
    orders : {"exact", "second order"}
        Form of the order efficiencies.
    refractive_index : float or None
        For Schlick's reflectance relative to that at normal incidence; None for a mirror's, the same at all angles.
    band_nm : tuple of float, or None
        Centre and full width at half maximum of a filter before the camera; None without one.
    """

    lights_mm: NDArray[np.float64]
    camera_mm: NDArray[np.float64]
    light_sigma_mm: float
    illuminant: Spectrum
    depth_um: float
    coherence_um: float
    wavelength_step_nm: float
    orders: Form = "exact"
    refractive_index: float | None = None
    band_nm: tuple[float, float] | None = None

    @property
    def normal_reflectance(self) -> float:
        """At normal incidence."""
        index = self.refractive_index
        return 1.0 if index is None else ((index - 1) / (index + 1)) ** 2


def check_lighting(
    *,
    lights_mm: Sequence[Sequence[float]],
    camera_mm: Sequence[float],
    light_sigma_mm: float,
    coherence_um: float,
    wavelength_step_nm: float,
) -> None:
    """Refuse places behind the sheet, and sizes that nothing can have.

    Raises
    ------
    InputError, InputErrors
        What is wrong, and under which setting.
    """
    problems: list[InputError] = []
    if not lights_mm:
        problems.append(InputError("there is no light", where="lights_mm", expected="at least one place [x, y, z]"))
    places = {f"lights_mm[{index}]": light for index, light in enumerate(lights_mm)} | {"camera_mm": camera_mm}
    for where, place in places.items():
        if len(place) != 3 or not np.isfinite(place).all() or place[2] <= 0:
            problems.append(
                InputError(f"{list(place)} is no place", where=where, expected="[x, y, z] in mm, z above the sheet's 0")
            )
    refuse(
        problems,
        zero_or_more(light_sigma_mm=light_sigma_mm),
        above_zero(coherence_um=coherence_um),
        within(*WAVELENGTH_STEPS_NM, wavelength_step_nm=wavelength_step_nm),
    )


def render_supersampled(
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    lighting: Lighting,
    *,
    pixel_mm: float,
    ratio: int,
) -> Iterator[Image]:
    """What a sheet sends to the camera under each light, with the fine pixels worked out only where facets meet.

    A block of ``ratio`` x ``ratio`` fine pixels on one facet is lit as its centre is: across a few micrometres, the
    directions to light and camera hardly change.

    Parameters
    ----------
    orientation_rad, period_um : ndarray of shape (M, N)
        The maps; NaN stays dark. Their sides are multiples of ``ratio``.
    lighting : Lighting
        Light and camera.
    pixel_mm : float
        Pitch of the maps.
    ratio : int
        Odd side of a block.
    """
    warn_of_aliasing(period_um, lighting)
    uniform = _uniform_blocks(orientation_rad, ratio) & _uniform_blocks(period_um, ratio)
    centre = slice(ratio // 2, None, ratio)
    blocks = np.where(uniform, orientation_rad[centre, centre], np.nan)
    seams = np.where(_spread(uniform, ratio), np.nan, orientation_rad)
    fine = rectified(seams.shape[0], seams.shape[1], pixel_mm, lighting.camera_mm)
    rough = rectified(blocks.shape[0], blocks.shape[1], pixel_mm * ratio, lighting.camera_mm)
    for index, light in enumerate(lighting.lights_mm):
        coarse = np.zeros((*blocks.shape, 3), np.float32)
        add_light(coarse, blocks, period_um[centre, centre], rough, light, lighting)
        picture = _spread(coarse, ratio)
        add_light(picture, seams, period_um, fine, light, lighting)
        yield picture
        advance(index + 1, len(lighting.lights_mm))


def white_level(rgb: Image, percentile: float) -> np.float32:
    """The brightest channel at a percentile of the pixels that are lit in any picture; 1 where none is."""
    brightest = rgb.max(axis=-1)
    lit = brightest[brightest > 0.01 * brightest.max(initial=0.0)]
    return np.float32(np.percentile(lit, percentile)) if lit.size else np.float32(1)


def add_light(
    picture: Image,
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    view: View,
    light_mm: NDArray[np.float64],
    lighting: Lighting,
    *,
    slopes: Image | None = None,
    pixel_part: float = 0.0,
) -> None:
    """Add what a view gets from the sheet under one light, by the spectral sum in double precision.

    Parameters
    ----------
    picture : ndarray of shape (M, N, 3), float32
        Linear sRGB, relative.
    orientation_rad, period_um, slopes, pixel_part
        As of :func:`pipeline.optics.sheet.spectral.shade_rows`.
    """
    if not np.isfinite(period_um).any():
        return
    table = spectral_table(
        light=lighting.illuminant,
        wavelength_step_nm=lighting.wavelength_step_nm,
        coherence_um=lighting.coherence_um,
        depth_um=lighting.depth_um,
        longest_period_um=float(np.nanmax(period_um)),
        largest_half_vector=extent(view, light_mm, lighting.light_sigma_mm, slopes).across,
        orders=lighting.orders,
        normal_reflectance=lighting.normal_reflectance,
        band_nm=lighting.band_nm,
    )

    orientation, period = _for_kernel(orientation_rad), _for_kernel(period_um)

    def shade(first: int, last: int) -> None:
        shade_rows(
            picture,
            (first, last),
            orientation,
            period,
            view=view,
            light_mm=light_mm,
            light_sigma_mm=lighting.light_sigma_mm,
            table=table,
            slopes=slopes,
            pixel_part=pixel_part,
        )

    over_rows(shade, view.rows)


def warn_of_aliasing(period_um: NDArray[np.floating], lighting: Lighting) -> None:
    """Say so where the spectral step is too coarse for the narrowest lobes, which would turn rainbows into stripes."""
    if lighting.band_nm is not None or not np.isfinite(period_um).any():
        return
    distance = np.linalg.norm(lighting.lights_mm, axis=1)
    foreshortened = float((lighting.lights_mm[:, 2] / distance**2).min())
    window = float(window_spread(_SHORT_WAVE_UM, lighting.coherence_um))
    spread = float(np.hypot(window, lighting.light_sigma_mm * foreshortened))
    step, shortest = lighting.wavelength_step_nm, float(np.nanmin(period_um))
    error = aliasing(step, shortest, spread)
    if error > _TOLERATED_ALIASING:
        while aliasing(step, shortest, spread) > _TOLERATED_ALIASING:
            step /= 2
        log.warning(
            "wavelength_step_nm %g is too coarse for lobes this narrow: colours may be wrong by %.0f percent; %g is "
            "fine enough",
            lighting.wavelength_step_nm,
            100 * error,
            max(step, WAVELENGTH_STEPS_NM[0]),
        )


def _for_kernel(values: NDArray[np.floating]) -> Image:
    """Contiguous, float32 and read-only, so that memory maps, slices and arrays share one compiled kernel."""
    rows = np.ascontiguousarray(values, np.float32).view()
    rows.setflags(write=False)
    return rows


def _uniform_blocks(values: NDArray[np.floating], ratio: int) -> NDArray[np.bool_]:
    rows, columns = values.shape
    blocks = values.reshape(rows // ratio, ratio, columns // ratio, ratio)
    first = blocks[:, :1, :, :1]
    same = (blocks == first) | (np.isnan(blocks) & np.isnan(first))
    return np.asarray(same.all(axis=(1, 3)))


def _spread(blocks: NDArray[Any], ratio: int) -> NDArray[Any]:
    return np.repeat(np.repeat(blocks, ratio, axis=0), ratio, axis=1)
