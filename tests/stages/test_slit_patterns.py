"""The screen behind slits: places, colours, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import find_peaks

from pipeline.errors import InputError
from pipeline.stages.render.slits import _check_slits, slits


def test_the_sources_figure() -> None:
    """Figure 3.5: orders every 1.667 mm at 500 nm, 0.15 mm and 0.5 m, under the light of one slit, dark at 8.33 mm."""
    found = slits()
    assert found.slits.tolist() == [1, 2, 3, 4, 5, 6, 7]
    assert found.metrics["fringe_mm"] == pytest.approx(500 / np.sqrt(300**2 - 1), rel=1e-6)
    assert found.metrics["one_slit_dark_mm"] == pytest.approx(500 / np.sqrt(60**2 - 1), rel=1e-6)
    tops, _ = find_peaks(found.intensity[6], height=0.06)
    expected = np.arange(-3, 4) * found.metrics["fringe_mm"]
    assert found.position_mm[tops] == pytest.approx(expected, abs=0.03)
    assert found.intensity[6][tops] == pytest.approx(np.sinc(np.arange(-3, 4) / 5) ** 2, abs=0.01)


def test_patterns_are_symmetric_and_one_in_the_middle() -> None:
    found = slits(counts=[2, 5])
    middle = len(found.position_mm) // 2
    assert found.position_mm[middle] == 0
    assert found.intensity[:, middle].tolist() == [1, 1]
    assert found.white_rgb[:, middle] == pytest.approx(np.ones((2, 3)), abs=1e-6)
    assert found.white_rgb == pytest.approx(found.white_rgb[:, ::-1], abs=1e-5)


def test_blue_comes_before_red_in_every_order() -> None:
    """Orders of white light: ``d sin(theta) = m lambda``."""
    found = slits(counts=[7], half_width_mm=2.5)
    first = found.position_mm > 1.0
    place = found.position_mm[first]
    red, green, blue = (place[np.argmax(found.white_rgb[0, first, channel])] for channel in range(3))
    assert blue < green < red
    assert blue == pytest.approx(500 * 0.45 / 150, rel=0.05)
    assert red == pytest.approx(500 * 0.605 / 150, rel=0.05)


def test_samples_show_the_finest_fringes() -> None:
    few, many = slits(counts=[1]), slits(counts=[40])
    assert len(many.position_mm) > 10 * len(few.position_mm)
    tops, _ = find_peaks(many.intensity[0, np.abs(many.position_mm) < 1.7])
    assert len(tops) == 3 + 2 * 38


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"counts": []}, "counts is empty"),
        ({"counts": [2, 0]}, "counts is 0"),
        ({"slit_um": 0.3}, r"slit_um is 0.3[\s\S]*at least 0.78, a wavelength"),
        ({"separation_um": 20}, r"separation_um is 20[\s\S]*at least 30, as slits must not overlap"),
        ({"wavelength_nm": 300}, r"wavelength_nm is 300[\s\S]*380 to 780"),
        ({"distance_m": 0}, r"distance_m is 0[\s\S]*above 0"),
        ({"counts": [9000]}, r"half_width_mm is 10, over which fringes are too fine"),
    ],
)
def test_impossible_slits_are_refused(setting: dict[str, object], message: str) -> None:
    usual = {
        "counts": [1, 2],
        "slit_um": 30,
        "separation_um": 150,
        "wavelength_nm": 500,
        "distance_m": 0.5,
        "half_width_mm": 10,
    }
    _check_slits(**usual)
    with pytest.raises(InputError, match=message):
        _check_slits(**{**usual, **setting})
