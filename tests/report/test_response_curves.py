"""The picture of a curve through measured Stokes parameters."""

from __future__ import annotations

import base64
import re

import cv2
import numpy as np

from pipeline.data.gratings import OrientationMap
from pipeline.optics.response_curve import FilmedGrating, relative_stokes
from pipeline.report.figures import figures_of
from pipeline.report.response_curves import response_curves

PARAMETERS = {
    "amplitude_ratio": 1.08,
    "phase_deg": 40.0,
    "retardation_deg": 8.0,
    "film_axis_deg": 0.0,
    "curve_misfit": 1.0,
}


def found_map(stokes: np.ndarray | None) -> OrientationMap:
    side = np.full((4, 4), 0.5, np.float32)
    return OrientationMap(
        side, side, side, side > 0, standard_error_rad=side / 100, parameters=PARAMETERS, stokes=stokes
    )


def test_the_points_lie_under_the_curve_with_s2_upwards() -> None:
    _, s1, s2 = relative_stokes(np.deg2rad([100.0]), FilmedGrating(1.08, *np.deg2rad([40.0, 8.0])))
    chart = str(response_curves(found_map(np.repeat(np.stack([s1, s2], 1), 50, 0).astype(np.float32)))[0].body)
    steps = re.search(r'<path class="curve" d="M([^Z]*)Z', chart)
    box = re.search(r'<image x="([\d.]+)" y="([\d.]+)" width="([\d.]+)" height="([\d.]+)"', chart)
    data = re.search(r"base64,([^\"]+)", chart)
    assert steps
    assert box
    assert data
    curve = np.array([[float(v) for v in step.split(",")] for step in steps[1].split()])
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(data[1]), np.uint8), cv2.IMREAD_UNCHANGED)
    row, column = np.argwhere(picture[..., 3] > 0)[0]
    left, top, width, height = (float(v) for v in box.groups())
    point = left + (column + 0.5) * width / picture.shape[1], top + (row + 0.5) * height / picture.shape[0]
    nearest = np.argmin(np.hypot(*(curve - point).T))
    assert np.hypot(*(curve[nearest] - point)) < 3
    assert abs(nearest / len(curve) * 180 - 100) < 2


def test_a_map_without_points_has_no_curve() -> None:
    assert response_curves(found_map(None)) == []


def test_the_stated_error_is_drawn_in_degrees() -> None:
    captions = {figure.title: figure.caption for figure in figures_of(found_map(None))}
    assert "median 0.286°" in captions["standard error"]
