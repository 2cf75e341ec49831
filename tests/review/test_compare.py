"""Comparing values: identical exactly when the digest is, and otherwise by how much."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.data.gratings import OrientationError, OrientationMap, PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import Photo, PolarizerPhoto, PolarizerSequence
from pipeline.errors import InputError
from pipeline.review.compare import Difference, checked_tolerance, compare
from pipeline.storage.keys import digest


def period(*rows: list[float], **more: Any) -> PeriodMap:
    array = np.array(rows, np.float32)
    return PeriodMap(array, np.isfinite(array), **more)


def orientation(*radians: float) -> OrientationMap:
    a = np.array([radians], np.float32)
    return OrientationMap(a, np.ones_like(a), np.ones_like(a), np.isfinite(a))


def only(found: tuple[Difference, ...]) -> Difference:
    assert len(found) == 1, found
    return found[0]


def test_equal_values_do_not_differ() -> None:
    a = period([1, math.nan], [3, 4], pixel_mm=0.02)
    assert compare(a, period([1, math.nan], [3, 4], pixel_mm=0.02)) == ()


def test_the_largest_difference_is_found_absolute_and_relative() -> None:
    found = only(compare(period([1, 2, 100, 8]), period([1, 3, 104, 8])))
    assert found.field == "period_um"
    assert (found.largest, found.share) == (4.0, 0.5)
    assert found.relative == pytest.approx(1 / 3)
    assert str(found) == "period_um: 50 % of the elements differ, by up to 4 (relative 0.333)"


def test_nan_in_one_only_is_counted_and_never_tolerated() -> None:
    a = PeriodMap(np.array([[1, math.nan, math.nan]], np.float32), np.ones((1, 3), bool))
    b = PeriodMap(np.array([[1, 2, math.nan]], np.float32), np.ones((1, 3), bool))
    found = only(compare(a, b, {"period_um": 1e9}))
    assert (found.only_nan, found.largest) == (1, 0.0)
    assert not found.tolerated
    assert "1 are NaN in one only" in str(found)


def test_orientations_are_compared_modulo_pi() -> None:
    pair = orientation(0.001, 1.0), orientation(math.pi - 0.001, 1.0)
    found = only(compare(*pair))
    assert found.largest == pytest.approx(0.002, abs=1e-6)
    assert found.relative is None
    far = only(compare(orientation(0.0), orientation(math.pi / 2)))
    assert far.largest == pytest.approx(math.pi / 2, abs=1e-6)


def test_cycles_hold_for_figures_too() -> None:
    a, b = Metrics({"offset_deg": 0.25}), Metrics({"offset_deg": 179.75})
    assert only(compare(a, b)).largest == pytest.approx(0.5)
    other = Metrics({"mean_deg": 0.25}), Metrics({"mean_deg": 179.75})
    assert only(compare(*other)).largest == pytest.approx(179.5)


def test_masks_have_a_share_and_no_amount() -> None:
    found = compare(period([1, 2, 3, 4]), PeriodMap(period([1, 2, 3, 4]).period_um, np.array([[1, 1, 1, 0]], bool)))
    assert str(only(found)) == "mask: 25 % of the elements differ"
    assert only(found).largest is None


def test_shapes_types_and_texts_are_said_in_words() -> None:
    a = period([1, 2])
    assert "shape (1, 2) -> (2, 2)" in str(compare(a, period([1, 2], [3, 4]))[0])
    assert "type float32 -> float64" in str(compare(a, PeriodMap(a.period_um.astype(float), a.mask))[0])
    assert str(only(compare(a, Metrics({})))) == "PeriodMap -> Metrics"
    assert str(only(compare(a, period([1, 2], pixel_mm=0.5)))) == "pixel_mm: None -> 0.5"
    texts = (Photo(a.period_um, a.mask, metadata={"iso": iso}) for iso in ("100", "200"))
    assert str(only(compare(*texts))) == "metadata.iso: '100' -> '200'"


def test_one_and_one_point_zero_differ_as_their_digests_do() -> None:
    assert only(compare(Metrics({"n": 1}), Metrics({"n": 1.0}))).change == "1 -> 1.0"


def test_figures_that_one_lacks_are_named() -> None:
    found = compare(Metrics({"a": 1.0, "b": 2.0}), Metrics({"b": 2.0, "c": 3.0}))
    assert [str(d) for d in found] == ["metrics.a: only the first has it", "metrics.c: only the second has it"]


def test_nested_values_and_tuples_are_followed() -> None:
    def photo(value: float) -> PolarizerPhoto:
        return PolarizerPhoto(Photo(np.full((2, 2), value, np.float32), np.zeros((2, 2), bool)), 0.5)

    assert only(compare(photo(1), photo(2))).field == "photo.image"
    a = np.zeros((2, 1, 1), np.float32)
    sequences = [PolarizerSequence(a, np.zeros(2), a[0] > 0, exposure_s=e) for e in ((0.1, 0.2), (0.1, 0.3), (0.1,))]
    assert only(compare(*sequences[:2])).field == "exposure_s.1"
    assert only(compare(sequences[0], sequences[2])).change == "2 items -> 1"


def test_signs_of_zeros_count_since_their_bytes_do() -> None:
    found = only(compare(period([0.0, 1.0]), period([-0.0, 1.0])))
    assert (found.largest, found.share) == (0.0, 0.0)
    assert "signs of zeros" in str(found)
    assert only(compare(Metrics({"a": 0.0}), Metrics({"a": -0.0}))).largest == 0.0


def test_infinite_and_huge_numbers_are_compared() -> None:
    found = only(compare(Metrics({"a": math.inf}), Metrics({"a": 1.0})))
    assert found.largest == math.inf
    a, b = (PeriodMap(np.array([[x]], np.float32), np.ones((1, 1), bool)) for x in (-math.inf, math.inf))
    assert only(compare(a, b)).largest == math.inf
    tags = [PeriodMap(np.array([[x]], np.uint64), np.ones((1, 1), bool)) for x in (2**64 - 1, 2**64 - 2)]
    assert only(compare(*tags)).largest == 1.0


def test_a_tolerance_is_the_largest_difference_allowed() -> None:
    a, b = orientation(1.0, 2.0), orientation(1.0, 2.25)
    assert only(compare(a, b, {"orientation_rad": 0.25})).tolerated
    assert not only(compare(a, b, {"orientation_rad": 0.2})).tolerated
    assert not only(compare(a, b)).tolerated
    assert not only(compare(a, b, {"correlation": 1.0})).tolerated
    assert "by up to 0.25 of 0.25 allowed" in str(only(compare(a, b, {"orientation_rad": 0.25})))


def test_a_tolerance_counts_for_what_is_inside() -> None:
    a, b = Metrics({"x_um": 1.0, "y_um": 2.0}), Metrics({"x_um": 1.5, "y_um": 2.5})
    found = compare(a, b, {"metrics": 1.0, "metrics.y_um": 0.1})
    assert [d.tolerated for d in found] == [True, False]


@pytest.mark.parametrize("stated", [{"a": "1"}, {"a": -1.0}, {"a": True}, [1], {1: 1.0}])
def test_an_impossible_tolerance_is_refused(stated: Any) -> None:
    with pytest.raises(InputError, match=r"the tolerance of fit\.cosine is"):
        checked_tolerance(stated, "fit.cosine")


def test_large_arrays_are_read_in_pieces() -> None:
    a = np.zeros((3, 1 << 20), np.float32)
    b = a.copy()
    b[2, -1] = 5
    b[0, 0] = 1
    found = only(compare(PeriodMap(a, a > 1), PeriodMap(b, a > 1)))
    assert (found.largest, found.share) == (5.0, 2 / a.size)


values = st.floats(width=32) | st.sampled_from([0.0, -0.0, math.nan])
pairs = hnp.arrays(np.float32, (2, 3), elements=values)


@given(pairs, pairs, st.floats(), st.floats())
def test_nothing_differs_exactly_when_the_digests_agree(
    first: np.ndarray, second: np.ndarray, x: float, y: float
) -> None:
    a, b = (OrientationError(m, f, {"x_deg": f}) for m, f in ((first, x), (second, y)))
    assert (compare(a, b) == ()) == (digest(a) == digest(b))
