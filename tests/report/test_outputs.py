from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np
import OpenImageIO as oiio
import pytest
from made_up_run import PIXEL_MM, FakeNode, FakeRun

import pipeline.report
from pipeline.errors import PipelineError
from pipeline.optics.colour import encode_srgb
from pipeline.report import write_outputs
from pipeline.report.exr import write_exr


def read(path: Path) -> tuple[dict[str, np.ndarray], oiio.ImageSpec]:
    picture = oiio.ImageInput.open(str(path))
    assert picture is not None, oiio.geterror()
    spec = picture.spec()
    pixels = picture.read_image("float")
    picture.close()
    return {name: pixels[..., i] for i, name in enumerate(spec.channelnames)}, spec


def test_orientation_maps_come_back_from_exr_bit_by_bit(run: FakeRun) -> None:
    write_outputs(run)
    channels, spec = read(run.path / "outputs" / "fit.exr")
    assert set(channels) == {"orientation_rad", "correlation", "intensity", "mask"}
    for name, pixels in channels.items():
        np.testing.assert_array_equal(pixels, np.asarray(getattr(run.values["fit"], name), np.float32))
    assert spec.getattribute("pixel_mm") == pytest.approx(PIXEL_MM)


def test_every_other_map_comes_back_too(run: FakeRun) -> None:
    write_outputs(run)
    for node, names in {
        "sample": ("orientation_rad", "period_um"),
        "period": ("period_um", "mask"),
        "evaluate": ("error_rad",),
    }.items():
        channels, _ = read(run.path / "outputs" / f"{node}.exr")
        assert set(channels) == set(names)
        for name in names:
            np.testing.assert_array_equal(channels[name], np.asarray(getattr(run.values[node], name), np.float32))


def test_pictures_are_linear_in_exr_and_encoded_in_png(run: FakeRun) -> None:
    write_outputs(run)
    for index, rgb in enumerate(run.values["torch"].rgb):
        channels, _ = read(run.path / "outputs" / f"torch_{index}.exr")
        np.testing.assert_array_equal(np.stack([channels[c] for c in "RGB"], axis=-1), rgb)
        shown = cv2.imread(str(run.path / "outputs" / f"torch_{index}.png"), cv2.IMREAD_COLOR_RGB)
        np.testing.assert_allclose(shown / 255, encode_srgb(rgb), atol=0.51 / 255)


def test_the_files_are_those_that_a_person_opens(run: FakeRun) -> None:
    written = write_outputs(run)
    expected = {"fit.exr", "fit.png", "period.exr", "period.png", "sample.exr", "evaluate.exr", "evaluate.png"}
    expected |= {f"{node}_{i}.{kind}" for node in ("torch", "rendering") for i in range(3) for kind in ("exr", "png")}
    expected |= {"response.exr", "response.png", "line.csv"}
    assert {path.name for path in written} == expected | {"photos.png", "metrics.csv"}
    assert {path.name for path in (run.path / "outputs").iterdir()} == {p.name for p in written} | {".written.json"}


def test_charts_are_files_of_their_own(run: FakeRun) -> None:
    pipeline.report.write(run)
    folder = run.path / "outputs"
    charts = {path.name for path in folder.glob("*.svg")}
    assert {"fit_orientation.svg", "fit_correlation.svg", "sample_period.svg", "evaluate_error.svg"} <= charts
    assert "photos_means.svg" in charts
    for name in charts:
        root = ElementTree.parse(folder / name).getroot()
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert float(root.get("width")) > 100
    text = (folder / "fit_correlation.svg").read_text()
    assert "var(" not in text
    assert "y (mm)" in text
    assert ">correlation</text>" in text
    assert "fill: #1a1f26" in text


def test_charts_that_are_gone_are_removed_and_those_of_a_person_are_kept(run: FakeRun) -> None:
    pipeline.report.write(run)
    folder = run.path / "outputs"
    (folder / "mine.svg").write_text("<svg/>")
    pipeline.report.write(run.with_node(replace(run.nodes["evaluate"], artifact="")))
    assert not (folder / "evaluate_error.svg").exists()
    assert (folder / "mine.svg").exists()
    assert (folder / "fit_orientation.svg").exists()
    (folder / ".charts.json").write_text('["../../mine.svg", 3')
    pipeline.report.write(run)
    assert (folder / "evaluate_error.svg").exists()


def test_figures_of_merit_are_written_with_units(run: FakeRun) -> None:
    write_outputs(replace(run, metrics={**run.metrics, "third": 1 / 3}))
    rows = list(csv.reader((run.path / "outputs" / "metrics.csv").open(newline="")))
    assert rows[0] == ["name", "value", "unit"]
    assert rows[1] == ["orientation_error_mean_deg", "0.4", "°"]
    assert float(rows[-1][1]) == 1 / 3


def stamps(folder: Path) -> dict[str, int]:
    return {path.name: path.stat().st_mtime_ns for path in folder.iterdir()}


def test_a_second_time_nothing_is_written(run: FakeRun) -> None:
    first = write_outputs(run)
    before = stamps(run.path / "outputs")
    assert write_outputs(run) == first
    assert stamps(run.path / "outputs") == before


def test_only_what_is_missing_torn_or_changed_is_written_again(run: FakeRun) -> None:
    write_outputs(run)
    folder = run.path / "outputs"
    (folder / "period.png").unlink()
    (folder / "fit.exr").write_bytes(b"torn")
    changed = replace(run.nodes["evaluate"], artifact="another digest")
    before = stamps(folder)
    write_outputs(run.with_node(changed))
    after = stamps(folder)
    again = {name for name in after if after[name] != before.get(name)}
    assert again == {"period.png", "period.exr", "fit.exr", "fit.png", "evaluate.exr", "evaluate.png", ".written.json"}
    assert read(folder / "fit.exr")[0]


def test_files_of_a_value_that_is_gone_are_removed_and_those_of_a_person_are_kept(run: FakeRun) -> None:
    write_outputs(run)
    folder = run.path / "outputs"
    (folder / "notes.txt").write_text("mine")
    failed = replace(run.nodes["period"], status="failed", artifact="")
    write_outputs(run.with_node(failed))
    assert not (folder / "period.exr").exists()
    assert (folder / "notes.txt").read_text() == "mine"
    assert (folder / "fit.exr").exists()


def test_a_damaged_value_leaves_the_others_be(failed: FakeRun) -> None:
    names = {path.name for path in write_outputs(failed)}
    assert "fit.exr" in names
    assert "torn.exr" not in names


def test_a_node_cannot_write_outside_the_folder(run: FakeRun) -> None:
    escaping = FakeNode("../../escaped", type="PeriodMap", artifact="digest")
    written = write_outputs(run.with_node(escaping, run.values["period"]))
    assert {path.parent for path in written} == {run.path / "outputs"}


def test_a_folder_that_cannot_be_written_is_an_error_that_says_so(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match=r"map\.exr cannot be written"):
        write_exr(tmp_path / "folder.exr" / "map.exr", {"a": np.zeros((0, 4), np.float32)}, {})
