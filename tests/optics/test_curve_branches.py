"""What a look-up on a response curve says of other branches, and of how well the curve explains a pixel."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import EQUAL, photographs

from pipeline.optics.angles import axial_difference
from pipeline.optics.curve_reading import read_rows, reading
from pipeline.optics.harmonic import harmonic_fit
from pipeline.optics.response_curve import FilmedGrating, StokesNoise, harmonic_design, response_curve

UNEVEN = np.deg2rad([0, 13, 41, 66, 95, 120])
APART_RAD = np.pi / 12
CROSSING = (1.08, np.deg2rad(25), np.deg2rad(30))
BENT = FilmedGrating(1.08, np.deg2rad(60), np.deg2rad(20))


def crossing_rad(grating: FilmedGrating) -> tuple[float, float]:
    """The two orientations at which a curve comes nearest to itself."""
    curve = response_curve(grating, 720)
    distance = np.hypot(*(curve.stokes[:, None] - curve.stokes).transpose(2, 0, 1))
    apart = np.abs(axial_difference(curve.orientation_rad[:, None], curve.orientation_rad))
    distance[apart < APART_RAD] = np.inf
    one, other = np.unravel_index(np.argmin(distance), distance.shape)
    return float(curve.orientation_rad[one]), float(curve.orientation_rad[other])


def turned_so_that_it_crosses_at(orientation_rad: float) -> FilmedGrating:
    """Film and gratings turned together turn the curve as a whole."""
    return FilmedGrating(*CROSSING, orientation_rad - crossing_rad(FilmedGrating(*CROSSING))[0])


@pytest.mark.parametrize("crossing_deg", [0.0, 0.3, 90.0, 179.7])
def test_the_other_branch_is_the_nearest_one_that_turns_by_fifteen_degrees_or_more(crossing_deg):
    """Wherever orientations begin to count: just above 0 and just below 180 degrees are one branch."""
    grating = turned_so_that_it_crosses_at(np.deg2rad(crossing_deg))
    curve, noise = response_curve(grating), StokesNoise(EQUAL, np.ones(12))
    lookup = reading(curve, noise, harmonic_fit(EQUAL))
    at = int(np.argmin(np.abs(axial_difference(curve.orientation_rad, np.deg2rad(crossing_deg)))))
    near = curve.stokes[np.arange(at - 60, at + 61) % len(curve.stokes)]
    cells = np.unique(((near - lookup.origin) / lookup.cell).astype(int), axis=0)
    middle = lookup.origin + (cells + 0.5) * lookup.cell
    away = middle[:, None] - curve.stokes
    square = np.einsum("pti,tij,ptj->pt", away, np.linalg.inv(noise.covariance(curve.stokes)), away)
    best = np.argmin(square, axis=1)
    turn = np.abs(axial_difference(curve.orientation_rad, curve.orientation_rad[best][:, None]))
    elsewhere = np.where(turn < APART_RAD - 1e-9, np.inf, square)
    other = np.argmin(elsewhere, axis=1)
    rows = np.arange(len(cells))
    found = lookup.cells[cells[:, 1], cells[:, 0]]
    np.testing.assert_allclose(found[:, 10], elsewhere[rows, other] - square[rows, best], rtol=1e-3, atol=1e-9)
    np.testing.assert_allclose(found[:, 11], turn[rows, other] ** 2, rtol=1e-3)


@pytest.mark.parametrize("crossing_deg", [0.0, 45.0, 90.0])
def test_a_pixel_at_a_crossing_may_have_either_orientation_wherever_that_is(crossing_deg):
    grating = turned_so_that_it_crosses_at(np.deg2rad(crossing_deg))
    one, other = crossing_rad(grating)
    photos = photographs(grating, np.full((4, 500), one), electrons=20_000)
    stated = read(photos, grating)[3]
    assert np.median(stated) > 0.3 * abs(axial_difference(one, other))


def read(photos, grating, polarizer_rad=EQUAL):
    fit = harmonic_fit(polarizer_rad, 1 / photos.mean(axis=(1, 2)))
    lookup = reading(response_curve(grating), StokesNoise(polarizer_rad, fit.photo_weights), fit)
    shape = photos.shape[1:]
    out = tuple(np.empty(shape, np.float32) for _ in range(4))
    mask = np.empty(shape, bool)
    read_rows(photos, np.ones(shape, bool), fit, lookup, gain=1.0, least=0.0, out=out, mask=mask)(0, shape[0])
    return out


@pytest.mark.parametrize("polarizer_rad", [EQUAL, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("electrons", [2000.0, 1e9])
def test_the_correlation_is_what_the_curve_explains_of_a_pixel(electrons, polarizer_rad):
    """Pixels that mix two orientations follow a cosine as well as others, but none that lies on the curve."""
    rng = np.random.default_rng(0)
    theta = rng.uniform(0, np.pi, (1, 1, 60)) + np.array([0.0, 0.6]).reshape(2, 1, 1)
    one, other = (
        photographs(BENT, t, polarizer_rad=polarizer_rad, electrons=electrons, seed=i) for i, t in enumerate(theta)
    )
    photos = (one + other) / 2
    unexplained = 1 - read(photos, BENT, polarizer_rad)[1].ravel().astype(float) ** 2
    weights = 1 / photos.mean(axis=(1, 2))
    values, design, curve = photos.reshape(len(photos), -1), harmonic_design(polarizer_rad), response_curve(BENT)
    root = np.sqrt(weights)[:, None]
    level, *stokes = np.linalg.pinv(design * root) @ (values * root)
    away = (np.array(stokes) / level).T[:, None] - curve.stokes
    inverse = np.linalg.inv(StokesNoise(polarizer_rad, weights / weights.mean()).covariance(curve.stokes))
    nearest = curve.stokes[np.argmin(np.einsum("pti,tij,ptj->pt", away, inverse, away), axis=1)]
    left = values - level * (design @ np.vstack([np.ones(60), nearest.T]))
    # A correlation minds no constant.
    expected = np.divide(*(weights @ (v - np.average(v, axis=0, weights=weights)) ** 2 for v in (left, values)))
    np.testing.assert_allclose(unexplained, expected, rtol=0.1, atol=0.001)
    assert np.median(unexplained) > 0.01
