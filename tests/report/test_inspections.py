"""Defects in the report: numbered where they lie, listed in a table and in a CSV file."""

from __future__ import annotations

import csv
import io
import re

import numpy as np

from pipeline.data.gratings import OrientationMap
from pipeline.data.inspection import Defects, Inspection
from pipeline.report.figures import figures_of
from pipeline.report.inspections import csv_of
from pipeline.report.writers import WRITERS


def two_defects() -> Defects:
    labels = np.zeros((40, 60), np.int32)
    labels[4:8, 40:50] = 1  # upper right
    labels[30:34, 10:14] = 2  # lower left
    return Defects(
        ("turned", "missing"),
        np.array([[1.5, 1.4], [-1.8, -1.2]]),
        np.array([0.4, 0.16]),
        np.array([1.08, 0.57]),
        np.array([np.deg2rad(-2.5), np.nan]),
        np.array([1.001, np.nan]),
        np.array([80.0, 30.0]),
        labels,
        0.1,
    )


def inspected(defects: Defects) -> Inspection:
    shape = defects.labels.shape
    ones, mask = np.ones(shape, np.float32), np.ones(shape, bool)
    suspect = OrientationMap(ones, ones, ones, mask, 0.1)
    return Inspection(defects, suspect, ones, 5.9, np.array([0.2, -0.1]), 0.05, 0.0, {"defects": 2.0})


def test_boxes_stand_where_the_defects_lie_with_y_up() -> None:
    figures = {figure.title: figure for figure in figures_of(inspected(two_defects()))}
    boxes = re.findall(r'<rect class="mark" x="([\d.]+)" y="([\d.]+)"', str(figures["defects"].body))
    (right, upper), (left, lower) = ((float(x), float(y)) for x, y in boxes)
    assert left < right
    assert upper < lower
    words = re.findall(r'<text class="note"[^>]*>(\d)</text>', str(figures["defects"].body))
    assert words == ["1", "2"]
    assert "2 numbered boxes" in figures["defects"].caption


def test_the_table_leaves_out_the_turn_of_what_has_no_grating() -> None:
    table = next(str(f.body) for f in figures_of(inspected(two_defects())) if f.title == "list")
    rows = [re.findall(r"<td[^>]*>(.*?)</td>", row) for row in re.findall(r"<tr>(.*?)</tr>", table)][1:]
    assert rows[0][1:4] == ["turned", "1.500", "1.400"]
    assert rows[0][6] == "−2.50"
    assert rows[1][6:8] == ["–", "–"]


def test_the_file_has_a_line_a_defect_with_units_in_its_head(tmp_path) -> None:
    rows = list(csv.DictReader(io.StringIO(csv_of(two_defects()))))
    assert [row["kind"] for row in rows] == ["turned", "missing"]
    assert float(rows[0]["turn_deg"]) == -2.5
    assert rows[1]["period_ratio"] == ""
    files = {path.name for path in WRITERS["Inspection"](tmp_path / "node", inspected(two_defects()))}
    assert files == {"node.csv", "node.exr"}


def test_an_item_without_defects_has_no_table() -> None:
    empty = np.zeros(0)
    none = Defects((), np.zeros((0, 2)), empty, empty, empty, empty, empty, np.zeros((9, 9), np.int32), 0.1)
    figures = figures_of(inspected(none))
    assert [figure.title for figure in figures] == ["defects", "significance"]
    assert "No defects were found" in figures[0].caption
    assert figures_of(none) == []
