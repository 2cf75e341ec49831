"""What makes one response curve more believable than another, against integrals and densities taken elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from clouds import EQUAL, cloud
from scipy.integrate import simpson
from scipy.stats import multivariate_normal, norm

from pipeline.optics.curve_likelihood import unlikelihood
from pipeline.optics.curve_search import _Problem
from pipeline.optics.response_curve import FilmedGrating, StokesNoise, relative_stokes

UNEVEN = np.deg2rad([0, 13, 41, 66, 95, 120])
STRAY = 0.02


def grating(r, zeta_deg, film_deg, axis_deg=0.0):
    return FilmedGrating(r, *np.deg2rad([zeta_deg, film_deg, axis_deg]))


@pytest.mark.parametrize("polarizer_rad", [EQUAL, UNEVEN], ids=["even", "uneven"])
@pytest.mark.parametrize("true", [(1.08, 40, 8), (1.08, 20, 30), (1.1, 90, 3), (1.3, 150, 20)])
def test_one_point_is_as_likely_as_the_normal_density_at_its_own_place(true, polarizer_rad):
    """The shares of orientations go to the place that makes it most likely."""
    noise = StokesNoise(polarizer_rad, np.linspace(0.5, 1.5, len(polarizer_rad)))
    for theta in (0.3, 1.2, 2.5):
        place = np.array(relative_stokes(np.array([theta]), grating(*true))[1:])[:, 0]
        found = unlikelihood(place[None], np.array([0.005]), grating(*true), noise)
        density = multivariate_normal(place, 0.005**2 * noise.covariance(place[None])[0]).pdf(place)
        # Places lie 0.7 deviations apart, and their shares are found in so many rounds.
        assert found == pytest.approx(-np.log(STRAY + density), abs=0.2)


@pytest.mark.parametrize("unknown", [0, 1, 2])
def test_the_evidence_of_a_minimum_is_the_integral_over_its_unknown(unknown):
    """Likelihood times what is usual, summed over all values of one unknown (Laplace's approximation of it)."""
    true = grating(1.08, 60, 12)
    theta = np.random.default_rng(3).uniform(0, np.pi, 600)
    given = np.array([np.log(1.08), true.phase_rad, true.retardation_rad, 0.0])
    given[unknown] = np.nan
    problem = _Problem(cloud(true, theta), given, (unknown,))
    start = np.array([np.log(1.08), true.phase_rad, true.retardation_rad])[[unknown]]
    x = problem.descend(start, times=2)
    width = float(np.sqrt(problem.covariance(x)[0, 0]))
    values = x[0] + width * np.linspace(-6, 6, 41)
    unlikely = np.array([problem.unlikelihood(np.array([value]), 1.0) for value in values])
    usual = norm([0.0, np.pi / 2, 0.0][unknown], [0.3, np.pi / 2, np.pi / 4][unknown]).pdf(values)
    least = unlikely.min()
    evidence = np.log(simpson(np.exp(least - unlikely) * usual, x=values)) - least
    assert problem.unlikelihood(x, 1.0) + problem.surprise(x) == pytest.approx(-evidence, abs=0.5)
    assert width < 0.02  # so that its logarithm is most of the surprise
