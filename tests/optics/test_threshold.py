from __future__ import annotations

import numpy as np
import pytest

from pipeline.optics.threshold import two_modes

RNG = np.random.default_rng(0)


def log_normal(centre, spread, count):
    return centre * np.exp(RNG.normal(0, spread, count))


@pytest.mark.parametrize("scale", [1.0, 1e-3, 1e4])
def test_ground_and_print_are_told_apart_whatever_the_exposure(scale):
    values = scale * np.concatenate([log_normal(0.03, 0.1, 6000), log_normal(0.6, 0.1, 4000)])
    modes = two_modes(values)
    assert modes.distinct
    # Otsu's cut lies in the middle of the empty gap of the logarithm, below half way.
    assert modes.threshold == pytest.approx(scale * np.sqrt(0.03 * 0.6), rel=0.1)
    assert modes.below == 0.6


def test_the_dimmest_facets_stay_above_the_threshold():
    """Otsu's cut lies above them here, at 0.18."""
    dim = log_normal(0.15, 0.05, 1500)
    modes = two_modes(np.concatenate([log_normal(0.03, 0.05, 4000), dim, log_normal(0.9, 0.05, 4500)]))
    assert modes.threshold < dim.min()
    assert modes.threshold == pytest.approx(0.09, rel=0.03)


@pytest.mark.parametrize(
    "values",
    [
        log_normal(0.2, 1.0, 20000),
        np.exp(RNG.uniform(-3, 0, 20000)),
        RNG.uniform(0, 1, 20000),
        np.concatenate([log_normal(0.3, 0.05, 9000), log_normal(0.6, 0.05, 9000)]),
    ],
    ids=["one mode", "flat in the logarithm", "flat", "two modes less than three times apart"],
)
def test_what_is_not_ground_and_print_is_not_called_so(values):
    assert not two_modes(values).distinct


def test_otsu_explains_the_textbook_share_of_a_gaussian():
    # Cut at its mean, the means of both halves lie sqrt(2/pi) sigma away: 2/pi of the variance is explained.
    assert two_modes(log_normal(1.0, 0.3, 400000)).separability == pytest.approx(2 / np.pi, abs=0.01)


def test_nothing_and_constants_have_no_two_modes():
    for values in ([], [np.nan], np.zeros(5), np.full(100, 0.4)):
        assert not two_modes(values).distinct
