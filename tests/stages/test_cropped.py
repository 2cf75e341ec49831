"""A part of a height map, moved, and made to fit itself."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.stages.extract.cropped import cropped
from pipeline.stages.extract.seamless import seamless
from pipeline.stages.extract.shifted import shifted


def test_the_middle_is_kept_and_no_longer_repeats() -> None:
    surface = HeightField(np.arange(80.0).reshape(8, 10), 0.5, periodic=True)
    found = cropped(surface, width_um=2.0)
    np.testing.assert_array_equal(found.height_um, surface.height_um[2:6, 3:7])
    assert not found.periodic
    square = HeightField(np.arange(64.0).reshape(8, 8), 0.5, periodic=True)
    assert cropped(square, width_um=4.0).periodic


def test_a_square_wider_than_the_map_is_refused() -> None:
    with pytest.raises(InputError, match=r"width_um is 9\n.*\n.*1 to 4, the map's"):
        cropped(HeightField(np.zeros((8, 10)), 0.5), width_um=9.0)


def test_a_map_moves_right_and_up_and_comes_round() -> None:
    surface = HeightField(np.arange(80.0).reshape(8, 10), 0.5)
    found = shifted(surface, right=0.2, up=0.25).height_um
    assert found[0, 2] == surface.height_um[2, 0]
    np.testing.assert_array_equal(shifted(shifted(surface, right=0.3), right=-0.3).height_um, surface.height_um)
    with pytest.raises(InputError, match=r"right is 2"):
        shifted(surface, right=2.0)


def test_a_map_without_a_seam_steps_at_its_border_as_inside_and_is_as_rough() -> None:
    rng = np.random.default_rng(3)
    y, x = np.mgrid[:400, :500]
    waves = [np.cos(x * a + y * b + c) for a, b, c in rng.uniform(-0.5, 0.5, (40, 3)) * [1, 1, 12]]
    surface = HeightField(np.sum(waves, axis=0), 0.1)
    found = seamless(surface, overlap_um=10.0)
    assert found.periodic
    assert found.height_um.shape == (300, 400)
    for axis in (0, 1):
        steps = np.sqrt(
            (np.diff(found.height_um, axis=axis, append=np.take(found.height_um, [0], axis)) ** 2).mean(1 - axis)
        )
        assert steps[-1] < 1.2 * steps[:-1].max()
    middle = slice(0, 200)
    np.testing.assert_allclose(found.height_um[middle, middle], surface.height_um[100:300, 100:300])
    assert found.height_um[-50:].std() == pytest.approx(surface.height_um.std(), rel=0.15)


def test_a_map_that_repeats_has_no_seam_to_take_away() -> None:
    surface = HeightField(np.zeros((8, 10)), 0.5, periodic=True)
    assert seamless(surface) is surface


def test_an_overlap_wider_than_half_the_map_is_refused() -> None:
    with pytest.raises(InputError, match=r"overlap_um is 4\n.*\n.*1 to 2, half of the map"):
        seamless(HeightField(np.zeros((8, 10)), 0.5), overlap_um=4.0)
