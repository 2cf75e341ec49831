"""Every repeat of a tile under every place of the flash, with the half vectors there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.flash_maps import Highlights
from pipeline.errors import InputError
from pipeline.optics.flash.lobes import HalfVectors, half_vectors, light_above, light_variance, point_variance
from pipeline.parallel import over_rows

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

BLOCK = 8
"""Rows of the tile that are gathered at once."""
_NEAR, _LEAK, _BRIGHT = 3, 0.2, 0.02
"""A pixel less than so bright as one within a square of so many pixels may show that one's light, spread by the lens.

Neighbours below the last, relative to the brightest, spread none that counts.
"""
WHITE_UM = 0.55
"""Wavelength for which a lobe's width is worked out where no filter says another."""


@dataclass(frozen=True, eq=False)
class Bench:
    """Where light and camera stood, and how wide lobes are.

    Attributes
    ----------
    light_mm : ndarray of shape (L, 3)
        Places of the flash.
    eye_mm : ndarray of shape (3,)
        Place of the camera.
    highlight_mm : ndarray of shape (L, 2)
        Middle of each highlight.
    keep_off_mm : ndarray of shape (L,)
        Radius of the highlight within which nothing is read.
    light_sigma_mm, coherence_um, wavelength_um : float
        What lobes are made wide by.
    """

    light_mm: Float64Array
    eye_mm: Float64Array
    highlight_mm: Float64Array
    keep_off_mm: Float64Array
    light_sigma_mm: float
    coherence_um: float
    wavelength_um: float


@dataclass(frozen=True, eq=False)
class Views:
    """Some rows of a tile as its repeats show them; arrays of shape (O, rows, columns), float32.

    Attributes
    ----------
    brightness : ndarray
        Mean of red, green and blue; NaN in a highlight, beside the sheet, and where no exposure was right.
    half : HalfVectors
        At each place.
    spread : ndarray
        Standard deviation of a lobe across the tangent, in half vectors.
    rest : ndarray
        Its variance for a light without extent.
    """

    brightness: Float32Array
    half: HalfVectors
    spread: Float64Array
    rest: Float64Array

    @property
    def azimuth(self) -> Float32Array:
        """Direction of the half vectors."""
        return self.half.azimuth_rad.astype(np.float32)

    @property
    def width(self) -> Float32Array:
        """Standard deviation of a lobe as an angle at the highlight."""
        return np.minimum(self.spread / np.maximum(self.half.length, 1e-9), np.pi / 4).astype(np.float32)


def bench(
    photos: FlashPhotographs,
    highlights: Highlights,
    *,
    light_distance_mm: float | None,
    camera_distance_mm: float | None,
    light_sigma_mm: float | None,
    coherence_um: float,
    keep_off: float,
) -> Bench:
    """Places as stated; what is not known of them follows from the highlight and the distances.

    Raises
    ------
    InputError
        A distance is not known, or a photograph's highlight neither seen nor stated.
    """
    eye = np.array(photos.camera_mm, np.float64)
    if not np.isfinite(eye).all():
        if camera_distance_mm is None:
            raise InputError(
                "the camera's place is not known", where="camera_distance_mm", expected="its distance from the sheet"
            )
        eye = np.array([0.0, 0.0, camera_distance_mm])
    lights = np.array(photos.light_mm, np.float64)
    seen = np.where(np.isfinite(highlights.stated_mm), highlights.stated_mm, highlights.place_mm)
    for index, light in enumerate(lights):
        if np.isfinite(light).all():
            continue
        height = light[2] if np.isfinite(light[2]) else light_distance_mm
        if height is None:
            raise InputError(
                f"the place of flash {index} is not known",
                where="light_distance_mm",
                expected="its distance from the sheet",
            )
        if not np.isfinite(seen[index]).all():
            raise InputError(
                f"neither the highlight of photograph {index} nor its flash's place is known",
                expected="a photograph that shows the highlight",
            )
        lights[index] = light_above(seen[index], height, eye)
    sigma = light_sigma_mm or photos.light_sigma_mm or highlights.light_sigma_mm or 0.0
    wavelength = (photos.wavelength_nm or 1000 * WHITE_UM) / 1000
    partial = Bench(lights, eye, seen, np.zeros(len(lights)), sigma, coherence_um, wavelength)
    radii = [keep_off * _highlight(partial, index, photos.pixel_mm or 0.0)[1] for index in range(len(lights))]
    return replace(partial, keep_off_mm=np.array(radii))


def over_blocks(photos: FlashPhotographs, tiles: Tiles, placed: Bench, read: Callable[[Views, slice], None]) -> None:
    """Call ``read(views, rows)`` for a few rows of the tile after another, on as many cores as are free."""
    pixel = tiles.pixel_mm
    shown = [radiance.mean(axis=-1, dtype=np.float32) for radiance in photos.radiance]
    read_off = [_readable(brightness, valid) for brightness, valid in zip(shown, photos.valid, strict=True)]
    rows, columns = photos.valid.shape[1:]

    def gather(first: int, last: int) -> None:
        r, c = np.mgrid[first:last, : tiles.shape[1]].astype(np.float64)
        place = np.stack([c, r, np.ones_like(c)])
        on_sheet = np.einsum("tij,jrc->tirc", tiles.homographies, place)
        column, row = on_sheet[:, 0] / on_sheet[:, 2], on_sheet[:, 1] / on_sheet[:, 2]
        x, y = (column - (columns - 1) / 2) * pixel, ((rows - 1) / 2 - row) * pixel
        parts: list[HalfVectors] = []
        brightness = np.empty((len(shown), *column.shape), np.float32)
        for index, photograph in enumerate(shown):
            for tile in range(len(column)):
                brightness[index, tile] = _sampled(photograph, read_off[index], column[tile], row[tile])
            away = np.hypot(x - placed.highlight_mm[index, 0], y - placed.highlight_mm[index, 1])
            brightness[index][away < placed.keep_off_mm[index]] = np.nan
            parts.append(half_vectors(x, y, placed.light_mm[index], placed.eye_mm))
        half = HalfVectors(
            *(np.concatenate([getattr(part, name) for part in parts]) for name in HalfVectors.__dataclass_fields__)
        )
        rest = _rest(half, placed, pixel)
        spread = np.sqrt(rest + light_variance(half, placed.light_sigma_mm))
        read(Views(brightness.reshape(-1, *r.shape), half, spread, rest), slice(first, last))

    over_rows(gather, tiles.shape[0], tile=BLOCK)


def _sampled(
    photograph: Float32Array, readable: NDArray[np.bool_], column: Float64Array, row: Float64Array
) -> Float32Array:
    """Brightness between pixels; NaN where the nearest one cannot be read, and beside the picture."""
    at = column.astype(np.float32), row.astype(np.float32)
    known = cv2.remap(readable.astype(np.uint8), *at, cv2.INTER_NEAREST, borderValue=0)
    return np.where(known > 0, cv2.remap(photograph, *at, cv2.INTER_LINEAR), np.float32(np.nan))


def _readable(brightness: Float32Array, valid: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Where an exposure was right, and what is seen is not likely to be a bright neighbour's light."""
    around = cv2.dilate(np.where(valid, brightness, 0), np.ones((_NEAR, _NEAR), np.uint8))
    lit = around > _BRIGHT * np.percentile(around, 99.5)
    return np.asarray(valid & ~(lit & (brightness < _LEAK * around)))


def _rest(half: HalfVectors, placed: Bench, pixel_mm: float) -> Float64Array:
    return point_variance(half, coherence_um=placed.coherence_um, wavelength_um=placed.wavelength_um, pixel_mm=pixel_mm)


def spread_at_highlight(placed: Bench, pixel_mm: float) -> float:
    """Standard deviation of lobes in half vectors, where the highlights are; the mean of the photographs."""
    return float(np.mean([_highlight(placed, index, pixel_mm)[0] for index in range(len(placed.light_mm))]))


def _highlight(placed: Bench, index: int, pixel_mm: float) -> tuple[float, float]:
    """Standard deviation of a highlight in half vectors, and in mm on the sheet."""
    half = half_vectors(
        placed.highlight_mm[index, 0], placed.highlight_mm[index, 1], placed.light_mm[index], placed.eye_mm
    )
    spread = float(np.sqrt(_rest(half, placed, pixel_mm) + light_variance(half, placed.light_sigma_mm)))
    return spread, spread / float(1 / half.light_mm + 1 / half.eye_mm)


def unordered(shortest_um: float, longest_um: float) -> list[InputError]:
    """What is wrong with periods to look between."""
    if shortest_um < longest_um:
        return []
    what = f"shortest_um {shortest_um:g} is not below longest_um {longest_um:g}"
    return [InputError(what, where="shortest_um, longest_um", expected="the shortest below the longest")]
