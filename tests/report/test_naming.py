from __future__ import annotations

import pytest

from pipeline.report.naming import duration, flat, labelled, moment, plain, prose, setting_label, with_unit


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


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (100.0, 2, "100"),
        (99.96, 2, "100"),
        (1234.5, 2, "1234"),
        (0.0012345, 2, "0.0012"),
        (0.5, 4, "0.5"),
        (0.0, 2, "0"),
        (-17.25, 3, "-17.2"),
        (123456.7, 4, "123457"),
        (1e-15, 2, "1e-15"),
        (2.5e7, 2, "2.5e+07"),
        (float("inf"), 2, "inf"),
    ],
)
def test_numbers_are_written_plainly(value: float, digits: int, text: str) -> None:
    assert plain(value, digits) == text


@pytest.mark.parametrize(
    ("setting", "label"),
    [
        ("graph.misread.scatter_deg", "misread scatter (°)"),
        ("rig.camera.shift_px", "camera shift (px)"),
        ("phase_deg", "phase (°)"),
        ("graph.sample.period_um", "sample period (µm)"),
        ("graph.dust.noise_percent", "dust noise (%)"),
        ("scene", "scene"),
    ],
)
def test_the_unit_comes_off_the_end_of_a_setting(setting: str, label: str) -> None:
    assert setting_label(setting) == label


def test_only_numbers_have_a_unit() -> None:
    assert [with_unit(*pair) for pair in (("8", "°"), ("0.5", "mm"), ("null", "°"), ("3", ""))] == [
        "8°",
        "0.5 mm",
        "null",
        "3",
    ]
