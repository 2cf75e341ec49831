from __future__ import annotations

import pytest

from pipeline.report.naming import duration, flat, labelled, moment, prose


@pytest.mark.parametrize(
    ("name", "value", "label", "text", "unit"),
    [
        ("orientation_error_mean_deg", 0.40023, "orientation error, mean", "0.4002", "°"),
        ("period_error_p95_percent", 3.0, "period error, 95th percentile", "3", "%"),
        ("offset_deg", -12.5, "offset", "−12.5", "°"),
        ("shift_max_px", 0.7, "shift, largest", "0.7", "px"),
        ("correlation_mean", 0.98765, "correlation, mean", "0.9877", ""),
        ("smooth.period_um", 1.4, "period (smooth)", "1.4", "µm"),
        ("s", 2.0, "s", "2", ""),
        ("depth_um", float("nan"), "depth", "not known", "µm"),
    ],
)
def test_the_unit_comes_off_the_end_of_a_figure(name: str, value: float, label: str, text: str, unit: str) -> None:
    figure = labelled(name, value)
    assert (figure.label, figure.text, figure.unit) == (label, text, unit)


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0.0042, "4 ms"),
        (0.0996, "0.10 s"),
        (1.234, "1.23 s"),
        (9.999, "10.0 s"),
        (59.97, "60.0 s"),
        (119.96, "2 min 00 s"),
        (185, "3 min 05 s"),
        (7384, "2 h 03 min"),
    ],
)
def test_durations_in_words(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_moments_are_told_in_utc() -> None:
    assert moment("2026-03-01T13:30:59+01:00") == "2026-03-01 12:30 UTC"
    assert moment("2026-03-01T12:30:00") == "2026-03-01 12:30 UTC"
    assert moment("yesterday") == "yesterday"


def test_double_backticks_are_code_and_markup_is_not() -> None:
    assert prose("``a < b`` <i>") == "<code>a &lt; b</code> &lt;i&gt;"


def test_settings_of_devices_are_unfolded_as_yaml_would_write_them() -> None:
    assert flat({"a": True, "rig": {"x": None, "camera": {"mm": 0.1}}, "none": {}}) == [
        ("a", "true"),
        ("rig.x", "null"),
        ("rig.camera.mm", "0.1"),
        ("none", "{}"),
    ]
