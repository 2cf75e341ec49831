"""A part of a height map."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.stages.extract.cropped import cropped


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
