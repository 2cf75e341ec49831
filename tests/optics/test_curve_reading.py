from __future__ import annotations

import numpy as np
import pytest
from clouds import EQUAL, photographs

from pipeline.optics.angles import axial_difference
from pipeline.optics.curve_reading import read_rows, reading
from pipeline.optics.harmonic import harmonic_fit
from pipeline.optics.response_curve import FilmedGrating, StokesNoise, orientation_bound, response_curve

KINDS = {
    "circle": FilmedGrating(1.08, np.deg2rad(40)),
    "bent": FilmedGrating(1.08, np.deg2rad(60), np.deg2rad(20)),
    "small": FilmedGrating(1.05, np.deg2rad(174), np.deg2rad(30)),
    "crossing": FilmedGrating(1.08, np.deg2rad(25), np.deg2rad(30)),
}


def read(photos, grating, *, polarizer_rad=EQUAL, gain=1.0, curve_variance=0.0):
    weights = 1 / photos.mean(axis=(1, 2))
    fit = harmonic_fit(polarizer_rad, weights)
    lookup = reading(response_curve(grating), StokesNoise(polarizer_rad, fit.photo_weights), fit, curve_variance)
    shape = photos.shape[1:]
    out = tuple(np.empty(shape, np.float32) for _ in range(4))
    mask = np.empty(shape, bool)
    rows = read_rows(photos, np.ones(shape, bool), fit, lookup, gain=gain, least=0.0, out=out, mask=mask)
    rows(0, shape[0])
    return (*out, mask)


@pytest.mark.parametrize("kind", KINDS)
def test_noiseless_photographs_give_their_orientations_back(kind):
    theta = np.random.default_rng(0).uniform(0, np.pi, (40, 1500))
    photos = photographs(KINDS[kind], theta, electrons=1e12).astype(np.float32)
    orientation, correlation, brightness, _, mask = read(photos, KINDS[kind], gain=1.0)
    error = np.abs(axial_difference(orientation, theta))
    # Where the curve crosses itself two orientations look alike.
    clear = error < 2e-4
    assert clear.mean() > (0.99 if kind == "crossing" else 0.999999)
    assert mask.all()
    assert np.median(correlation) > 0.99999
    assert brightness[clear].std() < 2e-3 * brightness.mean()
    assert 0 <= orientation.min() <= orientation.max() < np.float32(np.pi)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("polarizer_rad", [EQUAL, np.deg2rad([0, 13, 41, 66, 95, 120]), EQUAL[::4]])
def test_the_standard_error_is_the_scatter(kind, polarizer_rad):
    theta = np.repeat(np.arange(60) * np.pi / 60 + 0.01, 400).reshape(60, 400)
    photos = photographs(KINDS[kind], theta, polarizer_rad=polarizer_rad, electrons=20_000)
    orientation, _, _, stated, _ = read(photos, KINDS[kind], polarizer_rad=polarizer_rad)
    error = axial_difference(orientation, theta)
    scatter = np.sqrt((error**2).mean(axis=1))
    ratio = scatter / np.sqrt((stated.astype(float) ** 2).mean(axis=1))
    alone = scatter < np.deg2rad(5)
    assert alone.mean() > 0.8
    assert np.median(ratio[alone]) == pytest.approx(1, abs=0.12)
    assert ratio.max() < 3


@pytest.mark.parametrize("kind", ["circle", "bent", "small"])
def test_the_scatter_reaches_the_bound(kind):
    theta = np.repeat(np.arange(30) * np.pi / 30, 1000).reshape(30, 1000)
    photos = photographs(KINDS[kind], theta, electrons=20_000)
    orientation, *_ = read(photos, KINDS[kind])
    scatter = np.sqrt((axial_difference(orientation, theta) ** 2).mean(axis=1))
    curve = response_curve(KINDS[kind], 30)
    bound = orientation_bound(curve, EQUAL, 20_000 * curve.brightness)
    assert 0.9 < np.median(scatter / bound) < 1.2


def test_a_pixel_that_mixes_two_orientations_says_so():
    theta = np.stack([np.full((4, 500), 0.4), np.full((4, 500), 1.5)])
    pure = [photographs(KINDS["bent"], t, electrons=20_000, seed=i).astype(float) for i, t in enumerate(theta)]
    *_, clean, _ = read(pure[0], KINDS["bent"])
    *_, mixed, _ = read((pure[0] + pure[1]) / 2, KINDS["bent"])
    assert np.median(mixed) > 5 * np.median(clean)


def test_another_branch_nearby_enlarges_the_error():
    """Where the curve crosses itself the orientation may be either, and the stated error is as large as the turn."""
    grating = KINDS["crossing"]
    curve = response_curve(grating, 720)
    distance = np.hypot(*(curve.stokes[:, None] - curve.stokes[None]).transpose(2, 0, 1))
    apart = np.abs(axial_difference(curve.orientation_rad[:, None], curve.orientation_rad[None]))
    distance[apart < np.deg2rad(15)] = np.inf
    one, other = np.unravel_index(np.argmin(distance), distance.shape)
    photos = photographs(grating, np.full((4, 500), curve.orientation_rad[one]), electrons=20_000)
    *_, stated, _ = read(photos, grating)
    assert np.median(stated) > 0.3 * apart[one, other]
    assert apart[one, other] > np.deg2rad(15)


def test_the_curve_s_own_uncertainty_is_part_of_the_error():
    photos = photographs(KINDS["circle"], np.full((4, 500), 0.4), electrons=1e9)
    *_, stated, _ = read(photos, KINDS["circle"], curve_variance=0.01**2)
    np.testing.assert_allclose(stated, 0.01, rtol=0.01)


def test_dark_pixels_are_left_out():
    photos = photographs(KINDS["circle"], np.full((2, 50), 0.4))
    photos[:, 0] = 0
    orientation, correlation, _, stated, mask = read(photos, KINDS["circle"])
    np.testing.assert_array_equal(mask, [[False] * 50, [True] * 50])
    assert np.isnan([orientation[0], correlation[0], stated[0]]).all()


@pytest.mark.parametrize("kind", ["circle", "bent", "small"])
def test_off_the_curve_the_orientation_turns_as_its_nearest_place_does(kind):
    """Inside of a bend faster than on the curve, outside more slowly: so much for the slope within a cell."""
    curve, fine = response_curve(KINDS[kind]), response_curve(KINDS[kind], 40_000)
    noise = StokesNoise(EQUAL, np.ones(12))
    lookup = reading(curve, noise, harmonic_fit(EQUAL))
    rng = np.random.default_rng(0)
    middle = curve.stokes.mean(axis=0)
    start = rng.integers(0, len(curve.stokes), 200)
    points = middle + (curve.stokes[start] - middle) * rng.uniform(0.6, 1.5, (200, 1))
    inverse = np.linalg.inv(noise.covariance(fine.stokes))
    away = points[:, None] - fine.stokes
    square = np.einsum("pti,tij,ptj->pt", away, inverse, away)
    nearest = fine.orientation_rad[np.argmin(square, axis=1)]
    column, row = ((points - lookup.origin) / lookup.cell).astype(int).T
    plane = lookup.cells[row, column].astype(float)
    found = plane[:, 0] + plane[:, 1] * points[:, 0] + plane[:, 2] * points[:, 1]
    step = np.hypot(plane[:, 1], plane[:, 2]) * lookup.cell
    assert np.quantile(np.abs(axial_difference(found, nearest)) / step, 0.9) < 0.12  # 0.15 and more without the bend
