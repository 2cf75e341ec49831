"""A polarisation camera's mosaic at full resolution: constant, smooth, at edges, and against polanalyser."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import polanalyser
import pytest
from numpy.typing import NDArray

from pipeline.optics.angles import axial_difference
from pipeline.optics.mosaic import REACH, Demosaic, demosaic, spread

METHODS: tuple[Demosaic, ...] = ("bilinear", "guided")
ANGLES = np.deg2rad([90.0, 45.0, 135.0, 0.0])
SIZE = 96


def mosaic(intensity: NDArray, degree: NDArray, angle: NDArray) -> NDArray:
    """What the sensor sees of partly linearly polarised light, by Malus' law."""
    raw = np.empty(np.broadcast_shapes(intensity.shape, degree.shape, angle.shape), np.float32)
    for place, analyser in enumerate(ANGLES):
        signal = intensity / 2 * (1 + degree * np.cos(2 * (angle - analyser)))
        raw[place // 2 :: 2, place % 2 :: 2] = np.broadcast_to(signal, raw.shape)[place // 2 :: 2, place % 2 :: 2]
    return raw


def stokes(planes: NDArray) -> tuple[NDArray, NDArray, NDArray]:
    """S0, S1, S2 by least squares, which for four angles 45 degrees apart are these sums."""
    s1, s2 = (np.tensordot(f(2 * ANGLES), planes, 1) for f in (np.cos, np.sin))
    return planes.sum(axis=0) / 2, s1, s2


def angle_of(planes: NDArray) -> NDArray:
    _, s1, s2 = stokes(planes)
    return 0.5 * np.arctan2(s2, s1)


def grid() -> tuple[NDArray, NDArray]:
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    return row.astype(float), column.astype(float)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("shape", [(SIZE, SIZE), (7, 10), (4, 5)])
def test_an_even_scene_is_exact_to_the_border(method: Demosaic, shape: tuple[int, int]) -> None:
    even = np.ones(shape)
    for angle in np.deg2rad([0, 20, 83.2, 135, 175.2]):
        planes = demosaic(mosaic(0.8 * even, 0.6 * even, angle * even), method=method)
        assert planes.shape == (4, *shape)
        assert planes.dtype == np.float32
        np.testing.assert_allclose(axial_difference(angle_of(planes), angle), 0, atol=2e-6)
        np.testing.assert_allclose(stokes(planes)[0], 0.8, rtol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_measured_pixels_stay_as_they_are(method: Demosaic) -> None:
    raw = np.random.default_rng(0).random((20, 30)).astype(np.float32)
    planes = demosaic(raw, method=method)
    for place in range(4):
        here = np.s_[place // 2 :: 2, place % 2 :: 2]
        np.testing.assert_array_equal(planes[place][here], raw[here])


def test_bilinear_reproduces_a_plane_inside() -> None:
    row, column = grid()
    plane = 0.2 + 0.003 * row + 0.002 * column
    planes = demosaic(plane.astype(np.float32), method="bilinear")
    inner = np.s_[:, 2:-2, 2:-2]
    np.testing.assert_allclose(planes[inner], np.broadcast_to(plane, planes.shape)[inner], atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_smooth_scene(method: Demosaic) -> None:
    """Second-order errors only: angle turning 1.1 degrees a pixel, brightness with a period of 57 pixels."""
    row, column = grid()
    angle = 0.3 + 0.02 * column
    planes = demosaic(
        mosaic(0.5 + 0.3 * np.sin(row / 9) * np.cos(column / 9), np.full(angle.shape, 0.5), angle), method=method
    )
    inner = np.s_[4:-4, 4:-4]
    error = np.rad2deg(axial_difference(angle_of(planes), angle))[inner]
    assert np.sqrt(np.mean(error**2)) < 0.15


def zipper(method: Demosaic, tilt: float) -> float:
    """RMS error in degrees within 3 pixels of a fivefold step of brightness in evenly polarised light."""
    row, column = grid()
    distance = (column - SIZE / 2) * np.cos(tilt) + (row - SIZE / 2) * np.sin(tilt)
    brightness = 0.15 + 0.6 * np.clip(distance + 0.5, 0, 1)
    even = np.ones_like(brightness)
    planes = demosaic(mosaic(brightness, 0.5 * even, 0.6 * even), method=method)
    near = (np.abs(distance) < 3) & (np.minimum(row, column) > 4) & (np.maximum(row, column) < SIZE - 5)
    return float(np.rad2deg(np.sqrt(np.mean(axial_difference(angle_of(planes), 0.6)[near] ** 2))))


@pytest.mark.parametrize("tilt", [0.0, 0.2, 0.8, np.pi / 2])
def test_guided_makes_less_false_polarisation_at_an_edge(tilt: float) -> None:
    assert zipper("guided", tilt) < zipper("bilinear", tilt) / 2


def test_brightness_does_not_matter() -> None:
    """Counts or full scale 1: the same picture."""
    raw = np.random.default_rng(1).random((24, 24)).astype(np.float32)
    for method in METHODS:
        large, small = demosaic(raw * np.float32(4096), method=method), demosaic(raw, method=method)
        np.testing.assert_allclose(large / 4096, small, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("method", METHODS)
def test_a_bad_pixel_spoils_what_is_within_reach_and_nothing_else(method: Demosaic) -> None:
    raw = np.random.default_rng(2).random((24, 28)).astype(np.float32)
    raw[11, 12] = np.nan
    reach = REACH[method]
    spoilt = np.zeros(raw.shape, bool)
    spoilt[11 - reach : 12 + reach, 12 - reach : 13 + reach] = True
    np.testing.assert_array_equal(spread(np.isnan(raw), reach), spoilt)
    planes = demosaic(raw, method=method)
    np.testing.assert_array_equal(np.isnan(planes), np.broadcast_to(spoilt, planes.shape))
    raw[11, 12] = 0.9
    np.testing.assert_allclose(planes[:, ~spoilt], demosaic(raw, method=method)[:, ~spoilt], rtol=2e-3)


@pytest.mark.parametrize("shape", [(3, 8), (8,), (8, 8, 3)])
def test_what_is_no_mosaic_is_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="no image of at least 4 x 4"):
        demosaic(np.zeros(shape, np.float32))


def oracle(raw: NDArray) -> tuple[NDArray, NDArray]:
    """Angle and degree of linear polarisation by polanalyser, which interpolates and rounds in the type of ``raw``."""
    vectors = polanalyser.calcStokes(polanalyser.demosaicing(raw), np.deg2rad([0, 45, 90, 135]))
    return polanalyser.cvtStokesToAoLP(vectors), polanalyser.cvtStokesToDoLP(vectors)


def test_real_frame_against_polanalyser(measurements: Path) -> None:
    """The whole frame where polanalyser rounds to 1/256 of a count; where it rounds to counts, what is polarised."""
    raw = cv2.imread(str(measurements / "polarization" / "filters" / "raw.png"), cv2.IMREAD_UNCHANGED)
    planes = demosaic(raw.astype(np.float32) / 255)
    angle, degree = oracle(raw.astype(np.uint16) * 256)
    difference = np.abs(np.rad2deg(axial_difference(angle_of(planes), angle)))
    assert np.median(difference) < 1e-3
    assert np.quantile(difference[degree > 0.05], 0.99) < 0.5
    angle, degree = oracle(raw)
    coarse = np.abs(np.rad2deg(axial_difference(angle_of(planes), angle)))[degree > 0.05]
    assert np.median(coarse) < 0.5
