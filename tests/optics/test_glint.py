from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad

from pipeline.optics.glint import glint, half_vectors, luminous_efficiency


def test_the_half_vector_points_halfway_between_light_and_camera():
    half = half_vectors(np.array([[0.0, 0.0], [10.0, 0.0]]), [300.0, 0.0, 300.0], [0.0, 0.0, 500.0])
    np.testing.assert_allclose(half[0], [np.sqrt(0.5), 0], atol=1e-12)
    expected = 290 / np.hypot(290, 300) - 10 / np.hypot(10, 500)
    np.testing.assert_allclose(half[1], [expected, 0], atol=1e-12)


def test_the_mirror_direction_has_no_half_vector():
    np.testing.assert_allclose(half_vectors(np.zeros((1, 2)), [100, 0, 400], [-100, 0, 400]), 0, atol=1e-12)


def test_a_grating_shines_where_its_tangent_points_at_the_light():
    orientation = np.deg2rad(np.arange(0, 180, 5.0))
    towards = 0.5 * np.array([np.cos(np.deg2rad(35)), np.sin(np.deg2rad(35))])
    half = np.broadcast_to(towards, (len(orientation), 2))
    bright = glint(half, orientation, 1.1, np.full(len(orientation), 0.03))
    assert np.rad2deg(orientation[np.argmax(bright)]) == pytest.approx(35)
    # Equation u = m lambda / a: green at 0.55 um = 0.5 x 1.1 um; 20 degrees away the Gaussian has gone.
    assert bright[np.isclose(np.rad2deg(orientation), 55)] < 1e-4 * bright.max()


@pytest.mark.parametrize("spread", [0.0, 0.03, 0.1])
def test_a_spread_averages_the_eyes_response(spread):
    found = luminous_efficiency(0.6, spread)
    if spread == 0:
        assert found == pytest.approx(0.631, abs=0.01)  # CIE 1924, at 600 nm
        return
    expected, _ = quad(
        lambda x: luminous_efficiency(x) * np.exp(-0.5 * ((x - 0.6) / spread) ** 2) / (spread * np.sqrt(2 * np.pi)),
        -1,
        2,
        points=[0.6],
    )
    assert found == pytest.approx(expected, rel=1e-6)
