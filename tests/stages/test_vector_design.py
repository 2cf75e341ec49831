"""Samples of SVG files: what lies where, in which direction it diffracts, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from matplotlib.path import Path as Polygon

import pipeline
from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError, InputErrors
from pipeline.optics.drawing import Drawing
from pipeline.optics.vector_shapes import filled
from pipeline.stages.simulate.vector_design import vector_design


@pytest.fixture
def draw(tmp_path: Path):
    def drawn(shapes: str, page: str = 'width="20mm" height="10mm" viewBox="0 0 20 10"', **given) -> GratingSample:
        file = tmp_path / "design.svg"
        file.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {page}>{shapes}</svg>')
        return vector_design(**{"file": file, "pixel_mm": 0.05, **given})

    return drawn


def degrees(sample: GratingSample, x: float, y: float) -> float:
    """At a place given as the page's: mm from its upper left corner, y down."""
    return float(np.rad2deg(sample.orientation_rad[int(y / sample.pixel_mm), int(x / sample.pixel_mm)]))


def area(sample: GratingSample) -> float:
    return float(sample.diffracts.sum()) * sample.pixel_mm**2


def test_a_map_is_as_large_as_its_page_or_as_asked(draw) -> None:
    sample = draw('<rect x="1" y="1" width="4" height="2" fill="red"/>')
    assert sample.orientation_rad.shape == (200, 400)
    np.testing.assert_array_equal(np.argwhere(sample.diffracts).min(axis=0), [20, 20])
    np.testing.assert_array_equal(np.argwhere(sample.diffracts).max(axis=0), [59, 99])
    twice = draw('<rect x="1" y="1" width="4" height="2" fill="red"/>', width_mm=40.0, pixel_mm=0.1)
    np.testing.assert_array_equal(twice.orientation_rad, sample.orientation_rad)
    bare = draw('<rect width="96" height="96" fill="red"/>', page='viewBox="0 0 192 96"', pixel_mm=0.254)
    assert bare.orientation_rad.shape == (100, 200)  # 96 pixels of a page are an inch


@pytest.mark.parametrize(
    ("shape", "expected_mm2"),
    [
        ('<circle cx="10" cy="5" r="4" fill="red"/>', 16 * np.pi),
        ('<ellipse cx="10" cy="5" rx="6" ry="3" fill="red"/>', 18 * np.pi),
        ('<polygon points="1,1 19,1 10,9" fill="red"/>', 72),
        ('<path d="M5 5 a 3 3 0 0 1 6 0 z" fill="red"/>', 4.5 * np.pi),
        ('<path d="M2 2 H10 V8 H2 Z M4 4 H6 V6 H4 Z" fill-rule="evenodd" fill="red"/>', 44),
        ('<path d="M2 2 H10 V8 H2 Z M4 4 H6 V6 H4 Z" fill="red"/>', 48),
        ('<path d="M2 2 H10 V8 H2 Z M4 4 V6 H6 V4 Z" fill="red"/>', 44),
        ('<line x1="5" y1="5" x2="15" y2="5" stroke="black" stroke-width="2"/>', 20 + np.pi),
        ('<circle cx="10" cy="5" r="3" fill="none" stroke="black" stroke-width="1"/>', 6 * np.pi),
        ('<g transform="translate(10 5) rotate(30) scale(2)"><ellipse rx="2" ry="1" fill="red"/></g>', 8 * np.pi),
        (
            '<g transform="scale(2)"><ellipse cx="5" cy="2.5" rx="1" ry="1" fill="none" stroke="#000" '
            'stroke-width=".5"/></g>',
            4 * np.pi,
        ),
        ('<circle cx="10" cy="5" r="4" fill="red"/><circle cx="10" cy="5" r="2" fill="white"/>', 12 * np.pi),
    ],
)
def test_shapes_cover_what_they_should(draw, shape: str, expected_mm2: float) -> None:
    assert area(draw(shape)) == pytest.approx(expected_mm2, rel=0.006)


def test_arcs_are_sheared_as_straight_lines_are(draw) -> None:
    """x + y / 2: a circle of radius 3 becomes an ellipse of the same area, 2 sqrt(9 + 9/4) wide."""
    sheared = draw('<g transform="matrix(1 0 0.5 1 4 0)"><circle cx="3" cy="5" r="3" fill="red"/></g>')
    assert area(sheared) == pytest.approx(9 * np.pi, rel=0.005)
    columns = np.flatnonzero(sheared.diffracts.any(axis=0))
    assert np.ptp(columns) * 0.05 == pytest.approx(2 * np.sqrt(11.25), abs=0.11)


@settings(max_examples=50, deadline=None)
@given(st.lists(st.tuples(st.integers(-90, 90), st.integers(-90, 90)), min_size=3, max_size=12))
def test_any_polygon_is_filled_as_another_library_fills_it(points) -> None:
    """No edge goes through the middle of a pixel, where libraries take either side."""
    drawing = Drawing(20, 1.0)
    corners = np.array(points) / 10 + [0.0131415926, 0.0172718281]
    window = drawing.window(-10, -10, 10, 10)
    x, y = np.meshgrid(drawing.x_mm, drawing.y_mm)
    centres = np.stack([x.ravel(), y.ravel()], axis=1)
    expected = Polygon(np.vstack([corners, corners[:1]])).contains_points(centres).reshape(x.shape)
    np.testing.assert_array_equal(filled([corners], window, even_odd=True), expected)


def test_hues_are_twice_the_orientation(draw) -> None:
    colours = {"#ff0000": 0, "#ffff00": 30, "lime": 60, "cyan": 90, "rgb(0,0,255)": 120, "hsl(300,80%,40%)": 150}
    bars = [f'<rect x="{3 * k}" width="3" height="10" fill="{c}"/>' for k, c in enumerate(colours)]
    sample = draw("".join(bars))
    for k, expected in enumerate(colours.values()):
        assert degrees(sample, 3 * k + 1.5, 5) == pytest.approx(expected, abs=1e-3)


def test_orientations_are_told_by_attributes_of_shapes_and_of_groups_around_them(draw) -> None:
    sample = draw(
        '<g data-orientation="40" transform="rotate(90 10 5)"><rect x="9" y="4" width="2" height="2" fill="red"/>'
        '<rect x="9" y="0" width="2" height="2" data-orientation="-50"/></g>'
        '<style>.leaf {fill: #00ff00}</style><circle class="leaf" cx="2" cy="2" r="1"/>'
    )
    assert degrees(sample, 10, 5) == pytest.approx(40, abs=1e-4)  # on the page, whatever turns the shape
    assert degrees(sample, 14, 5) == pytest.approx(130, abs=1e-4)
    assert degrees(sample, 2, 2) == pytest.approx(60, abs=1e-4)


def test_strokes_diffract_along_or_across_themselves_y_up(draw) -> None:
    rising = '<path d="M2 8 L8 2" stroke="black" fill="none" {}/><path d="M12 2 L18 8" stroke="#444" {}/>'
    along, across = draw(rising.format("", "")), draw(rising.format(*['data-orientation="across"'] * 2))
    assert degrees(along, 5, 5) == pytest.approx(45, abs=1e-3)
    assert degrees(along, 15, 5) == pytest.approx(135, abs=1e-3)
    assert degrees(across, 5, 5) == pytest.approx(135, abs=1e-3)
    assert degrees(draw('<path d="M2 8 L8 2" stroke="cyan" fill="none"/>'), 5, 5) == pytest.approx(90, abs=1e-3)


def test_a_curved_stroke_turns_with_its_tangent(draw) -> None:
    ring = draw('<circle cx="10" cy="5" r="4" fill="none" stroke="black" stroke-width="0.6"/>')
    for angle in np.deg2rad([10, 50, 100, 200, 290]):
        found = degrees(ring, 10 + 4 * np.cos(angle), 5 - 4 * np.sin(angle))
        assert (found - np.rad2deg(angle) - 90 + 90) % 180 - 90 == pytest.approx(0, abs=1.5)


def test_radial_shapes_diffract_away_from_their_middle(draw) -> None:
    disc = draw('<circle cx="7" cy="4" r="3" data-orientation="radial"/>')
    for angle in np.deg2rad([20, 70, 140, 250]):
        found = degrees(disc, 7 + 2 * np.cos(angle), 4 - 2 * np.sin(angle))
        assert (found - np.rad2deg(angle) + 90) % 180 - 90 == pytest.approx(0, abs=1.5)


def test_periods_are_told_by_attributes_or_by_the_setting(draw) -> None:
    sample = draw(
        '<g data-period-um="1.1"><rect width="4" height="10" fill="red"/>'
        '<rect x="5" width="4" height="10" fill="red" data-period-um="2"/></g>'
        '<g data-period-um="1.1"><rect x="10" width="4" height="10" fill="red" data-lines-per-mm="800"/></g>'
        '<rect x="15" width="4" height="10" fill="red"/>',
        period_um=1.7,
    )
    np.testing.assert_allclose(sample.period_um[100, [40, 140, 240, 340]], [1.1, 2, 1.25, 1.7], rtol=1e-6)
    np.testing.assert_array_equal(np.isfinite(sample.period_um), sample.diffracts)


def test_what_is_hidden_or_lies_in_definitions_is_not_drawn_but_used(draw) -> None:
    sample = draw(
        '<defs><rect id="r" width="2" height="2" fill="red"/></defs><use href="#r" x="3" y="3"/>'
        '<rect x="8" width="5" height="5" fill="red" visibility="hidden"/>'
        '<rect x="8" width="5" height="5" fill="red" display="none"/>'
    )
    assert area(sample) == pytest.approx(4)
    assert degrees(sample, 4, 4) == 0


def test_text_pictures_and_clips_are_told_to_be_left_out(draw, caplog: pytest.LogCaptureFixture) -> None:
    draw('<text id="t" x="1" y="1">A</text><rect id="r" width="2" height="2" fill="red" clip-path="url(#c)"/>')
    assert "text 't': text and pictures are left out; make text a path first" in caplog.text
    assert "rect 'r': clips and masks do not count" in caplog.text


@pytest.mark.parametrize(
    ("shape", "message"),
    [
        (
            '<rect id="r" width="2" height="2"/>',
            r"the fill 'black' is grey or no[\s\S]*rect 'r'\s+expected: a colour",
        ),
        ('<rect width="2" height="2" fill="url(#g)"/>', r"the fill is no plain colour[\s\S]*rect 'without an id'"),
        ('<rect width="2" height="2" data-orientation="alog"/>', r"of a fill is 'alog'[\s\S]*degrees, or radial"),
        ('<rect width="2" height="2" data-orientation="nan"/>', r"data-orientation of a fill is 'nan'"),
        ('<rect width="2" height="2" fill="redish"/>', r"the fill 'redish' is grey or no colour"),
        ('<rect width="2" height="2" fill="red" data-period-um="inf"/>', r"data-period-um is 'inf'"),
        ('<path d="M0 0 L1 1" stroke="red" data-orientation="acros"/>', r"'acros'[\s\S]*did you mean 'across'"),
        ('<rect width="2" height="2" fill="red" data-period-um="0"/>', r"data-period-um is '0'[\s\S]*above 0"),
        (
            '<rect width="2" height="2" fill="red" data-period-um="1" data-lines-per-mm="900"/>',
            r"the period is told twice",
        ),
    ],
)
def test_shapes_that_tell_no_grating_are_refused_by_name(draw, shape: str, message: str) -> None:
    with pytest.raises(InputErrors, match=message):
        draw(shape)


def test_what_is_no_design_is_refused(draw, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"there is no shape on the page"):
        draw("")
    with pytest.raises(InputError, match=r"the map would have 40000 points a side"):
        draw('<rect width="2" height="2" fill="red"/>', pixel_mm=0.0005)
    with pytest.raises(InputError, match=r"no shape covers a point of the map"):
        draw('<rect x="90" width="2" height="2" fill="red"/>')
    for page in ("", 'width="100%" height="100%"', 'width="0" height="10"'):
        with pytest.raises(InputError, match=r"the page has no size\s[\s\S]*width and height, or a viewBox"):
            draw('<rect width="2" height="2" fill="red"/>', page=page)
    with pytest.raises(InputError, match=r"design.svg cannot be read"):
        draw('<rect width="2" height="2" fill="red" transform="rotate(x)"/>')
    (tmp_path / "page.svg").write_text("<html/>")
    with pytest.raises(InputError, match=r"page.svg (holds no <svg>|cannot be read)"):
        vector_design(file=tmp_path / "page.svg")
    (tmp_path / "broken.svg").write_text("<svg")
    with pytest.raises(InputError, match=r"broken.svg cannot be read[\s\S]*expected: an SVG file"):
        vector_design(file=tmp_path / "broken.svg")
    with pytest.raises(InputError, match=r"there is no file brken.svg[\s\S]*did you mean 'broken.svg'"):
        vector_design(file=tmp_path / "brken.svg")


def test_a_picture_for_a_design_of_vectors_and_the_reverse_are_told_apart(tmp_path: Path) -> None:
    page, picture = tmp_path / "page.svg", tmp_path / "picture.png"
    page.write_text("<svg/>")
    picture.write_bytes(b"\x89PNG\r\n")
    with pytest.raises(InputError, match=r"hint: +maps=picture, or simulate.picture_design"):
        vector_design(file=picture)
    with pytest.raises(InputErrors, match=r"page.svg is made of shapes[\s\S]*hint: +maps=vector"):
        pipeline.run("edit_periods", ["maps=picture", f"graph.sample.file={page}", f"paths.runs={tmp_path}"])


@pytest.mark.parametrize(
    ("shapes", "message"),
    [
        ('<g id="a"><use href="#b"/></g><g id="b"><use href="#a"/></g>', "'[ab]' uses itself"),
        (
            '<g id="g0"><rect width="5" height="5" fill="red"/></g>'
            + "".join(f'<g id="g{i}">{f"""<use href="#g{i - 1}"/>""" * 10}</g>' for i in range(1, 9)),
            r"make \d+ of them, more than 200000",
        ),
        ('<rect x="1e999" width="5" height="5" fill="red"/>', "coordinates that are no numbers"),
    ],
)
def test_designs_that_would_never_end_or_lie_nowhere_are_refused(draw, shapes: str, message: str) -> None:
    with np.errstate(invalid="ignore"), pytest.raises((InputError, InputErrors), match=message):
        draw(shapes)


def test_the_documented_design_is_drawn(tmp_path: Path) -> None:
    text = (Path(__file__).parents[2] / "docs" / "maps.md").read_text()
    (tmp_path / "design.svg").write_text(text.partition("```svg\n")[2].partition("```")[0])
    sample = vector_design(file=tmp_path / "design.svg", pixel_mm=0.05)
    assert sample.orientation_rad.shape == (500, 800)
    assert degrees(sample, 7, 2.5) == pytest.approx(90, abs=1.5)
    assert np.isnan(degrees(sample, 7, 7))
    assert degrees(sample, 20, 8) == pytest.approx(60, abs=1e-3)
    assert degrees(sample, 32, 7) == pytest.approx(22.5, abs=1e-3)
    np.testing.assert_allclose(np.unique(sample.period_um[sample.diffracts]), [1000 / 900, 1.2, 1.4], rtol=1e-6)
