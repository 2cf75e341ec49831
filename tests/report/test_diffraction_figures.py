"""Figures and files of diffraction in the plane of incidence, and behind slits."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

from pipeline.data.diffraction import DiffractionPeaks, SlitPatterns
from pipeline.data.pictures import Pictures
from pipeline.optics.diffraction.order_peaks import order_angle
from pipeline.report.figures import figures_of
from pipeline.report.slit_patterns import strips
from pipeline.report.writers import WRITERS
from pipeline.stages.render.slits import slits

LIGHT = float(np.deg2rad(75))


def peaks(found: int = 9) -> DiffractionPeaks:
    """Order 1 of 2.5 um at nine wavelengths, found at the first so many."""
    wavelength = np.arange(380.0, 781, 50)
    view = np.deg2rad(np.linspace(-89.5, 89.5, 1791))
    angle = order_angle(2.5, wavelength / 1000, 1, LIGHT)
    response = np.exp(-(((view - angle[:, None]) / 0.01) ** 2)).astype(np.float32)
    kept = np.arange(9) < found
    period, figures = np.where(kept, 2.5, np.nan), {"peaks": float(found)}
    if found:
        figures |= {"period_um": 2.5, "period_spread_nm": 0.0, "spectrum_period_um": 2.49}
    return DiffractionPeaks(
        wavelength, view, response, np.where(kept, angle, np.nan), period, LIGHT, 0.0, 1, 2.5, "pq", "A blaze", figures
    )


def test_peaks_lie_on_the_grating_equation_in_the_map() -> None:
    response, period = figures_of(peaks())
    dots = re.findall(r'class="maximum" cx="([\d.]+)" cy="([\d.]+)"', response.body)
    (line,) = re.findall(r'class="order" d="M([^"]+)"', response.body)
    assert [f"{x},{y}" for x, y in dots] == line.split()
    assert "Blue: the grating equation for their mean period, 2500.000 nm. Evaluator: pq." in response.caption
    assert "light at 75°" in response.caption
    assert "2500.000 nm, the line, with a standard deviation of 0 nm. The surface's own spectrum says 2490" in (
        period.caption
    )


def test_gaps_are_left_in_the_curve_and_nothing_is_drawn_of_no_peak() -> None:
    assert figures_of(peaks(4))[0].body.count('class="maximum"') == 4
    (alone,) = figures_of(peaks(0))
    assert "No peak stands out." in alone.caption
    assert "maximum" not in alone.body
    assert 'class="order"' not in alone.body


def test_the_files_hold_the_response_and_a_row_for_each_wavelength(tmp_path: Path) -> None:
    value = peaks(4)
    exr, table = WRITERS["DiffractionPeaks"](tmp_path / "fit", value)
    image = oiio.ImageBuf(str(exr))
    assert image.get_pixels(oiio.FLOAT)[..., 0].tolist() == value.response.tolist()
    assert image.spec().getattribute("first_view_deg") == pytest.approx(-89.5)
    assert image.spec().getattribute("last_wavelength_nm") == 780
    rows = list(csv.DictReader(table.open()))
    assert [float(row["wavelength_nm"]) for row in rows] == value.wavelength_nm.tolist()
    assert [row["period_um"] for row in rows] == ["2.5"] * 4 + ["nan"] * 5
    assert float(rows[0]["peak_deg"]) == pytest.approx(float(rows[0]["grating_deg"]))


@pytest.fixture(scope="module")
def screen() -> SlitPatterns:
    return slits(counts=[1, 7], half_width_mm=2.0)


def test_a_curve_and_two_strips_for_each_number_of_slits(screen: SlitPatterns) -> None:
    curves, colours = figures_of(screen)
    assert curves.body.count('class="curve"') == 2
    assert colours.body.count("<image") == 4
    for figure in (curves, colours):
        assert ">1 slit<" in figure.body
        assert ">7 slits<" in figure.body
    assert "at 500 nm" in curves.caption


def test_strips_are_green_above_and_white_in_the_middle_below(screen: SlitPatterns) -> None:
    picture = strips(screen)
    middle = len(screen.position_mm) // 2
    assert picture[0, middle].tolist() == pytest.approx([0, 1, 0.64], abs=0.01)
    assert picture[24, middle].tolist() == pytest.approx([1, 1, 1], abs=1e-3)
    assert picture[48:56].max() == 0
    first = int(np.argmin(np.abs(screen.position_mm - screen.metrics["fringe_mm"])))
    assert np.ptp(picture[80, first]) > 0.5
    assert np.ptp(picture[24, first]) < 0.2


def test_the_files_of_slits(screen: SlitPatterns, tmp_path: Path) -> None:
    table, exr, png = WRITERS["SlitPatterns"](tmp_path / "slits", screen)
    rows = list(csv.DictReader(table.open()))
    assert list(rows[0]) == ["position_mm", "intensity_1", "intensity_7"]
    assert [float(row["intensity_7"]) for row in rows] == screen.intensity[1].tolist()
    assert oiio.ImageBuf(str(exr)).get_pixels(oiio.FLOAT).tolist() == screen.white_rgb.tolist()
    spec = oiio.ImageBuf(str(exr)).spec()
    assert spec.getattribute("first_position_mm") == -2
    assert spec.getattribute("last_position_mm") == 2
    assert spec.getattribute("slits_of_rows") == "1 7"
    assert oiio.ImageBuf(str(png)).spec().height == 2 * 48 + 8


def test_each_labelled_picture_says_what_it_shows(tmp_path: Path) -> None:
    value = Pictures(np.ones((2, 4, 5, 3), np.float32), ("900 mm away", "100 mm away"))
    files = WRITERS["Pictures"](tmp_path / "shading", value)
    labels = [oiio.ImageBuf(str(f)).spec().getattribute("label") for f in files if f.suffix == ".exr"]
    assert labels == ["900 mm away", "100 mm away"]
