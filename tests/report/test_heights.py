"""Height fields in the report, among the files, and in the store."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio

from pipeline.data.height_fields import HeightField
from pipeline.report.figures import figures_of
from pipeline.report.writers import WRITERS
from pipeline.stages.fit.periodicity import periodicity
from pipeline.stages.simulate.bumps import bumps
from pipeline.storage.artifact import content_of, digest_of, read_artifact, write_artifact


def field(rows: int = 6, columns: int = 9) -> HeightField:
    height = np.arange(rows * columns, dtype=np.float32).reshape(rows, columns) / 100
    height[2, 3] = np.nan
    return HeightField(height, 0.065, caption="A made-up ramp")


def test_the_map_is_in_micrometres_and_the_caption_says_what_it_is() -> None:
    drawn, profile = figures_of(field())
    assert {"x (µm)", "y (µm)", "height (µm)"} <= set(re.findall(r">([^<]+)</text>", drawn.body))
    assert drawn.caption.startswith("A made-up ramp. 0.585 × 0.39 µm, a sample every 65 nm. Lowest to highest 0.53 µm")
    assert "Grey: not known, 1.9 percent." in drawn.caption
    assert "repeats" not in drawn.caption
    assert "repeats" in figures_of(HeightField(field().height_um, 0.1, periodic=True))[0].caption
    assert profile.title == "profile"


def test_profiles_go_right_and_up_and_break_where_nothing_is_known() -> None:
    """The middle row is whole; the middle column, number 4, too; column 3 is broken at its third sample."""
    body = figures_of(field())[1].body
    (across,), (up,) = re.findall(r'class="curve" d="M([^"]+)"', body), re.findall(r'class="second" d="M([^"]+)"', body)
    along_x, along_y = (np.array([p.split(",") for p in path.split()], float) for path in (across, up))
    assert (len(along_x), len(along_y)) == (9, 6)
    assert (np.diff(along_x[:, 1]) < 0).all()  # heights grow to the right; y of a drawing goes down
    assert (np.diff(along_y[:, 1]) > 0).all()  # and fall upwards, since they grow with the row
    broken = figures_of(HeightField(field().height_um[:, 1:6], 0.065))[1].body  # number 3 becomes the middle
    assert len(re.findall(r'class="second" d="', broken)) == 2


def test_a_field_of_which_nothing_is_known_is_drawn_all_the_same() -> None:
    (drawn,) = figures_of(HeightField(np.full((3, 4), np.nan, np.float32), 0.1))
    assert "No height is known." in drawn.caption


def test_the_files_hold_the_heights_and_the_pitch(tmp_path: Path) -> None:
    files = {path.name for path in WRITERS["HeightField"](tmp_path / "surface", field())}
    assert files == {"surface.exr", "surface.png"}
    source = oiio.ImageInput.open(str(tmp_path / "surface.exr"))
    np.testing.assert_array_equal(source.read_image("float")[..., 0], field().height_um)
    assert source.spec().channelnames == ("height_um",)
    assert source.spec().getattribute("pitch_um") == np.float32(0.065)
    source.close()


def test_the_store_gives_back_what_it_got(tmp_path: Path) -> None:
    description, arrays = content_of(field())
    write_artifact(tmp_path, description, arrays)
    back = read_artifact(tmp_path, {"HeightField": HeightField}, artifact=digest_of(description))
    np.testing.assert_array_equal(back.height_um, field().height_um)
    assert (back.pitch_um, back.periodic, back.caption) == (0.065, False, "A made-up ramp")


def test_boxes_stand_around_the_peaks_and_the_table_lists_them(tmp_path: Path) -> None:
    found = periodicity(bumps(size_um=20, pitch_um=0.1))
    (spectrum,) = figures_of(found)
    assert {"x (1/µm)", "y (1/µm)"} <= set(re.findall(r">([^<]+)</text>", spectrum.body))
    assert "1: 2.5 ± 0 µm at 0.00 ± 0°; 2: 2 ± 0 µm at 90.00 ± 0°" in spectrum.caption
    assert len(re.findall(r'class="mark"', spectrum.body)) == 2
    assert {path.name for path in WRITERS["Periodicity"](tmp_path / "fit", found)} == {"fit.csv", "fit.exr"}
    head, *rows = (tmp_path / "fit.csv").read_text().splitlines()
    assert head.startswith("period_um,period_error_um,direction_deg")
    assert [round(float(row.split(",")[0]), 6) for row in rows] == [2.5, 2.0]
    nothing = periodicity(HeightField(np.random.default_rng(0).normal(size=(64, 64)), 0.1))
    assert "No period stands out." in figures_of(nothing)[0].caption
    list(WRITERS["Periodicity"](tmp_path / "none", nothing))
    assert len((tmp_path / "none.csv").read_text().splitlines()) == 1
