"""Sheets in light probes as stages: orientation of the picture, evaluators, files, and what is refused."""

from __future__ import annotations

import logging
from pathlib import Path

import numpy as np
import OpenImageIO
import pytest

import pipeline
from pipeline.bench import Experiment
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.data.light_probes import LightProbe
from pipeline.devices import virtual_environment
from pipeline.errors import InputError, InputErrors
from pipeline.graph.config import options
from pipeline.optics.environment.probe import texel_directions
from pipeline.stages.capture.light_probe import light_probe as read
from pipeline.stages.render.environment import environment
from pipeline.stages.simulate.light_probe import light_probe as draw

PROBES = Path(__file__).parents[3] / "shared/data/environment"


def maps(size: int = 40, pixel_mm: float = 4.0, varying: bool = False) -> tuple[OrientationMap, PeriodMap]:
    y, x = np.mgrid[:size, :size]
    angle = ((0.11 * x + 0.07 * y) % np.pi).astype(np.float32)
    period = (1.3 + (0.2 * np.sin(x / 9) if varying else 0 * x)).astype(np.float32)
    mask = np.ones((size, size), bool)
    return OrientationMap.of_angles(angle, pixel_mm=pixel_mm, absolute=True), PeriodMap(period, mask, pixel_mm)


def spot(towards_right_of_middle: int) -> LightProbe:
    rgb = np.full((32, 64, 3), 1e-3, np.float32)
    rgb[15:17, 31 + towards_right_of_middle : 33 + towards_right_of_middle] = 1
    return LightProbe(rgb)


def middle_of_light(probe: LightProbe, **settings: object) -> int:
    light = environment(*maps(), probe, depth_um=0.0, **settings).rgb[0].sum(axis=(0, 2))
    return round(float(light @ np.arange(len(light)) / light.sum()))


def test_the_probe_is_mirrored_and_turns() -> None:
    assert middle_of_light(spot(0)) in (19, 20)
    assert middle_of_light(spot(2)) < 15  # to the right as seen from the sheet: the viewer's left
    assert middle_of_light(spot(0), rotation_deg=[11.25]) > 24  # anticlockwise from above: to the viewer's right
    assert middle_of_light(spot(2), rotation_deg=[11.25]) in (19, 20)


def test_a_sheet_that_leans_back_mirrors_what_is_higher() -> None:
    upright, leaning = (
        environment(*maps(), spot(0), depth_um=0.0, tilt_deg=tilt).rgb[0].sum(axis=(1, 2)) for tilt in (0.0, 6.0)
    )
    rows = np.arange(len(upright))
    assert upright @ rows / upright.sum() == pytest.approx(19.5, abs=0.1)
    assert leaning @ rows / leaning.sum() > 24  # what is level with the eye is seen further down


@pytest.mark.parametrize("evaluator", ["ordered", "low_rank", "auto"])
@pytest.mark.parametrize("varying", [False, True])
def test_fast_evaluators_keep_the_tolerance_and_say_so(
    evaluator: str, varying: bool, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    probe = LightProbe((1 + 0.5 * texel_directions(24, 48) ** 3).astype(np.float32))
    settings = {"size_px": [120, 120], "samples": 2, "tolerance": 0.02, "tilt_deg": 20.0}
    exact = environment(*maps(varying=varying), probe, evaluator="reference", **settings).rgb
    caplog.clear()
    found = environment(*maps(varying=varying), probe, evaluator=evaluator, **settings).rgb
    error = np.abs(found - exact).max(axis=-1)
    assert np.percentile(error, 99.9) < 0.02 * exact.max()
    told = " ".join(record.getMessage() for record in caplog.records)
    assert "look-ups, every" in told
    assert ("Evaluator" in told) == (evaluator == "auto")
    assert not [record for record in caplog.records if record.levelno == logging.WARNING]


@pytest.mark.parametrize("evaluator", ["ordered", "low_rank"])
def test_a_sheet_without_depth_is_a_mirror_to_every_evaluator(evaluator: str) -> None:
    probe = draw(scene="room", rows=24, lamp_deg=20.0)
    exact, found = (environment(*maps(), probe, depth_um=0.0, evaluator=one).rgb for one in ("reference", evaluator))
    np.testing.assert_allclose(found, exact, rtol=1e-3)


def test_the_mean_of_many_points_of_white_is_white() -> None:
    white = draw(scene="uniform", rows=8)
    rgb = environment(*maps(), white, depth_um=0.0, samples=3, size_px=[10, 10]).rgb
    np.testing.assert_allclose(rgb, 1, rtol=1e-3)


def test_low_rank_knows_where_in_a_pixel_its_points_lie() -> None:
    """Gratings at the upper right of each pixel alone, in light that changes towards there."""
    x, y = texel_directions(48, 96)[..., 0], texel_directions(48, 96)[..., 1]
    probe = LightProbe(np.repeat((1 + 0.9 * np.sin(3 * (x + y)))[..., None], 3, axis=-1).astype(np.float32))
    period = np.full((48, 48), np.nan, np.float32)
    period[::4, 3::4] = 5.0
    sheet = OrientationMap.of_angles(np.zeros((48, 48), np.float32), pixel_mm=10.0, absolute=True)
    found, exact = (
        environment(
            *(sheet, PeriodMap(period, np.isfinite(period), 10.0), probe),
            **{"evaluator": one, "samples": 4, "size_px": [12, 12], "tolerance": 0.05, "depth_um": 0.2},
        ).rgb
        for one in ("low_rank", "reference")
    )
    assert np.abs(found - exact).max() < 0.05 * exact.max()


def test_auto_leaves_low_rank_where_nodes_miss_a_small_lamp(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(virtual_environment, "_APART_TEXELS", 60.0)
    caplog.set_level(logging.INFO)
    settings = {"size_px": [160, 160], "samples": 1, "tolerance": 0.04}
    found, low_rank, exact = (
        environment(*maps(), spot(0), evaluator=one, **settings).rgb for one in ("auto", "low_rank", "reference")
    )
    missed, kept = (np.percentile(np.abs(one - exact), 99.9) / exact.max() for one in (low_rank, found))
    assert kept < 0.04 < missed
    assert "Evaluator low_rank" in caplog.text
    assert "values would differ" in caplog.text
    assert "evaluator=ordered is nearer, tolerance=" in caplog.text


def test_a_tolerance_bounds_the_light_that_is_left_out(caplog: pytest.LogCaptureFixture) -> None:
    """Under a sun so bright that all of the sky is less than the tolerance everywhere."""
    caplog.set_level(logging.INFO)
    probe = draw(scene="outdoors", rows=64, lamp_deg=4.0)
    exact, found = (
        environment(*maps(), probe, tilt_deg=20.0, evaluator=one, tolerance=0.1).rgb for one in ("reference", "ordered")
    )
    assert 0.88 < found.sum() / exact.sum() < 1.01
    assert "percent of the light, differ" in caplog.text


def test_a_pixel_is_the_mean_of_as_many_points_as_it_needs(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    probe = draw(scene="room", rows=24, lamp_deg=20.0)
    even = OrientationMap.of_angles(np.full((40, 40), 0.3, np.float32), pixel_mm=4.0, absolute=True)
    environment(even, maps()[1], probe, size_px=[8, 8])
    assert "mean of 1 x 1 points" in caplog.text
    caplog.clear()
    found = environment(*maps(), probe, size_px=[8, 8]).rgb
    assert "mean of 1 x 1 points" not in caplog.text
    assert "a side change what is shown by" in caplog.text
    exact = environment(*maps(), probe, size_px=[8, 8], samples=16, evaluator="reference").rgb
    assert np.sqrt(np.mean((found - exact) ** 2)) < 0.02 * exact.max()


def test_what_does_not_keep_the_tolerance_says_what_would(caplog: pytest.LogCaptureFixture) -> None:
    environment(*maps(), draw(scene="room", rows=32), evaluator="ordered", wavelength_step_nm=40.0, tolerance=0.003)
    assert "wavelength_step_nm=5 is finer, tolerance=0." in caplog.text
    caplog.clear()
    environment(*maps(), draw(scene="room", rows=32), evaluator="ordered", tolerance=0.0001)
    assert "evaluator=reference sums all, tolerance=0.0" in caplog.text


def test_look_ups_are_chosen_where_a_fine_pattern_is_and_not_between() -> None:
    probe = draw(scene="room", rows=24, lamp_deg=20.0)
    orientation, period = maps(192, 0.8)
    y, x = np.mgrid[:192, :192]
    lit = (x % 4 == 1) & (y % 4 == 3)
    dots = PeriodMap(np.where(lit, period.period_um, np.nan), lit, 0.8)
    exact, found = (environment(orientation, dots, probe, evaluator=one).rgb[0] for one in ("reference", "ordered"))
    assert np.abs(found - exact).max() < 0.01 * exact.max()


@pytest.mark.parametrize(
    ("period_um", "settings", "told"),
    [(1.3, {"orders": "second order"}, "Orders expanded"), (0.5, {}, "orders that cannot leave")],
)
def test_it_says_where_the_theory_does_not_hold(
    period_um: float, settings: dict[str, object], told: str, caplog: pytest.LogCaptureFixture
) -> None:
    orientation, period = maps(8)
    short = PeriodMap(np.full_like(period.period_um, period_um), period.mask, 4.0)
    probe = draw(scene="uniform", rows=8)
    environment(orientation, period, probe, rotation_deg=[0.0, 30.0])
    assert not [record for record in caplog.records if record.levelno == logging.WARNING]
    environment(orientation, short, probe, rotation_deg=[0.0, 30.0], **settings)
    assert [told in record.getMessage() for record in caplog.records if record.levelno == logging.WARNING] == [True]


def test_more_than_memory_holds_is_refused() -> None:
    probe = draw(scene="uniform", rows=8)
    with pytest.raises(InputError, match="30 pictures of 4000 x 4000 pixels do not fit"):
        environment(*maps(8), probe, size_px=[4000, 4000], rotation_deg=[float(k) for k in range(30)])
    with pytest.raises(InputError, match=r"a window of 60000 um[\s\S]*another evaluator"):
        environment(*maps(8), probe, evaluator="brute", coherence_um=60_000.0)


def test_bumps_have_no_low_rank_and_change_the_picture(caplog: pytest.LogCaptureFixture) -> None:
    probe = draw(scene="room", rows=24, lamp_deg=20.0)
    height = np.random.default_rng(2).normal(0, 30.0, (20, 20)).cumsum(axis=1).astype(np.float32)
    bumps = HeightField(height, 8000.0)
    exact, fast, flat = (
        environment(*maps(), probe, given, evaluator=evaluator).rgb
        for given, evaluator in ((bumps, "reference"), (bumps, "low_rank"), (None, "reference"))
    )
    assert "look-ups are ordered" in caplog.text
    assert np.percentile(np.abs(fast - exact), 99.9) < 0.01 * exact.max()
    assert np.abs(flat - exact).max() > 0.05 * exact.max()


def test_brute_force_sees_the_window_that_the_others_leave_out() -> None:
    """A lamp narrower than a lobe: the delta response concentrates what the window spreads."""
    lamp = draw(scene="outdoors", rows=256, lamp_deg=0.7)
    settings = {"evaluator": "reference", "tilt_deg": 30.0}
    sheet = maps(8, 10.0)
    exact = environment(*sheet, lamp, **settings | {"evaluator": "brute"}, coherence_um=20.0).rgb
    sharp = environment(*sheet, lamp, **settings).rgb
    assert np.abs(sharp - exact).max() > 0.02 * exact.max()
    assert sharp.sum() == pytest.approx(exact.sum(), rel=0.2)


@pytest.mark.skipif(not PROBES.is_dir(), reason="published probes are not at hand")
@pytest.mark.parametrize("name", ["museum.exr", "Grace_Cathedral.hdr"])
def test_a_mirror_shows_a_published_probe(name: str) -> None:
    probe = read(file=PROBES / name)
    rows, columns = probe.rgb.shape[:2]
    rgb = environment(*maps(), probe, depth_um=0.0).rgb[0]
    middle = probe.rgb[rows // 2 - 1 : rows // 2 + 1, columns // 2 - 1 : columns // 2 + 1].mean(axis=(0, 1))
    assert rgb[19:21, 19:21].mean(axis=(0, 1)) == pytest.approx(middle, rel=0.1)


@pytest.mark.parametrize(
    ("settings", "told"),
    [
        ({"rotation_deg": []}, "are no rotations"),
        ({"camera_mm": [0.0, 0.0, -1.0]}, "is no place"),
        ({"tilt_deg": 91.0}, "tilt_deg is 91"),
        ({"up": [0.0, 0.0, 1.0]}, "points along the view"),
        ({"tiles": [0, 1]}, "tiles"),
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, object], told: str) -> None:
    words = [f"graph.rendering.{name}={str(value).replace(' ', '')}" for name, value in settings.items()]
    with pytest.raises(InputErrors, match=told):
        pipeline.run("render_environment", words)


@pytest.mark.parametrize("name", options("environment"))
def test_every_environment_is_a_probe(name: str) -> None:
    given = ["graph.probe.file=probe.exr"] if name == "file" else []
    nodes = Experiment.load(["+experiment=render_environment", f"environment={name}", *given]).graph.nodes
    assert nodes["probe"].entry.type == "LightProbe"


def test_the_experiment_renders_a_picture_for_each_rotation(tmp_path: Path) -> None:
    small = ["graph.sample.pixel_mm=4.0", "graph.sample.count=2", "graph.probe.rows=32", f"paths.runs={tmp_path}"]
    done = pipeline.run("render_environment", small)
    assert done["rendering"].rgb.shape[0] == 2
    assert done["rendering"].rgb.max() > 0
    assert {"probe.exr", "probe.png", "rendering_1.png"} <= {path.name for path in done.path.glob("outputs/*")}
    page = done.report.read_text()
    assert "Straight up" in page or "straight up" in page
    assert "turned by 30°" in page
    again = OpenImageIO.ImageBuf(str(done.path / "outputs/probe.exr")).get_pixels(OpenImageIO.FLOAT)
    np.testing.assert_array_equal(again, done["probe"].rgb)
