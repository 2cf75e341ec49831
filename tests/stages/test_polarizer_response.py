"""Simulated maps over polariser and orientation, their pre-normalisation, and how straight their row maxima are."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.codebase.source import Sources
from pipeline.data.polarization import PolarizerResponse
from pipeline.errors import InputError, InputErrors
from pipeline.graph.catalog import Catalog
from pipeline.optics.fresnel import zeroth_order_ratio
from pipeline.optics.metals import METALS
from pipeline.stages.evaluate.row_maxima import row_maxima
from pipeline.stages.extract.prenormalize import prenormalize
from pipeline.stages.simulate.polarizer_response import polarizer_response

METAL_NAMES = sorted(METALS)


def figures(**settings: object) -> dict[str, float]:
    response = polarizer_response(**settings)
    return dict(row_maxima(response, prenormalize(response)).metrics)


def test_the_map_has_orientations_down_its_rows_and_the_polariser_along_them() -> None:
    found = polarizer_response(amplitude_ratio=1.1, phase_deg=45, polarizer_count=20, orientation_count=30)
    assert found.intensity.shape == (30, 20)
    psi, theta = np.deg2rad(9 * 4), np.deg2rad(6 * 7)
    expected = 1 + (1.1**2 - 1) * (1 - np.cos(2 * (psi - theta))) / 2
    expected -= 1.1 * np.sin(np.pi / 4) * np.sin(2 * (psi - theta))
    assert found.intensity[7, 4] == pytest.approx(expected)
    assert found.row_maximum_rad[7] == pytest.approx((theta + found.offset_rad) % np.pi)


@pytest.mark.parametrize("amplitude_ratio", [1e-4, 0.5, 1.1, 1.5, 1e4])
@pytest.mark.parametrize("phase_deg", [30, 45, 60, 90, 180])
def test_case_i_lies_on_the_line_for_every_ratio_of_figure_14(amplitude_ratio: float, phase_deg: float) -> None:
    found = figures(amplitude_ratio=amplitude_ratio, phase_deg=phase_deg)
    assert found["deviation_max_deg"] < 1e-9
    assert found["winding"] == 1
    assert found["cosine_error_rms"] < 1e-10


@pytest.mark.parametrize("metal", METAL_NAMES)
def test_case_i_lies_on_the_line_for_every_metal_though_hardly_anything_is_left_to_see(metal: str) -> None:
    found = figures(metal=metal)
    assert found["deviation_max_deg"] < 1e-7
    assert 1e-5 < found["amplitude_min"] < 1e-3


@pytest.mark.parametrize(
    ("phase_deg", "plain_deg", "prenormalized_deg"), [(164, 6.9, 0.07), (172, 14.8, 0.05), (176, 32, 0.04)]
)
def test_figures_15b_to_15d(phase_deg: float, plain_deg: float, prenormalized_deg: float) -> None:
    """Increasingly far from the line as zeta grows, and on it again after pre-normalisation."""
    found = figures(amplitude_ratio=1.001, phase_deg=phase_deg, retardation_deg=3)
    assert found["deviation_mean_deg"] == pytest.approx(plain_deg, rel=0.02)
    assert found["prenormalized_deviation_mean_deg"] == pytest.approx(prenormalized_deg, abs=0.006)


@pytest.mark.parametrize("phase_deg", [164.0, 172.0, 176.0])
def test_the_line_is_lost_where_the_film_outweighs_the_grating(phase_deg: float) -> None:
    """Near R = -1 the grating gives a cosine of amplitude r sin(zeta), and the film adds sin(2 delta) to each row."""
    edge = np.rad2deg(np.arcsin(np.sin(np.deg2rad(phase_deg)))) / 2
    settings = {"amplitude_ratio": 1.0, "phase_deg": phase_deg, "orientation_count": 1440}
    assert figures(retardation_deg=0.93 * edge, **settings)["winding"] == 1
    assert figures(retardation_deg=1.07 * edge, **settings)["winding"] == 0


@pytest.mark.parametrize("metal", METAL_NAMES)
def test_a_metal_whose_axes_are_kept_needs_prenormalisation_under_the_thinnest_film(metal: str) -> None:
    found = figures(metal=metal, p_axis="kept", retardation_deg=10)
    assert found["winding"] == 0
    assert found["prenormalized_winding"] == 1
    assert found["prenormalized_deviation_mean_deg"] < 0.5


@pytest.mark.parametrize("metal", METAL_NAMES)
def test_a_metal_in_the_papers_axes_leaps_between_two_lines(metal: str) -> None:
    found = figures(metal=metal, retardation_deg=10)
    assert found["deviation_mean_deg"] > 40
    assert found["branch_deviation_mean_deg"] < 0.5
    assert found["prenormalized_winding"] == 2


def test_a_metal_multiplies_what_the_grating_gives() -> None:
    found = polarizer_response(metal="gold", amplitude_ratio=1.2, phase_deg=40, incidence_deg=8, film_index=1.5)
    flat = zeroth_order_ratio(METALS["gold"].index, incidence_rad=np.deg2rad(8), film_index=1.5)
    assert found.amplitude_ratio == pytest.approx(1.2 * abs(flat))
    assert found.phase_rad == pytest.approx(np.deg2rad(40) + np.angle(flat))


def test_every_metal_can_be_named_and_no_other() -> None:
    settings = Catalog(Sources()).stages["simulate.polarizer_response"].settings
    choices = settings["metal"][1].items[0].choices
    assert set(choices) == set(METALS)


def test_what_the_film_adds_to_all_orientations_goes_with_the_mean() -> None:
    response = polarizer_response(amplitude_ratio=1.1, phase_deg=170, retardation_deg=5)
    found = prenormalize(response)
    np.testing.assert_allclose(found.intensity.mean(axis=0), 0, atol=1e-12)
    np.testing.assert_allclose(np.diff(found.intensity, axis=0), np.diff(response.intensity, axis=0), atol=1e-12)
    assert found.prenormalized
    assert not response.prenormalized


def test_without_a_film_prenormalisation_moves_no_maximum() -> None:
    response = polarizer_response(amplitude_ratio=1.1, phase_deg=45)
    np.testing.assert_allclose(prenormalize(response).row_maximum_rad, response.row_maximum_rad, atol=1e-9)


def test_flat_rows_have_no_figures_but_their_amplitude(caplog: pytest.LogCaptureFixture) -> None:
    response = polarizer_response()
    assert "180 of 180 rows are flat" in caplog.text
    assert response.offset_rad is None
    found = row_maxima(response, prenormalize(response))
    assert set(found.metrics) == {"amplitude_min"}
    assert np.isnan(found.deviation_rad).all()


def test_a_map_alone_is_evaluated_alone() -> None:
    found = row_maxima(polarizer_response(amplitude_ratio=1.1, phase_deg=45, retardation_deg=10))
    assert np.isnan(found.prenormalized_rad).all()
    assert not [name for name in found.metrics if name.startswith("prenormalized")]
    assert np.rad2deg(np.abs(found.deviation_rad)).max() == pytest.approx(found.metrics["deviation_max_deg"])


def test_maps_over_different_orientations_are_refused() -> None:
    def of(count: int) -> PolarizerResponse:
        return polarizer_response(amplitude_ratio=1.1, phase_deg=45, orientation_count=count)

    with pytest.raises(InputError, match="different orientations"):
        row_maxima(of(24), of(30))


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"amplitude_ratio": -1.0}, "amplitude_ratio is -1"),
        ({"incidence_deg": 90.0}, "incidence_deg is 90"),
        ({"film_index": 0.9}, "film_index is 0.9"),
        ({"polarizer_count": 3}, "polarizer_count is 3"),
        ({"orientation_count": 4}, "orientation_count is 4"),
        ({"orientation_count": 100_000}, "orientation_count is 100000"),
    ],
)
def test_what_has_no_map_is_refused(settings: dict[str, float], said: str) -> None:
    with pytest.raises(InputError, match=said):
        polarizer_response(**settings)


def test_everything_wrong_is_told_at_once() -> None:
    with pytest.raises(InputErrors, match=r"(?s)film_index.*polarizer_count"):
        polarizer_response(film_index=0.5, polarizer_count=1)
