"""Print layouts: gratings on a printer's grid and steps, in figures, tables and files that are read back."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.printing import PrintLayout
from pipeline.errors import InputError
from pipeline.report.figures import figures_of
from pipeline.report.writers import WRITERS
from pipeline.stages.capture.orientation_map import orientation_map
from pipeline.stages.capture.period_map import period_map
from pipeline.stages.extract.printed_orientation import printed_orientation
from pipeline.stages.extract.printed_period import printed_period
from pipeline.stages.render.print_layout import print_layout

DEGREES = np.array([[0.0, 11.0, 22.0, 33.0], [94.0, 105.0, np.nan, 127.0], [158.0, 169.0, 177.0, 179.0]], np.float32)
PERIOD = np.array([[1.0, 1.1, 1.2, 1.3], [1.4, 1.5, np.nan, 1.7], [1.8, 1.9, 2.0, 2.1]], np.float32)


def maps() -> tuple[OrientationMap, PeriodMap]:
    orientation = OrientationMap.of_angles(np.deg2rad(DEGREES), pixel_mm=0.1, absolute=True)
    return orientation, PeriodMap(PERIOD, np.isfinite(PERIOD), 0.1, relative=False)


def test_a_printer_of_fine_steps_prints_what_it_is_given() -> None:
    layout = print_layout(*maps(), dot_mm=0.1, angle_step_deg=1.0, density_step_per_mm=0.001)
    np.testing.assert_allclose(layout.orientation_deg, DEGREES, atol=1e-4)
    np.testing.assert_allclose(layout.lines_per_mm, 1000 / PERIOD, rtol=1e-5)
    assert layout.metrics["orientation_print_max_deg"] < 1e-4
    assert layout.metrics["coverage_percent"] == 100
    assert layout.metrics["dots"] == 11
    np.testing.assert_allclose(printed_period(layout).period_um, PERIOD, rtol=1e-5)
    back = printed_orientation(layout)
    np.testing.assert_allclose(np.rad2deg(back.orientation_rad), DEGREES, atol=1e-4)
    assert (back.pixel_mm, back.absolute) == (0.1, True)
    np.testing.assert_array_equal(back.mask, np.isfinite(DEGREES))


def test_steps_of_the_printer_are_kept_and_their_cost_is_told() -> None:
    layout = print_layout(*maps(), dot_mm=0.1, angle_step_deg=10.0, lines_per_mm=(500.0, 1000.0))
    expected = [[0, 10, 20, 30], [90, 100, np.nan, 130], [160, 170, 0, 0]]
    np.testing.assert_allclose(layout.orientation_deg[[0, 2]], np.array(expected)[[0, 2]], atol=1e-4)
    known = np.array([0, 1, 2, 3, 4, 5, 3, 2, 1, 3, 1])  # 105 lies between 100 and 110
    assert layout.metrics["orientation_step_mean_deg"] == pytest.approx(known.mean(), rel=1e-5)
    assert layout.metrics["orientation_step_max_deg"] == pytest.approx(5, rel=1e-5)
    density = np.array([1000, 1000, 1000, 1000, 500, 500, np.nan, 500, 500, 500, 500, 500]).reshape(3, 4)
    np.testing.assert_array_equal(layout.lines_per_mm, density)
    cost = np.abs(PERIOD - 1000 / density)
    assert layout.metrics["period_step_mean_um"] == pytest.approx(np.nanmean(cost), rel=1e-5)
    assert layout.metrics["period_step_max_um"] == pytest.approx(0.6, rel=1e-5)


def test_coarse_dots_take_the_grating_under_their_middle_and_all_else_counts_as_an_error() -> None:
    degrees = np.tile(np.float32([10, 20, 30]), (6, 2))  # two dots of three pixels, each with 20 in its middle
    orientation = OrientationMap.of_angles(np.deg2rad(degrees), pixel_mm=0.01, absolute=True)
    period = PeriodMap(np.full((6, 6), 1.25, np.float32), np.ones((6, 6), bool), 0.01, relative=False)
    layout = print_layout(orientation, period, dot_mm=0.03)
    np.testing.assert_allclose(layout.orientation_deg, np.full((2, 2), 20), atol=1e-5)
    assert layout.metrics["orientation_step_max_deg"] < 1e-5
    assert layout.metrics["orientation_print_mean_deg"] == pytest.approx(20 / 3, rel=1e-5)
    assert layout.metrics["orientation_print_max_deg"] == pytest.approx(10, rel=1e-5)


def files(folder: Path) -> tuple[PrintLayout, list[Path]]:
    layout = print_layout(*maps(), dot_mm=0.1, angle_step_deg=5.0)
    return layout, list(WRITERS["PrintLayout"](folder / "layout", layout))


def test_the_table_names_every_dot_with_its_place_y_up(tmp_path: Path) -> None:
    layout, written = files(tmp_path)
    with next(path for path in written if path.suffix == ".csv").open() as file:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(file)]
    assert len(rows) == 11
    for row in rows:
        place = int(row["row"]), int(row["column"])
        assert row["orientation_deg"] == pytest.approx(layout.orientation_deg[place], rel=1e-5)
        assert row["lines_per_mm"] == pytest.approx(layout.lines_per_mm[place], rel=1e-5)
    assert (rows[0]["x_mm"], rows[0]["y_mm"]) == pytest.approx((-0.15, 0.1))
    assert (rows[-1]["x_mm"], rows[-1]["y_mm"]) == pytest.approx((0.15, -0.1))


def test_the_files_are_read_back_as_maps(tmp_path: Path) -> None:
    layout, written = files(tmp_path)
    orientation, period = printed_orientation(layout), printed_period(layout)
    exr = tmp_path / "layout.exr"
    assert exr in written
    read = orientation_map(file=exr)
    np.testing.assert_allclose(read.orientation_rad, orientation.orientation_rad, atol=1e-7)
    assert (read.pixel_mm, read.absolute) == (pytest.approx(0.1), True)
    np.testing.assert_allclose(period_map(file=exr).period_um, period.period_um, rtol=1e-6)
    angles = orientation_map(file=tmp_path / "layout_orientation_deg.tif", range_deg=(0.0, 1.0))
    np.testing.assert_allclose(angles.orientation_rad, orientation.orientation_rad, atol=1e-6)
    densities = period_map(file=tmp_path / "layout_lines_per_mm.tif", range_lines_per_mm=(0.0, 1.0))
    np.testing.assert_allclose(densities.period_um, period.period_um, rtol=1e-6)


def test_the_report_shows_orientation_and_line_density(tmp_path: Path) -> None:
    layout, _ = files(tmp_path)
    shown = figures_of(layout)
    assert [figure.title for figure in shown] == ["orientation", "line density"]
    assert all("Dots 100 µm apart" in str(figure.caption) for figure in shown)


def test_what_the_maps_do_not_know_is_told(caplog: pytest.LogCaptureFixture) -> None:
    orientation, period = maps()
    print_layout(orientation, period, dot_mm=0.1)
    assert not caplog.records
    print_layout(replace(orientation, absolute=False), replace(period, relative=True), dot_mm=0.1)
    assert "by which the print may be turned" in caplog.text
    assert "only ratios of the periods were measured" in caplog.text


def test_what_cannot_be_printed_is_refused() -> None:
    orientation, period = maps()
    with pytest.raises(InputError, match=r"angle_step_deg is 7\s[\s\S]*a step that divides 180"):
        print_layout(orientation, period, angle_step_deg=7.0)
    with pytest.raises(InputError, match=r"lines_per_mm is \[\]\s[\s\S]*line densities above 0"):
        print_layout(orientation, period, lines_per_mm=())
    with pytest.raises(InputError, match=r"differ in shape"):
        print_layout(orientation, replace(period, period_um=period.period_um[:2], mask=period.mask[:2]))
    with pytest.raises(InputError, match=r"do not know their pixel pitch\s+where: +pixel_mm"):
        print_layout(replace(orientation, pixel_mm=None), replace(period, pixel_mm=None))
    hole = DEGREES.copy()
    hole[:, 1:3] = np.nan
    with pytest.raises(InputError, match=r"no dot falls on a grating\s[\s\S]*finer dots than 0.4 mm"):
        print_layout(OrientationMap.of_angles(hole, pixel_mm=0.1, absolute=True), period, dot_mm=0.4)
