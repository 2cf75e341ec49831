from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pipeline.optics.rigid import RigidMotion, corner_px

MOTIONS = st.builds(
    RigidMotion, st.floats(-np.pi, np.pi), st.tuples(st.floats(-6, 6), st.floats(-6, 6)), st.floats(0.3, 3)
)


@given(MOTIONS)
def test_the_inverse_leads_back(motion):
    place = np.random.default_rng(0).uniform(0, 60, (2, 9))
    there = motion.apply(place, (60, 81), (31, 40))
    np.testing.assert_allclose(motion.inverse.apply(there, (31, 40), (60, 81)), place, atol=1e-9)


def test_a_turn_runs_anticlockwise_as_seen():
    to_the_right = np.array([0.0, 3.0])
    np.testing.assert_allclose(RigidMotion(np.pi / 2).matrix @ to_the_right, [-3, 0], atol=1e-12)  # up: towards row 0


def test_corners_lie_half_a_diagonal_away():
    assert corner_px((31, 41)) == pytest.approx(25)
