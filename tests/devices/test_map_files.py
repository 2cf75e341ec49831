"""Maps of orientation and period from runs, EXR files, arrays and pictures."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

import pipeline
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.errors import InputError
from pipeline.report.exr import write_exr
from pipeline.report.writers import WRITERS
from pipeline.runs import Run
from pipeline.stages.capture.orientation_map import orientation_map
from pipeline.stages.capture.period_map import period_map

DEGREES = np.array([[0.0, 30.0, 60.0], [90.0, 135.0, 179.0]], np.float32)
NAN = np.float32(np.nan)


def measured() -> OrientationMap:
    """A map with every field that a file can carry, and a masked corner."""
    orientation = np.deg2rad(DEGREES)
    orientation[0, 0] = NAN
    fields = (np.linspace(0.5, 1, 6), np.linspace(0, 2, 6), np.linspace(0.01, 0.02, 6))
    correlation, intensity, error = (np.float32(f).reshape(2, 3) for f in fields)
    correlation[0, 0] = error[0, 0] = NAN
    parameters = {"retardation_deg": 8.25, "film_axis_deg": -0.5}
    mask = np.isfinite(orientation)
    return OrientationMap(orientation, correlation, intensity, mask, 0.03, True, error, parameters)


def written(path: Path, value: object) -> Path:
    return next(f for f in WRITERS[type(value).__name__](path, value) if f.suffix == ".exr")


def same(left: OrientationMap | PeriodMap, right: OrientationMap | PeriodMap) -> None:
    assert vars(left).keys() == vars(right).keys()
    for name, value in vars(left).items():
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, getattr(right, name), err_msg=name, strict=True)
        else:
            assert value == getattr(right, name), name


@pytest.mark.parametrize("absolute", [True, False])
def test_an_orientation_map_comes_back_from_its_file(tmp_path: Path, absolute: bool) -> None:
    value = replace(measured(), absolute=absolute)
    same(orientation_map(file=written(tmp_path / "fit", value)), value)


@pytest.mark.parametrize("pitch", [0.006666667, None])
def test_a_map_with_fewer_fields_comes_back_too(tmp_path: Path, pitch: float | None) -> None:
    value = replace(measured(), standard_error_rad=None, parameters={}, pixel_mm=pitch)
    same(orientation_map(file=written(tmp_path / "fit", value)), value)


@pytest.mark.parametrize("relative", [True, False])
def test_a_period_map_comes_back_from_its_file(tmp_path: Path, relative: bool) -> None:
    period = np.array([[NAN, 1.2, 1.4], [0.9, 1.0, 2.0]], np.float32)
    value = PeriodMap(period, np.isfinite(period), 0.02, relative)
    same(period_map(file=written(tmp_path / "period", value)), value)


def test_what_is_told_counts_instead_of_what_the_file_says(tmp_path: Path) -> None:
    file = written(tmp_path / "fit", measured())
    told = orientation_map(file=file, pixel_mm=0.5, absolute=False)
    assert (told.pixel_mm, told.absolute) == (0.5, False)


def test_an_array_holds_radians_and_micrometres(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.deg2rad(DEGREES.astype(np.float64)) + np.pi)
    read = orientation_map(file=tmp_path / "map.npy", absolute=True)
    np.testing.assert_allclose(np.rad2deg(read.orientation_rad), DEGREES, atol=2e-5)
    assert (read.pixel_mm, read.absolute) == (None, True)
    assert np.isnan(read.correlation).all()
    assert not orientation_map(file=tmp_path / "map.npy").absolute
    np.save(tmp_path / "map.npy", np.array([[1.5, 0.0], [-1.0, np.nan]]))
    np.testing.assert_array_equal(period_map(file=tmp_path / "map.npy").period_um, [[1.5, NAN], [NAN, NAN]])


def test_grey_stands_for_a_range_of_degrees_or_periods_or_line_densities(tmp_path: Path) -> None:
    grey = np.array([[0, 51, 102], [153, 204, 254]], np.uint8)
    file = write_image(tmp_path / "map.png", grey)
    degrees = np.rad2deg(orientation_map(file=file, range_deg=(0.0, 180.0)).orientation_rad)
    np.testing.assert_allclose(degrees, 180 / 255 * grey, atol=2e-5)
    period = period_map(file=file, range_um=(1.0, 2.0)).period_um
    np.testing.assert_allclose(period, 1 + grey / 255, rtol=1e-6)
    by_density = period_map(file=file, range_lines_per_mm=(0.0, 1020.0)).period_um
    np.testing.assert_allclose(by_density[0], [NAN, 1000 / 204, 1000 / 408], rtol=1e-6)


def test_floating_point_pictures_may_hold_degrees_or_lines_per_mm(tmp_path: Path) -> None:
    file = write_image(tmp_path / "map.tif", DEGREES)
    degrees = np.rad2deg(orientation_map(file=file, range_deg=(0.0, 1.0)).orientation_rad)
    np.testing.assert_allclose(degrees, DEGREES, atol=2e-5)
    write_exr(tmp_path / "grey.exr", {"Y": np.deg2rad(DEGREES)}, {})
    np.testing.assert_array_equal(orientation_map(file=tmp_path / "grey.exr").orientation_rad, np.deg2rad(DEGREES))
    period = period_map(file=file, range_lines_per_mm=(0.0, 1.0)).period_um
    np.testing.assert_allclose(period[1], 1000 / DEGREES[1], rtol=1e-6)


def test_a_mask_leaves_out_what_is_black(tmp_path: Path) -> None:
    np.save(tmp_path / "map.npy", np.deg2rad(DEGREES))
    mask = write_image(tmp_path / "mask.png", np.array([[0, 1, 255], [9, 0, 9]], np.uint8))
    read = orientation_map(file=tmp_path / "map.npy", mask=mask)
    np.testing.assert_array_equal(read.mask, [[False, True, True], [True, False, True]])
    np.testing.assert_array_equal(np.isnan(read.orientation_rad), ~read.mask)
    small = write_image(tmp_path / "small.png", np.ones((2, 2), np.uint8))
    with pytest.raises(InputError, match=r"the mask has 2 x 2 pixels, the map 3 x 2"):
        period_map(file=tmp_path / "map.npy", mask=small)


def test_what_cannot_be_a_map_is_refused(tmp_path: Path) -> None:
    def refused(name: str, message: str, **settings: object) -> None:
        with pytest.raises(InputError, match=message):
            orientation_map(file=tmp_path / name, **settings)

    np.save(tmp_path / "map.npy", DEGREES)
    np.save(tmp_path / "cube.npy", np.zeros((2, 3, 4)))
    np.save(tmp_path / "text.npy", np.array([["a"]]))
    np.save(tmp_path / "unknown.npy", np.full((3, 4), np.nan))
    (tmp_path / "torn.npy").write_bytes((tmp_path / "map.npy").read_bytes()[:100])
    (tmp_path / "map.txt").write_text("0 1")
    (tmp_path / "torn.exr").write_bytes(b"v/1\x01")
    write_image(tmp_path / "grey.png", np.uint8(DEGREES))
    write_image(tmp_path / "colour.png", np.uint8(np.stack([DEGREES, DEGREES, 0 * DEGREES], axis=-1)))
    write_exr(tmp_path / "period.exr", {"period_um": DEGREES, "mask": DEGREES}, {})
    refused("mop.npy", r"there is no file mop.npy[\s\S]*did you mean 'map.npy'")
    refused("cube.npy", r"an array of 2 x 3 x 4\s")
    refused("text.npy", r"an array of <U1\s[\s\S]*real numbers")
    refused("unknown.npy", r"no orientation is known")
    refused("torn.npy", r"the array cannot be read")
    refused("torn.exr", r"torn.exr cannot be read")
    refused("map.txt", r"map.txt is no map\s[\s\S]*expected: an .exr or .npy file, or a grey picture")
    refused("colour.png", r"a picture in colour", range_deg=(0.0, 180.0))
    refused("grey.png", r"grey.png holds shares of a range that is not told\s+where: +range_deg")
    refused("grey.png", r"range_deg is \[0.0\]\s[\s\S]*two numbers", range_deg=(0.0,))
    refused(
        "period.exr",
        r"has the channels mask, period_um\s[\s\S]*a channel 'orientation_rad', or a single one that is called 'Y'",
    )
    write_exr(tmp_path / "height.exr", {"height_um": DEGREES}, {})
    refused("height.exr", r"has the channels height_um\s[\s\S]*expected: a channel 'orientation_rad'")
    refused("", r"there is no run in .*: it has no manifest.json")
    with pytest.raises(InputError, match=r"where: +range_um\s+expected: range_um or range_lines_per_mm: what black"):
        period_map(file=tmp_path / "grey.png")
    with pytest.raises(InputError, match=r"the range is told twice\s+where: +range_um, range_lines_per_mm"):
        period_map(file=tmp_path / "grey.png", range_um=(0.0, 1.0), range_lines_per_mm=(0.0, 1.0))


def test_arrays_that_are_none_or_claim_more_than_they_hold_are_refused(tmp_path: Path) -> None:
    def array(header: bytes) -> Path:
        path = tmp_path / "array.npy"
        path.write_bytes(b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header + bytes(100))
        return path

    np.save(tmp_path / "pickled.npy", np.array([{}], object), allow_pickle=True)
    np.savez(tmp_path / "several.npz", a=np.ones((2, 2)))
    (tmp_path / "several.npz").rename(tmp_path / "several.npy")
    vast = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000, 1000000)}\n"
    for path, message in (
        (tmp_path / "pickled.npy", "cannot be read: .*(pickle|Python objects)"),
        (tmp_path / "several.npy", "an archive of arrays"),
        (array(vast), "the array cannot be read"),
        (array(b"(" * 500), "the array cannot be read"),
    ):
        with pytest.raises(InputError, match=message):
            orientation_map(file=path)


def test_an_exr_file_whose_header_is_no_text_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path / "damaged", measured())
    path.write_bytes(path.read_bytes().replace(b"chlist", b"chl\xe0st", 1))
    with pytest.raises(InputError, match=r"damaged.exr cannot be read"):
        orientation_map(file=path)


@pytest.fixture(scope="module")
def edited(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """A run with one map of orientation and three of periods."""
    small = ["graph.sample.count=1", "graph.sample.pixel_mm=4.0", "until=[period,quadratic,sine]"]
    return pipeline.run("edit_periods", [*small, f"paths.runs={tmp_path_factory.mktemp('runs')}"])


def test_the_maps_of_a_run_are_found_by_node_or_as_the_last(edited: Run) -> None:
    same(orientation_map(file=edited.path), edited["orientation"])
    same(period_map(file=edited.path, node="sine"), edited["sine"])
    same(period_map(file=edited.path), edited["period"])  # of several, the one with the usual name
    sample = orientation_map(file=edited.path, node="sample")  # no map, but drawn with what a map has
    same(sample, edited["orientation"])


def test_the_last_of_several_maps_of_a_run_is_the_one_that_others_were_made_into(tmp_path: Path) -> None:
    nodes = {"fit": (), "smooth": ("fit",), "placed": ("smooth",)}
    write_run(tmp_path, {name: ("OrientationMap", inputs) for name, inputs in nodes.items()})
    written(tmp_path / "outputs" / "placed", measured())
    same(orientation_map(file=tmp_path), measured())


def write_run(folder: Path, nodes: dict[str, tuple[str, tuple[str, ...]]]) -> None:
    listed = [
        {"name": name, "type": kind, "artifact": "0" * 40, "inputs": {"maps": list(inputs)}}
        for name, (kind, inputs) in nodes.items()
    ]
    (folder / "outputs").mkdir()
    (folder / "manifest.json").write_text(json.dumps({"nodes": listed}))


def test_a_run_without_the_map_is_refused(tmp_path: Path, edited: Run) -> None:
    with pytest.raises(InputError, match=r"no node 'quadric'\s[\s\S]*did you mean 'quadratic'"):
        period_map(file=edited.path, node="quadric")
    write_run(tmp_path, {"a": ("OrientationMap", ()), "b": ("OrientationMap", ()), "c": ("Metrics", ())})
    with pytest.raises(InputError, match=r"several nodes[\s\S]*where: +node\s+expected: the name of one: a, b"):
        orientation_map(file=tmp_path)
    with pytest.raises(InputError, match=r"no outputs/a.exr\s[\s\S]*running it again"):
        orientation_map(file=tmp_path, node="a")
    with pytest.raises(InputError, match=r"the run has no PeriodMap"):
        period_map(file=tmp_path)
    (tmp_path / "manifest.json").write_text('{"nodes": [{"name": "../x"}]}')
    with pytest.raises(InputError, match=r"manifest.json cannot be read"):
        period_map(file=tmp_path)
