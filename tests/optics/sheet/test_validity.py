"""Where scalar diffraction and its expansion stop holding."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.special import jv

from pipeline.optics.sheet.validity import evanescent_share, expansion_error, leaving_share


def test_the_expansion_errs_with_the_fourth_power_of_the_depth() -> None:
    """To next order, ``(q / 2)^2`` exceeds ``J_1(q)^2`` by ``q^4 / 16``."""
    assert expansion_error(0.02, "E") / expansion_error(0.01, "E") == pytest.approx(16, rel=0.05)
    assert expansion_error(0.0, "D65") == pytest.approx(0, abs=1e-15)
    q = 2 * 3.14159265 * 0.01 / 0.56
    assert expansion_error(0.01, "E") == pytest.approx(q**4 / 16, rel=0.25)


def test_a_long_period_lets_all_orders_leave_and_a_short_one_only_the_mirrors() -> None:
    assert evanescent_share(50.0, 0.12, "D65") == pytest.approx(0, abs=1e-9)
    zeroth = jv(0, 2 * 3.14159265 * 0.12 / 0.56) ** 2
    assert evanescent_share(0.2, 0.12, "E") == pytest.approx(1 - zeroth, rel=0.06)


@given(st.floats(0.1, 5), st.floats(0, 1), st.sampled_from(["D65", "A", "inverse A", "E"]))
def test_shares_are_parts_of_the_light(period: float, depth: float, light: str) -> None:
    share = evanescent_share(period, depth, light)  # type: ignore[arg-type]
    assert -1e-9 <= share <= 1


def test_what_leaves_balances_energy_where_periods_are_long() -> None:
    assert leaving_share(20.0, 0.12, "D65") == pytest.approx(1, abs=1e-3)
    zeroth = jv(0, 2 * 3.14159265 * 0.12 / 0.56) ** 2
    assert leaving_share(0.2, 0.12, "E") == pytest.approx(zeroth, rel=0.06)
    assert leaving_share(1.0, 0.0, "A") == pytest.approx(1)
