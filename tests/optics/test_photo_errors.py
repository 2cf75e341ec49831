"""Errors that all pixels of a photograph share."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from pipeline.optics.photo_errors import PhotographErrors, odd_photographs, photograph_errors
from pipeline.optics.response_curve import FilmedGrating, harmonic_design
from tests.optics.clouds import EQUAL, photographs

FILMED = FilmedGrating(1.08, np.deg2rad(60), np.deg2rad(8))
ELECTRONS = 5000.0


def errors_of(turn_deg: NDArray[np.float64], exposure: NDArray[np.float64] | float = 1.0) -> PhotographErrors:
    """What is found of photographs taken at other angles and exposures than were written down."""
    theta = np.random.default_rng(3).uniform(0, np.pi, 8000)
    taken = EQUAL[: len(turn_deg)] * 12 / len(turn_deg)
    values = photographs(FILMED, theta, polarizer_rad=taken + np.deg2rad(turn_deg), electrons=ELECTRONS)
    values *= np.broadcast_to(exposure, len(values))[:, None]
    weights = 1 / values.mean(axis=1)
    return photograph_errors(values, taken, weights / weights.mean(), 1.0)


def test_nothing_is_found_where_nothing_is_wrong() -> None:
    found = errors_of(np.zeros(12))
    assert np.rad2deg(np.abs(found.turn_rad)).max() < 0.1
    assert np.abs(found.exposure).max() < 1e-3
    assert found.systematic is not None
    assert found.systematic < 0.05


@pytest.mark.parametrize("turn_deg", [-2.0, 0.5, 3.0])
def test_a_misread_angle_is_found_with_its_sign(turn_deg: float) -> None:
    turned = np.zeros(12)
    turned[4] = turn_deg
    found = np.rad2deg(errors_of(turned).turn_rad)
    assert np.argmax(np.abs(found)) == 4
    # Three numbers of every pixel follow the photographs, so that a quarter of one's error cannot be seen.
    assert found[4] - np.median(found) == pytest.approx(turn_deg, rel=0.3)


def test_an_exposure_that_differs_is_found() -> None:
    exposure = np.ones(12)
    exposure[7] = 1.05
    found = errors_of(np.zeros(12), exposure).exposure
    assert np.argmax(np.abs(found)) == 7
    assert found[7] - np.median(found) == pytest.approx(0.05, rel=0.3)


def test_the_systematic_error_is_that_of_the_points() -> None:
    turned = np.random.default_rng(5).normal(0, 1.0, 12)
    theta = np.random.default_rng(3).uniform(0, np.pi, 8000)
    inverse = np.linalg.pinv(harmonic_design(EQUAL))
    clean, shifted = (
        inverse @ photographs(FILMED, theta, polarizer_rad=angles, electrons=1e9)
        for angles in (EQUAL, EQUAL + np.deg2rad(turned))
    )
    noisy = inverse @ photographs(FILMED, theta, electrons=ELECTRONS)
    relative = [found[1:] / found[0] for found in (clean, shifted, noisy)]
    expected = np.sqrt(np.mean((relative[1] - relative[0]) ** 2) / np.mean((relative[2] - relative[0]) ** 2))
    found = errors_of(turned).systematic
    assert found == pytest.approx(expected, rel=0.6)


def test_three_photographs_show_none_of_it() -> None:
    assert errors_of(np.array([0.0, 2.0, 0.0])).systematic is None


LEVELS = 100 * (1 + 0.3 * np.cos(2 * EQUAL) - 0.2 * np.sin(2 * EQUAL))


@given(st.sets(st.integers(0, 11), min_size=1, max_size=3), st.sampled_from([0.0, 0.3, 1.8]), st.integers(0, 99))
def test_failed_exposures_are_found_up_to_a_quarter(failed: set[int], factor: float, seed: int) -> None:
    level = LEVELS * np.random.default_rng(seed).normal(1, 0.003, 12)
    level[list(failed)] *= factor
    assert odd_photographs(level, EQUAL) == sorted(failed)


@given(st.integers(3, 17), st.floats(0, 0.1), st.integers(0, 999))
def test_photographs_that_scatter_alike_are_all_kept(count: int, scatter: float, seed: int) -> None:
    """Within bounds, so that none is an outlier by chance."""
    angles = np.arange(count) * np.pi / count
    random = np.random.default_rng(seed)
    level = 100 * (1 + 0.4 * np.cos(2 * angles)) * (1 + scatter / 5 * random.uniform(-1.7, 1.7, count))
    assert odd_photographs(level, angles) == []


def test_four_photographs_cannot_be_judged() -> None:
    level = LEVELS[::3].copy()
    level[1] = 0
    assert odd_photographs(level, EQUAL[::3]) == []
