"""Figures of highlights and of distributions of gratings."""

from __future__ import annotations

import numpy as np

from pipeline.data.flash_maps import GratingDistribution, Highlights
from pipeline.report.figures import figures_of
from pipeline.report.flash_maps import shown_distribution


def test_a_highlight_is_circled_and_its_stated_place_crossed() -> None:
    value = Highlights(
        place_mm=np.array([[10.0, 5.0], [np.nan, np.nan]]),
        sigma_mm=np.array([2.0, np.nan]),
        saturated=np.array([True, False]),
        outside=np.array([False, True]),
        stated_mm=np.full((2, 2), np.nan),
        light_sigma_mm=4.0,
        photographs=np.ones((2, 41, 61), np.float32),
        pixel_mm=1.0,
    )
    (figure,) = figures_of(value)
    assert figure.body.count("<path") == 2
    assert "<line" not in figure.body
    # Centre at column 40 and row 15; two standard deviations to the right of it lies 44, 15.
    assert "44" in figure.body.split("<path")[1][:40]
    assert "(10.0, 5.0) mm, σ 2 mm, saturated" in figure.body
    assert "no highlight in the picture" in figure.body
    assert "The flash's extent follows: 4 mm." in figure.caption


def test_a_distribution_is_drawn_with_orientation_up_and_what_is_unseen_in_grey() -> None:
    share = np.zeros((4, 3))
    share[3, 0] = 1.0
    seen = np.ones(share.shape, bool)
    seen[0, 2] = False
    value = GratingDistribution(share, (np.arange(4) + 0.5) * np.pi / 4, np.array([1.0, 1.5, 2.0]), seen)
    picture = shown_distribution(value)
    brightest = picture[0, 0]
    assert (picture[-1, 0] != brightest).any()
    assert (picture[-1, -1] != picture[-1, 0]).any()
    (figure,) = figures_of(value)
    assert "period (µm)" in figure.body
    assert "4 × 3 bins" in figure.caption
