"""Canonical digests of settings, arrays and files.

Two values get the same digest exactly when a stage could not tell them apart: dtype, shape and C-order bytes of
arrays count, memory layout and byte order do not; ``1``, ``1.0``, ``"1"`` and ``True`` differ; the order of keys does
not count. Types without a canonical form are refused by name.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError

if TYPE_CHECKING:
    import numpy as np

DIGEST_CHARACTERS = 40
"""Hexadecimal characters kept of SHA-256: 160 bits."""

_CANONICAL_NAN = struct.pack(">d", math.nan)
_ARRAY_KINDS = "biufcUS"


class Digest(str):
    """A digest that stands for the content it was computed from, inside another value to be digested."""

    __slots__ = ()


def digest_bytes(data: bytes | memoryview) -> str:
    """Digest of raw bytes."""
    return hashlib.sha256(data).hexdigest()[:DIGEST_CHARACTERS]


def digest_file(path: Path) -> str:
    """Digest of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()[:DIGEST_CHARACTERS]


def digest_array(array: np.ndarray) -> str:
    """Digest of an array's dtype, shape and C-order bytes, whatever its layout or byte order.

    Raises
    ------
    InputError
        The array holds Python objects or fields, which have no canonical bytes.
    """
    import numpy as np

    if array.dtype.kind not in _ARRAY_KINDS:
        raise InputError(
            f"an array of dtype {array.dtype} has no canonical form", expected="numbers, booleans or strings"
        )
    plain = np.asarray(array, dtype=array.dtype.newbyteorder("<"))
    sha = hashlib.sha256(f"array {plain.dtype.str} {array.shape} ".encode())
    sha.update(plain_bytes(plain))
    return sha.hexdigest()[:DIGEST_CHARACTERS]


def plain_bytes(array: np.ndarray) -> memoryview | bytes:
    """An array's bytes in C order, without a copy where they lie so."""
    import numpy as np

    return np.asarray(array, order="C").reshape(-1).view(np.uint8).data if array.size else b""


def digest(value: object) -> str:
    """Digest of plain values, arrays and dataclasses, nested at will.

    Raises
    ------
    InputError
        Some part of the value has no canonical form; its type is named.
    """
    sha = hashlib.sha256()
    _feed(value, sha.update, "value")
    return sha.hexdigest()[:DIGEST_CHARACTERS]


def _feed(value: Any, update: Callable[[bytes], None], path: str) -> None:
    """Write the canonical form; every item carries its type and length, so that none can pose as another."""
    if isinstance(value, str):
        _sized(b"d" if isinstance(value, Digest) else b"s", value.encode("utf-8", "surrogatepass"), update)
    elif value is None:
        update(b"N")
    elif isinstance(value, bool):
        update(b"T" if value else b"F")
    elif isinstance(value, int):
        _sized(b"i", str(int(value)).encode(), update)
    elif isinstance(value, float):
        update(b"f" + (_CANONICAL_NAN if math.isnan(value) else struct.pack(">d", value)))
    elif isinstance(value, dict):
        _feed_mapping(value, update, path)
    elif getattr(value, "shape", None) == () and type(inner := value.item()) is not type(value):
        _feed(inner, update, path)
    elif isinstance(value, bytes):
        _sized(b"b", value, update)
    elif isinstance(value, list | tuple):
        update(b"l%d:" % len(value))
        for index, item in enumerate(value):
            _feed(item, update, f"{path}[{index}]")
    elif isinstance(value, Mapping):
        _feed_mapping(value, update, path)
    elif hasattr(value, "dtype") and hasattr(value, "tobytes"):
        _sized(b"d", digest_array(value).encode(), update)
    elif is_dataclass(value) and not isinstance(value, type):
        kind = type(value)
        _sized(b"c", kind.__qualname__.encode(), update)
        _feed_mapping({f.name: getattr(value, f.name) for f in fields(value)}, update, path)
    else:
        raise InputError(
            f"a value of type {type(value).__module__}.{type(value).__qualname__} has no canonical form",
            where=path,
            expected="numbers, text, booleans, None, lists, string-keyed mappings, arrays or dataclasses of these",
        )


def _sized(tag: bytes, data: bytes, update: Callable[[bytes], None]) -> None:
    update(tag + b"%d:" % len(data) + data)


def _feed_mapping(mapping: Mapping[Any, Any], update: Callable[[bytes], None], path: str) -> None:
    for name in mapping:
        if not isinstance(name, str):
            raise InputError(f"a key of type {type(name).__name__}", where=path, expected="text keys")
    update(b"m%d:" % len(mapping))
    for name in sorted(mapping):
        _feed(str(name), update, path)
        _feed(mapping[name], update, f"{path}.{name}")
