"""A virtual light over a virtual sheet: the row loop of :mod:`pipeline.optics.sheet` on as many cores as are free."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import Spectrum
from pipeline.optics.sheet import largest_half_vector, shade_rows, spectral_table
from pipeline.parallel import over_rows
from pipeline.progress import advance


def render_sheet(
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    *,
    pixel_mm: float,
    lights_mm: NDArray[np.float64],
    camera_mm: NDArray[np.float64],
    light_sigma_mm: float,
    illuminant: Spectrum,
    depth_um: float,
    coherence_um: float,
    wavelength_step_nm: float,
) -> NDArray[np.float32]:
    """Relative radiance of a sheet under each of several lights, linear sRGB of shape (lights, M, N, 3).

    Parameters are those of :func:`pipeline.stages.render.point_light.point_light`, the maps as arrays of shape (M, N).
    """
    rows, columns = orientation_rad.shape
    rgb = np.zeros((len(lights_mm), rows, columns, 3), np.float32)
    if not np.isfinite(period_um).any():
        return rgb
    half_width = max(rows, columns) * pixel_mm / 2
    for index, light in enumerate(lights_mm):
        table = spectral_table(
            light=illuminant,
            wavelength_step_nm=wavelength_step_nm,
            coherence_um=coherence_um,
            depth_um=depth_um,
            longest_period_um=float(np.nanmax(period_um)),
            largest_half_vector=largest_half_vector(light, camera_mm, half_width),
        )
        picture = rgb[index]

        def shade(first: int, last: int, light=light, table=table, picture=picture) -> None:  # type: ignore[no-untyped-def]
            shade_rows(
                picture,
                (first, last),
                orientation_rad,
                period_um,
                pixel_mm=pixel_mm,
                light_mm=light,
                camera_mm=camera_mm,
                light_sigma_mm=light_sigma_mm,
                table=table,
            )

        over_rows(shade, rows)
        advance(index + 1, len(lights_mm))
    return rgb


def render_supersampled(
    orientation_rad: NDArray[np.floating],
    period_um: NDArray[np.floating],
    *,
    pixel_mm: float,
    ratio: int,
    **settings: Any,
) -> NDArray[np.float32]:
    """The same as :func:`render_sheet`, with the fine pixels worked out only where facets meet.

    A block of ``ratio`` x ``ratio`` fine pixels on one facet is lit as its centre is: across a few micrometres, the
    directions to light and camera hardly change.

    Parameters
    ----------
    ratio : int
        Odd side of a block; the maps' sides are multiples of it.
    """
    uniform = _uniform_blocks(orientation_rad, ratio) & _uniform_blocks(period_um, ratio)
    centre = slice(ratio // 2, None, ratio)
    centres = np.where(uniform, orientation_rad[centre, centre], np.nan)
    coarse = render_sheet(centres, period_um[centre, centre], pixel_mm=pixel_mm * ratio, **settings)
    seams = np.where(_spread(uniform, ratio), np.nan, orientation_rad)
    fine = render_sheet(seams, period_um, pixel_mm=pixel_mm, **settings)
    for index, blocks in enumerate(coarse):
        fine[index] += _spread(blocks, ratio)
    return fine


def _uniform_blocks(values: NDArray[np.floating], ratio: int) -> NDArray[np.bool_]:
    rows, columns = values.shape
    blocks = values.reshape(rows // ratio, ratio, columns // ratio, ratio)
    first = blocks[:, :1, :, :1]
    same = (blocks == first) | (np.isnan(blocks) & np.isnan(first))
    return np.asarray(same.all(axis=(1, 3)))


def _spread(blocks: NDArray[Any], ratio: int) -> NDArray[Any]:
    return np.repeat(np.repeat(blocks, ratio, axis=0), ratio, axis=1)


def white_level(rgb: NDArray[np.float32], percentile: float) -> np.float32:
    """The brightest channel at a percentile of the pixels that are lit in any picture; 1 where none is."""
    brightest = rgb.max(axis=-1)
    lit = brightest[brightest > 0.01 * brightest.max(initial=0.0)]
    return np.float32(np.percentile(lit, percentile)) if lit.size else np.float32(1)
