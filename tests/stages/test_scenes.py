"""The scenes drawn beside the logo: where what lies, in which direction it diffracts, and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pipeline.data.gratings import GratingSample
from pipeline.errors import InputError
from pipeline.optics.angles import axial_difference
from pipeline.stages.simulate.banknote_emblem import banknote_emblem
from pipeline.stages.simulate.compact_disc import PRINT_MM, TRACKS_FROM_MM, compact_disc
from pipeline.stages.simulate.fireworks import _BURSTS, fireworks
from pipeline.stages.simulate.gradient_stars import _SIZES_MM, _scattered, gradient_stars
from pipeline.stages.simulate.kinematic_tile import kinematic_tile

PRINTS = (kinematic_tile, banknote_emblem, gradient_stars, fireworks)
IDEAL_DISC = {
    "camera_mm": None,
    "in_plane_birefringence": (0.0, 0.0),
    "vertical_birefringence": 0.0,
    "print_reflectance": 0.0,
    "scratches": 0,
}


def coarse(scene: Callable[..., GratingSample], **settings: object) -> GratingSample:
    return scene(**{"pixel_mm": 0.25 if scene is compact_disc else 0.04, "margin_mm": 1.0, **settings})


def degrees_at(sample: GratingSample, x_mm: float, y_mm: float) -> float:
    return float(np.rad2deg(sample.orientation_rad[place(sample, x_mm, y_mm)]))


def place(sample: GratingSample, x_mm: float, y_mm: float) -> tuple[int, int]:
    side = len(sample.orientation_rad)
    return int(side / 2 - y_mm / sample.pixel_mm), int(side / 2 + x_mm / sample.pixel_mm)


def on_circle(sample: GratingSample, radius: float, angle_deg: float, centre=(0.0, 0.0)) -> float:
    angle = np.deg2rad(angle_deg)
    return degrees_at(sample, centre[0] + radius * np.cos(angle), centre[1] + radius * np.sin(angle))


def apart(found_deg: float, expected_deg: float) -> float:
    return float(np.rad2deg(np.abs(axial_difference(np.deg2rad(found_deg), np.deg2rad(expected_deg)))))


def angles_of(sample: GratingSample) -> np.ndarray:
    axis = (np.arange(len(sample.orientation_rad)) + 0.5 - len(sample.orientation_rad) / 2) * sample.pixel_mm
    return np.arctan2(-axis[:, None], axis[None, :])


@pytest.mark.parametrize("scene", [*PRINTS, compact_disc])
def test_every_scene_is_as_wide_as_asked_and_grows_with_its_width(scene) -> None:
    sample = coarse(scene)
    width = 100 if scene is compact_disc else 25
    assert len(sample.orientation_rad) == round((width + 2) / sample.pixel_mm)
    rows, columns = np.nonzero(sample.diffracts)
    assert max(np.ptp(rows), np.ptp(columns)) * sample.pixel_mm == pytest.approx(width, rel=0.08)
    assert not sample.diffracts[:: len(rows) - 1].any()
    np.testing.assert_array_equal(np.isfinite(sample.period_um), sample.diffracts)
    assert (sample.orientation_rad[sample.diffracts] >= 0).all()
    assert (sample.orientation_rad[sample.diffracts] < np.pi).all()
    if scene is not compact_disc:
        half = coarse(scene, width_mm=12.5, margin_mm=0.5, pixel_mm=0.02)
        same = half.diffracts == sample.diffracts
        assert same.mean() > 0.999


def test_sectors_of_the_kinematic_tile_turn_once_each_anticlockwise() -> None:
    tile = coarse(kinematic_tile)
    for angle in (3.0, 40.0, 100.0, 200.0, 333.0):
        assert apart(on_circle(tile, 11.0, angle), 5 * angle) < 2.5
    sector = [on_circle(tile, 11.0, angle) for angle in np.arange(1.0, 36.0, 2.0)]
    assert (np.diff(sector) > 0).all()
    assert sector[0] < 10
    assert sector[-1] > 170


def test_corners_of_kinematic_tiles_make_a_wheel_where_they_meet() -> None:
    tile = coarse(kinematic_tile)
    seen = {30.0: (-12.5, -12.5), 120.0: (12.5, -12.5), 210.0: (12.5, 12.5), 300.0: (-12.5, 12.5)}
    for angle, corner in seen.items():
        assert apart(on_circle(tile, 3.0, angle, corner), 5 * angle) < 6


def test_a_kinematic_tile_of_other_sectors_and_its_even_distribution() -> None:
    six = coarse(kinematic_tile, sectors=6)
    assert apart(on_circle(six, 11.0, 20.0), 60.0) < 2
    double = 2 * six.orientation_rad[six.diffracts].astype(np.float64)
    assert np.hypot(np.cos(double).mean(), np.sin(double).mean()) < 0.01


def test_bands_of_the_emblem_turn_from_one_to_the_next_above() -> None:
    emblem = coarse(banknote_emblem)
    column = [degrees_at(emblem, 4.0, y) for y in np.arange(-9.0, 0.5, 0.9)]
    np.testing.assert_allclose(np.diff(column) % 180, 25.0, atol=1e-3)
    left, right = degrees_at(emblem, -6.0, -3.0), degrees_at(emblem, 6.0, -3.0 + 12 * 0.08)
    assert left == pytest.approx(right)


def test_rings_of_the_emblem_have_the_longer_period_and_lie_evenly() -> None:
    emblem = coarse(banknote_emblem, pixel_mm=0.02)
    np.testing.assert_allclose(np.unique(emblem.period_um[emblem.diffracts]), [1.1, 1.4], rtol=1e-6)
    row, start = place(emblem, 2.7, -3.5)
    along = emblem.period_um[row, start : place(emblem, 7.3, -3.5)[1]]
    starts = np.flatnonzero((along[1:] > 1.3) & (along[:-1] < 1.3)) * emblem.pixel_mm
    np.testing.assert_allclose(np.diff(starts), 0.8, atol=0.021)
    assert np.mean(along > 1.3) == pytest.approx(0.25, abs=0.04)
    assert np.isnan(emblem.orientation_rad[place(emblem, 7.65, -3.5)])


def test_the_emblem_wears_its_coronet_on_top() -> None:
    emblem = coarse(banknote_emblem)
    assert np.isfinite(degrees_at(emblem, 0.0, 11.3))
    assert np.isfinite(degrees_at(emblem, -6.3, 10.2))
    assert np.isnan(degrees_at(emblem, 0.0, -12.3))
    across = degrees_at(emblem, 0.0, -3.0) - degrees_at(emblem, 4.0, -3.0 + 4 * 0.08)
    assert across % 180 == pytest.approx(90, abs=1e-3)


def test_stars_neither_touch_nor_leave_the_tile() -> None:
    stars = _scattered(np.random.default_rng(0))
    assert len(stars) > 40
    assert {one.radius_mm for one in stars} == {radius for radius, _ in _SIZES_MM}
    for index, one in enumerate(stars):
        assert max(map(abs, one.centre_mm)) + one.radius_mm <= 12.5
        for other in stars[:index]:
            assert np.hypot(*np.subtract(one.centre_mm, other.centre_mm)) > one.radius_mm + other.radius_mm


def test_orientation_turns_evenly_along_a_star_towards_its_point() -> None:
    tile = coarse(gradient_stars)
    one = _scattered(np.random.default_rng(0))[0]
    for share in (-0.3, 0.0, 0.3, 0.8):
        found = on_circle(tile, share * one.radius_mm, one.turn_deg, one.centre_mm)
        assert apart(found, one.turn_deg + 90 * share) < 3


def test_another_seed_is_another_tile_and_the_same_seed_the_same() -> None:
    one, same, other = (coarse(gradient_stars, seed=seed).diffracts for seed in (1, 1, 2))
    np.testing.assert_array_equal(one, same)
    assert (one != other).mean() > 0.1


def test_strokes_diffract_along_themselves_and_turn_on_the_way_out() -> None:
    tile = coarse(fireworks, pixel_mm=0.02)
    for burst in _BURSTS:
        step = 360 / burst.strokes
        for index in (1, 3, 7):
            for share in (0.3, 0.7):
                found = on_circle(tile, share * burst.radius_mm, step * index, burst.centre_mm)
                assert apart(found, step * index + 60 * share) < 2
        assert np.isnan(on_circle(tile, 0.9 * burst.radius_mm, step / 2, burst.centre_mm))
        assert apart(on_circle(tile, 0.11 * burst.radius_mm, 75.0, burst.centre_mm), 75.0) < 4


@pytest.mark.parametrize("settings", [{}, IDEAL_DISC])
def test_tracks_of_the_disc_diffract_along_the_radius(settings) -> None:
    disc = coarse(compact_disc, **settings)
    error = axial_difference(disc.orientation_rad, angles_of(disc))[disc.diffracts]
    assert np.abs(error).max() < 1e-6
    assert on_circle(disc, 40.0, 30.0) == pytest.approx(30.0, abs=0.3)
    assert on_circle(disc, 40.0, 300.0) == pytest.approx(120.0, abs=0.3)
    assert np.isnan(on_circle(disc, TRACKS_FROM_MM - 0.5, 10.0))
    assert np.isnan(on_circle(disc, 50.5, 45.0))
    np.testing.assert_allclose(disc.period_um[disc.diffracts], 1.6, rtol=1e-6)


def test_an_ideal_disc_is_uniform() -> None:
    disc = coarse(compact_disc, **IDEAL_DISC)
    assert not disc.veil.any()
    assert not disc.retardation_rad.any()
    np.testing.assert_allclose(disc.amplitude_ratio, 1.001, rtol=1e-6)


def test_in_plane_birefringence_of_the_disc_lies_along_the_radius_and_grows_outwards() -> None:
    disc = coarse(compact_disc, **{**IDEAL_DISC, "in_plane_birefringence": (1.2e-5, 1.7e-5)})
    for radius, difference in ((23.0, 1.2e-5), (49.0, 1.7e-5)):
        found = disc.retardation_rad[place(disc, 0.0, radius)]
        assert found == pytest.approx(2 * np.pi * 1200 / 0.53 * difference, rel=0.02)
    turned = axial_difference(disc.film_axis_rad, angles_of(disc))[disc.diffracts]
    assert np.abs(turned).max() < 1e-5


def test_vertical_birefringence_grows_away_from_where_the_camera_stands() -> None:
    disc = coarse(compact_disc, **{**IDEAL_DISC, "vertical_birefringence": 6.5e-4, "camera_mm": [60.0, 0.0, 800.0]})
    near, far = (disc.retardation_rad[place(disc, x, 0.1)] for x in (45.0, -45.0))
    assert near == pytest.approx(2 * np.pi * 1200 / 0.53 * 6.5e-4 * (15 / 800 / 1.58) ** 2, rel=0.05)
    assert far / near == pytest.approx(49, rel=0.05)
    assert np.abs(axial_difference(disc.film_axis_rad[place(disc, -45.0, 0.1)], 0.0)) < 0.01
    assert disc.amplitude_ratio[place(disc, -45.0, 0.1)] < disc.amplitude_ratio[place(disc, 45.0, 0.1)] < 1.001


def test_print_lies_on_the_inner_ring_and_scratches_anywhere_but_in_the_hub() -> None:
    only = {**IDEAL_DISC, "print_reflectance": 0.5}
    printed = coarse(compact_disc, **only)
    rows, columns = np.nonzero(printed.veil)
    middle = len(printed.veil) / 2
    radius = np.hypot(rows + 0.5 - middle, columns + 0.5 - middle) * printed.pixel_mm
    assert PRINT_MM[0] < radius.min() < radius.max() < PRINT_MM[1]
    assert set(np.unique(printed.veil)) == {0.0, 0.5}
    assert printed.diffracts[rows, columns].all()
    scratched = compact_disc(**{**IDEAL_DISC, "scratches": 12, "pixel_mm": 0.1})
    assert 0 < np.mean(scratched.veil == 1) < 0.01


@pytest.mark.parametrize(
    ("scene", "settings", "message"),
    [
        *((scene, {"width_mm": 0.0}, "width_mm is 0") for scene in (*PRINTS, compact_disc)),
        *((scene, {"pixel_mm": 1e-5}, "points a side") for scene in (*PRINTS, compact_disc)),
        *((scene, {"margin_mm": -1.0}, "margin_mm is -1") for scene in (*PRINTS, compact_disc)),
        *((scene, {"ground_reflectance": -1.0}, "ground_reflectance is -1") for scene in PRINTS),
        *((scene, {"period_um": 0.0}, "period_um is 0") for scene in (kinematic_tile, gradient_stars, fireworks)),
        (kinematic_tile, {"sectors": 0}, "sectors is 0"),
        (banknote_emblem, {"periods_um": (1.1, 1.4)}, "two periods above 0, the longest first"),
        (banknote_emblem, {"band_mm": 0.0}, "band_mm is 0"),
        (banknote_emblem, {"ring_mm": -0.5}, "ring_mm is -0.5"),
        (gradient_stars, {"seed": -1}, "seed is -1"),
        (compact_disc, {"width_mm": 45.0}, "above 45, where the tracks begin"),
        (compact_disc, {"camera_mm": [0.0, 0.0, -1.0]}, "z above the disc's 0, or null"),
        (compact_disc, {"in_plane_birefringence": (1e-5,)}, "two differences of indices"),
        (compact_disc, {"in_plane_birefringence": (0.0, 0.5)}, "at most 0.01"),
        (compact_disc, {"vertical_birefringence": 0.5}, "vertical_birefringence is 0.5"),
        (compact_disc, {"wavelength_nm": 0.0}, "wavelength_nm is 0"),
        (compact_disc, {"scratches": -1}, "scratches is -1"),
    ],
)
def test_what_cannot_be_drawn_is_refused(scene, settings, message: str) -> None:
    with pytest.raises(InputError, match=message):
        scene(**settings)
