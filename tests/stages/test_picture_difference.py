"""How far pictures are from others."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.data.pictures import Pictures, PictureSeries
from pipeline.errors import InputError
from pipeline.optics.colour import encode_srgb
from pipeline.stages.evaluate.picture_difference import picture_difference


def pictures(*values: float) -> Pictures:
    rgb = np.zeros((1, 2, 2, 3), np.float32)
    rgb[0, 0, :, :] = np.array(values)[:, None]
    return Pictures(rgb, ("one",))


def test_differences_are_relative_to_the_reference() -> None:
    found = picture_difference(pictures(0.5, 0.25), pictures(1.0, 0.25), white_percentile=100.0).metrics
    assert found["picture_error_max_percent"] == pytest.approx(50)
    assert found["picture_light_percent"] == pytest.approx(60)
    encoded = float(encode_srgb(np.array(1.0)) - encode_srgb(np.array(0.5)))
    assert found["picture_error_rms_percent"] == pytest.approx(100 * encoded / np.sqrt(2), rel=1e-5)


def test_black_where_the_reference_is_lit_counts_and_the_ground_does_not() -> None:
    found = picture_difference(pictures(0.0, 1.0), pictures(1.0, 1.0)).metrics
    assert found["picture_error_rms_percent"] == pytest.approx(100 / np.sqrt(2))


def test_pictures_that_cannot_be_compared_are_refused() -> None:
    with pytest.raises(InputError, match="differ in number or size"):
        picture_difference(pictures(1, 1), Pictures(np.ones((1, 3, 2, 3), np.float32), ("one",)))
    with pytest.raises(InputError, match="the reference is black"):
        picture_difference(pictures(1, 1), pictures(0, 0))


def test_pictures_under_a_torch_compare_alike() -> None:
    first, second = (PictureSeries(pictures(value, 0.25).rgb, np.zeros((1, 3)), np.zeros(3)) for value in (0.5, 1.0))
    assert (
        picture_difference(first, second).metrics == picture_difference(pictures(0.5, 0.25), pictures(1, 0.25)).metrics
    )


def test_pictures_of_another_contrast_correlate_and_even_ones_do_not() -> None:
    first, second = pictures(0.5, 0.25), pictures(1.0, 0.25)
    assert picture_difference(first, second, white_percentile=100.0).metrics["picture_correlation"] == pytest.approx(1)
    assert "picture_correlation" not in picture_difference(pictures(1.0, 1.0), second).metrics
