"""Periods that follow the orientation."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.period_blends import blended_periods

BLENDS = ("quadratic", "squared sine", "closed squared sine")
HALF_WAY = np.sin(np.pi * 90 / 179) ** 2  # 90 degrees is 90/179 of the way through 180 bins


@pytest.mark.parametrize(
    ("blend", "at_0", "at_90", "at_179"),
    [
        ("quadratic", 1.0, 1 + (90 / 179) ** 2, 2.0),
        ("squared sine", 1.0, 1 + np.sin(np.pi / 2 * 90 / 179) ** 2, 2.0),
        ("closed squared sine", 1.0, 1 + HALF_WAY, 1.0),
    ],
)
def test_the_ends_and_the_middle(blend: str, at_0: float, at_90: float, at_179: float) -> None:
    found = blended_periods(np.deg2rad([0, 90, 179]), 1.0, 2.0, blend, 180)
    np.testing.assert_allclose(found, [at_0, at_90, at_179], rtol=1e-12)


@pytest.mark.parametrize("blend", BLENDS)
def test_whole_degrees_lie_in_the_middle_of_bins_even_in_single_precision(blend: str) -> None:
    whole = np.deg2rad(np.arange(180)).astype(np.float32)
    found = blended_periods(whole, 1.0, 2.0, blend, 180)
    for nudge in (-0.45, 0.45):
        np.testing.assert_array_equal(blended_periods(whole + np.deg2rad(nudge), 1.0, 2.0, blend, 180), found)


@pytest.mark.parametrize(("blend", "jump_um"), [("quadratic", 1.0), ("squared sine", 1.0), ("closed squared sine", 0)])
def test_only_the_closed_blend_closes_where_180_degrees_do(blend: str, jump_um: float) -> None:
    around = blended_periods(np.deg2rad([179.0, 179.6, 0.0]), 1.0, 2.0, blend, 180)
    assert around[0] - around[2] == pytest.approx(jump_um, abs=1e-12)
    assert around[1] == around[2]
    steps = np.abs(np.diff(blended_periods(np.deg2rad(np.arange(180)), 1.0, 2.0, blend, 180)))
    assert steps.max() < 0.02


@given(
    degrees=st.floats(0, 179.99),
    bins=st.integers(2, 720),
    blend=st.sampled_from(BLENDS),
    ends=st.tuples(st.floats(0.2, 5), st.floats(0.2, 5)).map(sorted),
)
def test_periods_stay_between_the_ends_and_do_not_know_half_turns(degrees, bins, blend, ends) -> None:
    angle = np.deg2rad(degrees)
    period = blended_periods(angle, *ends, blend, bins)
    assert ends[0] - 1e-12 <= period <= ends[1] + 1e-12
    nudged = angle + np.pi
    if abs((angle * bins / np.pi) % 1 - 0.5) > 1e-6:  # at a bin's edge, rounding decides
        assert blended_periods(nudged, *ends, blend, bins) == pytest.approx(period)


def test_fewer_bins_make_steps_and_what_is_not_known_stays_so() -> None:
    found = blended_periods(np.deg2rad([0, 29, 31, 89, 91, 149, 151, np.nan]), 1.0, 2.0, "quadratic", 3)
    np.testing.assert_allclose(found, [1, 1, 1.25, 1.25, 2, 2, 1, np.nan])
