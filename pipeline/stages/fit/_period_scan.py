"""A tile's views under flashes, read for periods: scanned pixel by pixel, and sampled for what all of them share."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.gratings import OrientationMap
from pipeline.errors import InputError
from pipeline.optics.flash.common_fit import Common, Sample, common_fit
from pipeline.optics.flash.periods import ACROSS, Orders, best_periods
from pipeline.stages.fit._tile_views import Bench, Views, over_blocks

Array = NDArray[np.floating]

_SAMPLE = 20_000
"""Views from which common figures are fitted."""
_ACROSS = 2.0
_SMOOTH_RAD = float(np.deg2rad(6))
"""Turn from a pixel to its neighbours above which it may hold two gratings, and tells nothing of what all share."""
_FEW_SMOOTH = 0.1


@dataclass(frozen=True, eq=False)
class Scan:
    """The views of a tile, read again for each model of their lobes."""

    photos: FlashPhotographs
    tiles: Tiles
    placed: Bench
    orientation: OrientationMap
    periods: NDArray[np.float64]

    def of(self, orders: Orders, placed: Bench) -> NDArray[np.float64]:
        """Periods and standard errors, shape (3, 2, M, N): of all views and of either half."""
        found = np.full((3, 2, *self.tiles.shape), np.nan)
        photographs, tiles = len(self.photos.radiance), len(self.tiles.homographies)
        halves = np.add.outer(np.arange(photographs), np.arange(tiles)).ravel() % 2
        wide = replace(placed, keep_off_mm=self.placed.keep_off_mm)

        def read(views: Views, rows: slice) -> None:
            u, v, light = along(views, self.orientation.orientation_rad[rows])
            variance = (placed.light_sigma_mm * light) ** 2 + views.rest
            near = v**2 < ACROSS**2 * variance[1]
            shares = np.zeros((3, *near.shape))
            shares[:, near] = views.half.gain[near] * orders.shares(views.half.w[near])
            best_periods(
                views.brightness,
                u,
                v,
                variance,
                shares,
                halves,
                self.periods,
                orders.wavelength_um,
                orders.band_um,
                found[:, :, rows],
            )

        over_blocks(self.photos, self.tiles, wide, read)
        return found

    def common(self, period_um: Array, orders: Orders) -> tuple[Common, Common]:
        """What all lobes share: with one period, and with those that were found.

        Raises
        ------
        InputError
            No period was found.
        """
        known = period_um[np.isfinite(period_um)]
        if not known.size:
            raise InputError(
                "no pixel is bright where an order would be",
                where="shortest_um, longest_um",
                expected="a range that holds the sheet's periods, and photographs with a filter before the camera",
            )
        start = {"period_um": float(np.median(known)), "light_sigma_mm": self.placed.light_sigma_mm or 1.0}
        return common_fit(self.sample(None), orders, **start), common_fit(self.sample(period_um), orders, **start)

    def sample(self, period_um: Array | None) -> Sample:
        """Some of the views near the tangent, chosen evenly."""
        parts: list[NDArray[np.float64]] = []
        settled = alone(self.orientation.orientation_rad)
        total = len(self.photos.radiance) * len(self.tiles.homographies) * int(np.prod(self.tiles.shape))
        every = max(1, int(total * 0.1) // _SAMPLE)

        def read(views: Views, rows: slice) -> None:
            u, v, light = along(views, self.orientation.orientation_rad[rows])
            known = np.zeros_like(u) if period_um is None else np.broadcast_to(period_um[rows], u.shape)
            near = (v**2 < (_ACROSS * views.spread) ** 2) & settled[rows]
            near &= np.isfinite(views.brightness) & np.isfinite(known)
            columns = (views.brightness, u, v, views.half.w, views.half.gain, *light, views.rest, known)
            parts.append(np.stack([column[near][::every] for column in columns]).astype(np.float64))

        over_blocks(self.photos, self.tiles, self.placed, read)
        parts.sort(key=lambda part: float(part[:2].sum()))
        brightness, u, v, w, gain, light_u, light_v, rest, known = np.concatenate(parts, axis=1)
        return Sample(brightness, u, v, w, gain, light_u, light_v, rest, None if period_um is None else known)


def along(views: Views, orientation_rad: Array) -> tuple[NDArray[np.float64], ...]:
    """Half vectors along the tangent and across it, and what a millimetre of light is in them, shape (2, ...)."""
    cosine, sine = np.cos(orientation_rad, dtype=np.float64), np.sin(orientation_rad, dtype=np.float64)
    half = views.half
    light = np.stack([half.light_along(cosine, sine), half.light_along(-sine, cosine)])
    return half.x * cosine + half.y * sine, half.y * cosine - half.x * sine, light


def alone(orientation_rad: Array) -> NDArray[np.bool_]:
    """Pixels around which the tangent hardly turns; all that are known where these are few."""
    known = np.isfinite(orientation_rad)
    double = np.where(known, np.exp(2j * np.nan_to_num(orientation_rad)), 0)
    turns = [abs(np.angle(np.roll(double, step, axis) * np.conj(double))) / 2 for axis in (0, 1) for step in (-1, 1)]
    sure = known & np.all([np.roll(known, step, axis) for axis in (0, 1) for step in (-1, 1)], axis=0)
    smooth = sure & (np.max(turns, axis=0) < _SMOOTH_RAD)
    return smooth if smooth.sum() > _FEW_SMOOTH * known.sum() else known
