"""Numbers of single precision as their shortest decimals."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.devices.single_precision import shortest


@pytest.mark.parametrize("number", [0.005, 0.006666667, 0.03, 1 / 8, 1234.5, -0.5, 1e-7, 0.0])
def test_the_shortest_decimal_comes_back_whatever_print_options_a_library_has_set(number: float) -> None:
    with np.printoptions(legacy="1.13", precision=3):
        assert shortest(np.float32(number)) == number
    assert shortest(np.float32(number)) == number
