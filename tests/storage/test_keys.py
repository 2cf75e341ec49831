"""Digests: frozen values, and what may and may not tell two values apart."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from pipeline.errors import InputError
from pipeline.storage.keys import Digest, digest, digest_array, digest_file

PLAIN = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)
ARRAYS = hnp.arrays(
    dtype=st.sampled_from(["u1", "<u2", "<i4", "<i8", "<f4", "<f8", "<c8", "?"]),
    shape=hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=5),
)


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (None, "8ce86a6ae65d3692e7305e2c58ac62eebd97d3d9"),
        (True, "e632b7095b0bf32c260fa4c539e9fd7b852d0de4"),
        (1, "f7e4bdb03eefaca0319450705ce053a8f7f396db"),
        (1.0, "e2ac13292d1245bac0ce7b682e9b0efef04e53d2"),
        ("1", "ea4cb38773dbeb62118b1a71f70929c725ecd5aa"),
        ([1, 2.5, "psi"], "f347396d22dade78651f3335666e918577fe0982"),
        ({"stage": "fit.cosine", "settings": {"prenormalize": False}}, "48400f742b965e97530803338ae8abfffd2b883a"),
    ],
)
def test_golden_digests_of_plain_values(value: object, expected: str) -> None:
    assert digest(value) == expected


@pytest.mark.parametrize(
    ("array", "expected"),
    [
        (np.arange(6, dtype=np.float32).reshape(2, 3), "b79a9437f80571f753e2c6220234dc15158b358f"),
        (np.arange(6, dtype=np.uint16).reshape(3, 2), "4b44b977fa08720bf812b4f3d197924a37caad0f"),
        (np.array([True, False]), "d98a4b90779b0ffe75435d50ebe06529b968c2f5"),
    ],
)
def test_golden_digests_of_arrays(array: np.ndarray, expected: str) -> None:
    assert digest_array(array) == expected


def test_same_bytes_of_another_type_or_shape_differ() -> None:
    zeros = np.zeros(8, np.uint8)
    views = [zeros, zeros.reshape(2, 4), zeros.view(np.int8), zeros.view(np.float32), zeros.view(np.bool_)]
    assert len({digest_array(v) for v in views}) == len(views)


def test_numbers_text_and_booleans_differ() -> None:
    values = [1, 1.0, "1", True, [1], {"1": 1}, b"1", None, [], {}, "", 0, 0.0, -0.0, False, Digest("1")]
    assert len({digest(v) for v in values}) == len(values)


def test_every_nan_is_the_same_setting() -> None:
    assert digest(math.nan) == digest(-math.nan) == digest(np.float64("nan"))


def test_numpy_scalars_are_numbers() -> None:
    assert digest(np.float64(0.1)) == digest(0.1)
    assert digest(np.int16(7)) == digest(7)
    assert digest(np.True_) == digest(True)


def test_nesting_cannot_be_confused() -> None:
    assert digest(["ab", "c"]) != digest(["a", "bc"])
    assert digest([[1], [2]]) != digest([[1, 2]])
    assert digest({"a": {"b": 1}}) != digest({"a": 1, "b": 1})


@given(ARRAYS)
def test_layout_and_byte_order_do_not_count(array: np.ndarray) -> None:
    expected = digest_array(array)
    assert digest_array(array.astype(array.dtype.newbyteorder(">"))) == expected
    if array.ndim:
        assert digest_array(np.asfortranarray(array)) == expected
        assert digest_array(np.repeat(array, 2, axis=0)[::2]) == expected


@given(PLAIN)
def test_order_of_keys_does_not_count(value: object) -> None:
    def reversed_(item: object) -> object:
        if isinstance(item, dict):
            return {k: reversed_(item[k]) for k in reversed(list(item))}
        return [reversed_(i) for i in item] if isinstance(item, list) else item

    assert digest(value) == digest(reversed_(value))


@given(PLAIN, PLAIN)
def test_equal_digests_mean_equal_values(one: object, other: object) -> None:
    assert (digest(one) == digest(other)) == (_typed(one) == _typed(other))


def _typed(value: object) -> object:
    if isinstance(value, dict):
        return {k: _typed(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_typed(v) for v in value]
    return (type(value).__name__, value.hex() if isinstance(value, float) else value)


@dataclass(frozen=True)
class Point:
    x: float
    values: object


def test_dataclasses_count_by_name_and_fields() -> None:
    assert digest(Point(1.0, np.zeros(2))) == digest(Point(1.0, np.zeros(2)))
    assert digest(Point(1.0, np.zeros(2))) != digest(Point(1.0, np.zeros(3)))


@pytest.mark.parametrize("value", [{1, 2}, object(), Path("x"), len])
def test_types_without_a_canonical_form_are_refused_by_name(value: object) -> None:
    with pytest.raises(InputError, match=rf"type \w+\.{type(value).__qualname__} has no canonical form"):
        digest({"inner": [value]})


def test_arrays_of_objects_are_refused() -> None:
    with pytest.raises(InputError, match="dtype object has no canonical form"):
        digest_array(np.array([object()]))


def test_a_files_digest_is_that_of_its_bytes(tmp_path: Path) -> None:
    path = tmp_path / "a"
    path.write_bytes(b"abc")
    assert digest_file(path) == "ba7816bf8f01cfea414140de5dae2223b00361a3"
