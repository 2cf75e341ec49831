"""A small scene of facets, photographed through a turning polariser by the forward model."""

from __future__ import annotations

import numpy as np

from pipeline.data.photographs import PolarizerSequence
from pipeline.optics.imaging import area_average, seen_by_lens
from pipeline.optics.jones import polarizer_response

OVER = 5


def facets(size: int = 160, *, seed: int = 0, least_turn_deg: float = 0.0):
    """Orientation and period of a disc of irregular facets with two rings of ground, on a grid OVER times finer."""
    rng = np.random.default_rng(seed)
    axis = (np.arange(size * OVER) + 0.5) / (size * OVER) * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    radius, angle = np.hypot(x, y), np.arctan2(y, x)
    ring = np.digitize(radius, [0.2, 0.45, 0.65])
    sector = np.floor((angle + 0.3 * ring) / (2 * np.pi) * 12).astype(int) % 12
    label = 12 * ring + sector
    orientation = rng.permutation(np.arange(48) * np.pi / 48)[label]
    period = rng.choice([1.0, 1.2, 1.4], 48)[label]
    diffracts = (radius < 0.85) & (np.abs(radius - 0.55) > 0.03) & (radius > 0.07)
    return np.where(diffracts, orientation, np.nan), np.where(diffracts, period, np.nan)


def spiral(size: int = 160, *, fills_the_picture: bool = False):
    """A disc in which the orientation turns continuously with the azimuth and the radius, in steps of 0.1 degrees."""
    axis = (np.arange(size * OVER) + 0.5) / (size * OVER) * 2 - 1
    x, y = np.meshgrid(axis, -axis)
    radius = np.hypot(x, y)
    orientation = np.rad2deg(np.arctan2(y, x) + 1.5 * np.log(radius + 0.05)) % 180
    diffracts = (radius < 0.85) | fills_the_picture
    return np.where(diffracts, np.deg2rad(np.round(orientation, 1)) % np.pi, np.nan), np.where(diffracts, 1.4, np.nan)


def photographed(
    orientation_rad,
    period_um,
    angles,
    *,
    amplitude_ratio=1.1,
    phase_deg=45.0,
    retardation_deg=0.0,
    shifts_px=None,
    turns_rad=None,
    electrons=None,
    blur_px=0.7,
    ground=0.03,
    seed=0,
) -> PolarizerSequence:
    rng = np.random.default_rng(seed)
    values, index = np.unique(np.nan_to_num(orientation_rad), return_inverse=True)
    efficiency = np.nan_to_num(period_um / np.nanmax(period_um)) ** 2
    images = []
    for k, angle in enumerate(angles):
        response = polarizer_response(
            angle,
            values,
            amplitude_ratio=amplitude_ratio,
            phase_rad=np.deg2rad(phase_deg),
            retardation_rad=np.deg2rad(retardation_deg),
        )
        fine = response[index].reshape(efficiency.shape) * efficiency + np.where(np.isfinite(period_um), 0, ground)
        shift = (0.0, 0.0) if shifts_px is None else tuple(OVER * s for s in shifts_px[k])
        turn = 0.0 if turns_rad is None else float(turns_rad[k])
        seen = seen_by_lens(fine.astype(np.float32), blur_px=blur_px * OVER, shift_px=shift, turn_rad=turn)
        images.append(area_average(seen, OVER))
    stack = np.array(images, np.float32) / np.float32(2.2)
    if electrons is not None:
        stack = rng.poisson(stack * electrons).astype(np.float32) / np.float32(electrons)
    return PolarizerSequence(stack, np.asarray(angles, np.float64), np.ones(stack.shape[1:], bool), 0.02, 530.0)


def at_centres(fine):
    return fine[OVER // 2 :: OVER, OVER // 2 :: OVER]
