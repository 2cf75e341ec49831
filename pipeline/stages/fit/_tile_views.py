"""Every repeat of a tile under every place of the flash, with the half vectors there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

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
    """Some rows of a tile as its repeats show them; arrays of shape (O, rows, columns).

    What geometry makes of them is worked out when it is asked for.

    Attributes
    ----------
    brightness : ndarray, float32
        Mean of red, green and blue; NaN in a highlight, beside the sheet, and where no exposure was right.
    x_mm, y_mm : ndarray of shape (T, rows, columns)
        Where the repeats lie on the sheet; those of one photograph follow those of another.
    placed : Bench
        Light and camera.
    pixel_mm : float
        Pitch.
    """

    brightness: Float32Array
    x_mm: Float64Array
    y_mm: Float64Array
    placed: Bench
    pixel_mm: float

    @cached_property
    def half(self) -> HalfVectors:
        """At each place."""
        lights = self.placed.light_mm.T[:, :, None, None, None]
        every = half_vectors(self.x_mm, self.y_mm, lights, self.placed.eye_mm)
        whole, shape = (len(self.placed.light_mm), *self.x_mm.shape), self.brightness.shape
        parts = (getattr(every, name) for name in HalfVectors.__dataclass_fields__)
        return HalfVectors(*(np.broadcast_to(part, whole).reshape(shape) for part in parts))

    @cached_property
    def spread(self) -> Float64Array:
        """Standard deviation of a lobe across the tangent, in half vectors."""
        return np.sqrt(self.rest + light_variance(self.half, self.placed.light_sigma_mm))

    @cached_property
    def rest(self) -> Float64Array:
        """Its variance for a light without extent."""
        return _rest(self.half, self.placed, self.pixel_mm)

    @cached_property
    def length(self) -> Float32Array:
        """Of the half vectors' part in the plane."""
        return self.half.length.astype(np.float32)

    @cached_property
    def gain(self) -> Float32Array:
        """What geometry makes of an order's share of the light; a lobe that is wider is less bright."""
        return (self.half.gain / self.spread).astype(np.float32)

    @cached_property
    def azimuth(self) -> Float32Array:
        """Direction of the half vectors."""
        return self.half.azimuth_rad.astype(np.float32)

    @cached_property
    def width(self) -> Float32Array:
        """Standard deviation of a lobe as an angle at the highlight."""
        return np.minimum(self.spread / np.maximum(self.length, np.float32(1e-9)), np.pi / 4).astype(np.float32)


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
        The photographs are not rectified, the highlights are of others, a distance is not known, a light or the camera
        not above the sheet, or a photograph's highlight neither seen nor stated.
    """
    if photos.pixel_mm is None:
        raise InputError("the photographs are not rectified", expected="align.rectified")
    if len(highlights.place_mm) != len(photos.radiance):
        raise InputError(
            f"{len(highlights.place_mm)} highlights are not of {len(photos.radiance)} photographs",
            where="highlights",
            expected="those of the same photographs",
        )
    eye = np.array(photos.camera_mm, np.float64)
    if not np.isfinite(eye).all():
        if camera_distance_mm is None:
            raise InputError(
                "the camera's place is not known",
                where="camera_distance_mm",
                expected="its distance from the sheet, or camera_mm in capture.yaml",
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
                f"the place of flash {index + 1} is not known",
                where="light_distance_mm",
                expected="its distance from the sheet, or lights_mm in capture.yaml",
            )
        if not np.isfinite(seen[index]).all():
            raise InputError(
                f"neither the highlight of flash {index + 1} nor its place is known",
                expected="a photograph that shows the highlight",
            )
        lights[index] = light_above(seen[index], height, eye)
    below = np.flatnonzero(np.append(lights[:, 2], eye[2]) <= 0)
    if below.size:
        place = [*lights, eye][below[0]].tolist()
        who = f"flash {below[0]}" if below[0] < len(lights) else "the camera"
        raise InputError(f"{who} at {place} mm is not above the sheet", expected="[x, y, z], z towards the camera")
    sigma = light_sigma_mm or photos.light_sigma_mm or highlights.light_sigma_mm or 0.0
    wavelength = (photos.wavelength_nm or 1000 * WHITE_UM) / 1000
    partial = Bench(lights, eye, seen, np.zeros(len(lights)), sigma, coherence_um, wavelength)
    radii = [keep_off * _highlight(partial, index, photos.pixel_mm)[1] for index in range(len(lights))]
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
        brightness = np.empty((len(shown), *column.shape), np.float32)
        for index, photograph in enumerate(shown):
            brightness[index] = _sampled(photograph, read_off[index], column, row)
            away = (x - placed.highlight_mm[index, 0]) ** 2 + (y - placed.highlight_mm[index, 1]) ** 2
            brightness[index][away < placed.keep_off_mm[index] ** 2] = np.nan
        read(Views(brightness.reshape(-1, *r.shape), x, y, placed, pixel), slice(first, last))

    over_rows(gather, tiles.shape[0], tile=BLOCK)


def _sampled(
    photograph: Float32Array, readable: NDArray[np.uint8], column: Float64Array, row: Float64Array
) -> Float32Array:
    """Brightness between pixels; NaN where the nearest one cannot be read, and beside the picture."""
    long = -1, column.shape[-1]
    at = column.reshape(long).astype(np.float32), row.reshape(long).astype(np.float32)
    known = cv2.remap(readable, *at, cv2.INTER_NEAREST, borderValue=0)
    seen = np.where(known > 0, cv2.remap(photograph, *at, cv2.INTER_LINEAR), np.float32(np.nan))
    return seen.reshape(column.shape)


def _readable(brightness: Float32Array, valid: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """1 where an exposure was right, and what is seen is not likely to be a bright neighbour's light."""
    around = cv2.dilate(np.where(valid, brightness, 0), np.ones((_NEAR, _NEAR), np.uint8))
    lit = around > _BRIGHT * np.percentile(around, 99.5)
    return np.asarray(valid & ~(lit & (brightness < _LEAK * around)), np.uint8)


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


def unordered(shortest_um: float, longest_um: float, *, least_ratio: float = 1.0) -> list[InputError]:
    """What is wrong with periods to look between, the longest more than ``least_ratio`` times the shortest."""
    if least_ratio * shortest_um < longest_um:
        return []
    apart = "" if least_ratio == 1 else f" {least_ratio:g} times"
    what = f"shortest_um {shortest_um:g} is not{apart} below longest_um {longest_um:g}"
    return [InputError(what, where="shortest_um, longest_um", expected=f"the shortest{apart} below the longest")]
