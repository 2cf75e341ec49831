"""Periods from peaks of diffraction: published figures, made surfaces in any direction, and what is refused."""

from __future__ import annotations

import dataclasses
import logging
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError, InputErrors
from pipeline.stages.capture.published_height_map import published_height_map
from pipeline.stages.fit.diffraction_peaks import _check_diffraction_peaks, diffraction_peaks
from pipeline.stages.fit.periodicity import periodicity
from pipeline.stages.simulate.blaze import blaze
from pipeline.stages.simulate.cosine_grating import cosine_grating

COARSE = {"wavelength_step": 50.0, "angle_step_deg": 0.1}


@pytest.fixture(scope="module")
def sawtooth() -> HeightField:
    return blaze(period_um=2.5, depth_um=0.246)


@pytest.fixture
def maps(measurements: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("OPTIBENCH_DATA", str(measurements / "afm"))


@pytest.mark.parametrize(
    ("evaluator", "published_nm", "published_spread_nm"),
    [("chebyshev", 2499.997, 0.377), ("flss", 2499.997, 0.377), ("nmm", 2499.997, 0.377), ("pq", 2502.428, 0.390)],
)
def test_the_published_blaze_is_met_as_closely_or_closer(
    sawtooth: HeightField, evaluator, published_nm: float, published_spread_nm: float
) -> None:
    """Single 2014, figures 3.9 to 3.11: estimates of a period of 2500 nm for light at 75 degrees."""
    found = diffraction_peaks(sawtooth, periodicity(sawtooth), evaluator=evaluator)
    assert found.metrics["peaks"] == len(found.wavelength_nm)
    assert abs(1000 * found.metrics["period_um"] - 2500) <= abs(published_nm - 2500)
    assert found.metrics["period_spread_nm"] <= published_spread_nm


@pytest.mark.parametrize("evaluator", ["chebyshev", "flss", "nmm"])
def test_the_middle_of_the_line_is_exact_where_its_brightest_angle_is_not(sawtooth: HeightField, evaluator) -> None:
    periods = periodicity(sawtooth)
    middle = diffraction_peaks(sawtooth, periods, evaluator=evaluator)
    brightest = diffraction_peaks(sawtooth, periods, evaluator=evaluator, line_middle=False)
    assert 1000 * middle.period_um == pytest.approx(np.full(81, 2500), abs=1e-3)
    assert 0.08 < brightest.metrics["period_spread_nm"] < 0.13
    assert brightest.peak_rad.tolist() == middle.peak_rad.tolist()
    sines = np.sin(brightest.peak_rad) + np.sin(brightest.light_rad)
    assert brightest.period_um == pytest.approx(brightest.wavelength_nm / 1000 / sines, rel=1e-12)


@pytest.mark.parametrize("evaluator", ["direct", "nufft"])
def test_the_defining_sum_says_the_same(evaluator) -> None:
    if evaluator == "nufft":
        pytest.importorskip("finufft")
    made = blaze(period_um=2.5, depth_um=0.246, size_um=5, pitch_um=0.125)
    small = {
        "coherence_um": 20,
        "contrast": 1.5,
        "wavelength_step": 100,
        "angle_step_deg": 1,
        "near_um": 2.5,
        "tolerance": 1e-5,
    }
    fast, defined = (diffraction_peaks(made, evaluator=name, **small) for name in ("chebyshev", evaluator))
    assert defined.response == pytest.approx(fast.response, abs=1e-4)
    assert defined.period_um == pytest.approx(fast.period_um, rel=1e-5)
    assert defined.metrics["peaks"] == 5


@pytest.mark.usefixtures("maps")
def test_the_published_tile_is_met_though_the_interpolation_between_its_lines_is_coarse() -> None:
    tile = published_height_map(name="blaze_tile")
    periods = periodicity(tile)
    for evaluator, published_nm, spread_nm in (("flss", 2499.997, 0.377), ("pq", 2502.428, 0.390)):
        found = diffraction_peaks(tile, periods, evaluator=evaluator).metrics  # type: ignore[arg-type]
        assert abs(1000 * found["period_um"] - 2500) <= abs(published_nm - 2500)
        assert found["period_spread_nm"] <= spread_nm


@pytest.mark.usefixtures("maps")
def test_elaphe_as_it_was_scanned_gives_the_published_period() -> None:
    """Single 2014: 1144.262 nm, spread 0.401, by full lambda sampling; 1052.308 nm, spread 49.678, by PQ."""
    scan = published_height_map(name="elaphe")
    periods = periodicity(scan)
    found = diffraction_peaks(scan, periods, wavelength_step=20).metrics
    assert 1000 * found["period_um"] == pytest.approx(1144.262, abs=1.0)
    assert found["period_spread_nm"] < 0.401
    assert found["spectrum_period_um"] == pytest.approx(1.057, abs=0.001)
    replicas = diffraction_peaks(scan, periods, evaluator="pq", wavelength_step=20).metrics
    assert 30 < replicas["period_spread_nm"] < 60


@settings(max_examples=15, deadline=None)
@given(
    period_um=st.floats(1.2, 3),
    slant_deg=st.one_of(st.just(0.0), st.floats(25, 65)),
    quarter_deg=st.sampled_from([-180, -90, 0, 90]),
    other_side=st.booleans(),
)
def test_any_period_in_any_direction_is_found(
    period_um: float, slant_deg: float, quarter_deg: int, other_side: bool
) -> None:
    made = cosine_grating(
        period_um=period_um,
        orientation_deg=slant_deg + quarter_deg,
        depth_um=0.1,
        size_um=20,
        pitch_um=0.1,
        periodic=True,
    )
    periods = periodicity(made)
    azimuth = float(np.rad2deg(periods.direction_rad[0])) + 180 * other_side
    found = diffraction_peaks(made, periods, azimuth_deg=azimuth, **COARSE)
    assert found.period_um == pytest.approx(np.full(9, periods.period_um[0]), rel=3e-4)
    assert found.near_um == periods.period_um[0]


def test_light_on_the_normal_sees_orders_on_both_sides() -> None:
    made = cosine_grating(period_um=2.0, depth_um=0.1, size_um=20, pitch_um=0.1)
    for order in (-1, 1):
        found = diffraction_peaks(made, light_deg=0, order=order, near_um=2.1, **COARSE)
        assert found.period_um == pytest.approx(np.full(9, 2.0), rel=1e-5)
        assert np.sign(found.peak_rad).tolist() == [order] * 9


def test_without_a_period_the_strongest_ridge_is_followed(caplog: pytest.LogCaptureFixture) -> None:
    made = cosine_grating(period_um=2.0, depth_um=0.1, size_um=20, pitch_um=0.1)
    with caplog.at_level(logging.INFO):
        found = diffraction_peaks(made, **COARSE)
    assert found.period_um == pytest.approx(np.full(9, 2.0), rel=1e-5)
    assert "the strongest ridge is at 1.998 um" in caplog.text
    assert "spectrum_period_um" not in found.metrics


def test_a_period_across_the_plane_is_not_looked_for(sawtooth: HeightField, caplog: pytest.LogCaptureFixture) -> None:
    found = diffraction_peaks(sawtooth, periodicity(sawtooth), azimuth_deg=60, **COARSE)
    assert np.isnan(found.near_um)
    assert "No ridge of order 1 leaves the surface at all wavelengths." in caplog.text
    assert "spectrum_period_um" not in found.metrics


def test_a_mirror_has_no_peak_and_the_warning_says_what_was_compared(caplog: pytest.LogCaptureFixture) -> None:
    mirror = HeightField(np.zeros((40, 40)), 0.1, periodic=True)
    found = diffraction_peaks(mirror, near_um=2.0, **COARSE)
    assert np.isnan(found.period_um).all()
    assert found.metrics == {"peaks": 0}
    assert "At 9 of 9 wavelengths no peak of order 1 stands out: none within 20 percent of 2 um is" in caplog.text
    caplog.clear()
    assert np.isnan(diffraction_peaks(mirror, **COARSE).near_um)
    assert "No ridge of order 1" in caplog.text


def test_heights_scaled_to_nothing_leave_the_period(sawtooth: HeightField) -> None:
    """The shallower, the weaker the order, and the less its brightness moves the peak."""
    periods = periodicity(sawtooth)
    shallow = dataclasses.replace(sawtooth, height_um=sawtooth.height_um * 0.2)
    deep, flat = (diffraction_peaks(field, periods, line_middle=False).metrics for field in (sawtooth, shallow))
    assert flat["period_spread_nm"] < deep["period_spread_nm"]


def test_gaps_and_missing_periods_are_refused(sawtooth: HeightField) -> None:
    with pytest.raises(InputError, match="nmm looks for light where the surface's periods send it"):
        diffraction_peaks(sawtooth, evaluator="nmm")
    height = np.array(sawtooth.height_um)
    height[3, 4] = np.nan
    with pytest.raises(InputError, match="1 heights of the surface are not known"):
        diffraction_peaks(dataclasses.replace(sawtooth, height_um=height), **COARSE)


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"order": 0}, r"order is 0\s+where: +order\s+expected: an order"),
        ({"light_deg": 90}, r"light_deg is 90\s+where: +light_deg\s+expected: 0 to 89"),
        ({"near_um": 0}, r"near_um is 0\s+where: +near_um\s+expected: a number above 0"),
        ({"search_percent": 60}, r"search_percent is 60[\s\S]*1 to 50"),
        ({"contrast": 0.5}, r"contrast is 0.5[\s\S]*at least 1"),
        ({"angle_step_deg": 2}, r"angle_step_deg is 2[\s\S]*0.005 to 1"),
    ],
)
def test_impossible_settings_are_refused(setting: dict[str, float], message: str) -> None:
    usual = {
        "light_deg": 75,
        "order": 1,
        "near_um": None,
        "search_percent": 20,
        "contrast": 4,
        "wavelength_step": 5,
        "angle_step_deg": 0.05,
        "coherence_um": 65,
        "tolerance": 1e-3,
        "terms": None,
    }
    _check_diffraction_peaks(**usual)
    with pytest.raises((InputError, InputErrors), match=message):
        _check_diffraction_peaks(**{**usual, **setting})


@pytest.mark.parametrize("order", [1, 2, -1])
def test_the_search_ends_half_way_to_the_next_order(order: int) -> None:
    """Order 2 of this cosine outshines order 1 at most wavelengths, so a wider search would end on its flank."""
    surface = cosine_grating(depth_um=0.4)
    how = {"near_um": 2.5, "order": order, "light_deg": 10.0, "wavelength_step": 40.0}
    wide, narrow = (diffraction_peaks(surface, search_percent=part, **how) for part in (50.0, 15.0))
    known = np.isfinite(narrow.period_um)
    assert known.sum() >= 9
    np.testing.assert_allclose(wide.period_um[known], narrow.period_um[known], rtol=1e-9)


def test_lines_narrower_than_the_angular_step_are_told(sawtooth: HeightField, caplog: pytest.LogCaptureFixture) -> None:
    few = {"near_um": 2.5, "wavelength_step": 50.0}
    wide = diffraction_peaks(sawtooth, coherence_um=600.0, **few)
    assert "too narrow" not in caplog.text
    coarse = diffraction_peaks(sawtooth, coherence_um=2000.0, **few)
    assert "too narrow for steps of 0.05 degrees" in caplog.text
    caplog.clear()
    fine = diffraction_peaks(sawtooth, coherence_um=2000.0, angle_step_deg=0.01, **few)
    assert "too narrow" not in caplog.text
    off_nm = [1000 * abs(one.metrics["period_um"] - 2.5) for one in (wide, coarse, fine)]
    assert max(off_nm[0], off_nm[2]) < 1e-3
    assert off_nm[1] > 0.1


@pytest.mark.parametrize(("depth_um", "peaks"), [(1e-5, 0.0), (0.01, 9.0)])
def test_orders_fainter_than_the_tolerance_are_no_peaks(depth_um: float, peaks: float) -> None:
    """Order 1 of a cosine has the power ``J_1(pi |w| depth / lambda)^2``, against 4 times ``tolerance^2``."""
    surface = cosine_grating(depth_um=depth_um)
    found = diffraction_peaks(surface, evaluator="flss", terms=4, near_um=2.5, wavelength_step=50.0)
    assert found.metrics["peaks"] == peaks
