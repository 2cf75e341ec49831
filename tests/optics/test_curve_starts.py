from __future__ import annotations

import numpy as np
import pytest
from clouds import cloud

from pipeline.optics.curve_starts import starts
from pipeline.optics.response_curve import FilmedGrating

FACETS = np.deg2rad(np.random.default_rng(3).choice([10, 20, 30, 40, 55, 60, 90], 3000))
UNKNOWN = np.array([np.nan, np.nan, np.nan, 0.0])


@pytest.mark.parametrize(("zeta_deg", "film_deg"), [(20, 8), (45, 8), (170, 3), (170, 8), (176, 8), (90, 30)])
def test_one_of_the_starts_is_next_to_the_true_curve(zeta_deg: float, film_deg: float) -> None:
    points = cloud(FilmedGrating(1.08, np.deg2rad(zeta_deg), np.deg2rad(film_deg)), FACETS)
    found = np.array(starts(points.stokes, float(np.median(points.scale)), UNKNOWN, 24))
    away = np.abs(found[:, 1:3] - np.deg2rad([zeta_deg, film_deg]))
    assert (away < np.deg2rad([7.5, 4.0])).all(axis=1).any()
    assert len(found) <= 24
    assert not found[:, 3].any()


def test_what_is_given_stays() -> None:
    points = cloud(FilmedGrating(1.08, 0.7, 0.2), FACETS)
    given = np.array([np.log(1.08), np.nan, 0.2, 0.0])
    found = np.array(starts(points.stokes, 0.01, given, 8))
    np.testing.assert_array_equal(found[:, [0, 2, 3]], np.tile(given[[0, 2, 3]], (len(found), 1)))
    assert np.abs(found[:, 1] - 0.7).min() < np.deg2rad(7.5)
