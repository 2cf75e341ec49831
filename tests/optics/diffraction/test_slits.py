"""Rows of slits: closed forms of Fraunhofer diffraction, and the sum over points of the slits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import find_peaks

from pipeline.optics.diffraction.slits import interference_factor, slit_intensity

SLIT_UM, SEPARATION_UM, WAVELENGTH_UM = 30.0, 150.0, 0.5
COUNTS = range(1, 8)
every_count = pytest.mark.parametrize("count", COUNTS)


def intensity(sine: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    return slit_intensity(sine, count, slit_um=SLIT_UM, separation_um=SEPARATION_UM, wavelength_um=WAVELENGTH_UM)


@every_count
def test_maxima_stand_at_whole_orders_as_high_as_one_slit_lets_them(count: int) -> None:
    """``d sin(theta) = m lambda``; the fifth is missing where a slit is a fifth of the distance wide."""
    order = np.arange(-7, 8)
    expected = np.sinc(order / 5) ** 2
    assert expected[order == 5] == pytest.approx(0, abs=1e-30)
    assert intensity(order * WAVELENGTH_UM / SEPARATION_UM, count) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("count", range(2, 8))
def test_between_two_orders_stand_two_maxima_fewer_than_slits(count: int) -> None:
    place = np.linspace(0, 1, 20001)
    between, _ = find_peaks(interference_factor(place, count) ** 2)
    assert len(between) == count - 2
    dark = np.arange(1, count) / count
    assert interference_factor(dark, count) == pytest.approx(np.zeros(count - 1), abs=1e-12)


@every_count
def test_the_sum_over_points_of_the_slits_says_the_same(count: int) -> None:
    sine = np.linspace(-0.02, 0.02, 301)
    within = (np.arange(600) + 0.5) / 600 * SLIT_UM
    points = (np.arange(count)[:, None] * SEPARATION_UM + within).ravel()
    field = np.exp(2j * np.pi * np.outer(sine, points) / WAVELENGTH_UM).mean(axis=1)
    assert intensity(sine, count) == pytest.approx(np.abs(field) ** 2, abs=2e-6)


@given(place=st.floats(-50, 50), count=st.integers(1, 30))
def test_the_factor_is_the_mean_of_phases(place: float, count: int) -> None:
    phases = np.exp(2j * np.pi * place * (np.arange(count) - (count - 1) / 2))
    assert interference_factor(place, count) == pytest.approx(phases.mean().real, abs=1e-9)


@every_count
def test_slits_share_the_light_of_an_order(count: int) -> None:
    """Over a whole order the factor's square has the mean ``1 / n``: orders of one height get narrower with ``n``."""
    place = (np.arange(5000) + 0.5) / 5000
    assert (interference_factor(place, count) ** 2).mean() == pytest.approx(1 / count, rel=1e-9)
