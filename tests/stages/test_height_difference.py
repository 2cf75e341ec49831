"""Two height maps compared."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.data.height_fields import HeightField
from pipeline.errors import InputError
from pipeline.stages.evaluate.height_difference import height_difference


def test_the_difference_is_that_of_the_shapes() -> None:
    reference = HeightField(np.array([[0.0, 1.0], [np.nan, 2.0]]), 0.1)
    estimate = replace(reference, height_um=np.array([[5.0, 6.3], [7.0, 7.0]]))
    found = height_difference(estimate, reference).metrics
    rms = np.std([5.0, 5.3, 5.0])
    assert found["height_difference_rms_um"] == pytest.approx(rms)
    assert found["height_difference_percent"] == pytest.approx(100 * rms / np.std([0, 1, 2]))


@pytest.mark.parametrize(
    ("other", "message"),
    [
        (HeightField(np.zeros((2, 3)), 0.1), r"maps of \(2, 3\) and \(2, 2\) samples"),
        (HeightField(np.zeros((2, 2)), 0.2), r"maps of 0.2 and 0.1 um pitch"),
        (HeightField(np.full((2, 2), np.nan), 0.1), r"the maps share no known height"),
    ],
)
def test_maps_that_do_not_fit_are_refused(other: HeightField, message: str) -> None:
    with pytest.raises(InputError, match=message):
        height_difference(other, HeightField(np.eye(2), 0.1))
