"""Reading values that strangers stored: checked in every respect before they are believed."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError
from pipeline.storage.artifact import FORMAT, META, DamagedArtifact, read_artifact
from pipeline.storage.forms import DIGEST, Form, read_json

if TYPE_CHECKING:
    import numpy as np

MOST_DESCRIPTION_BYTES = 4 * 2**20
LARGEST_WHOLE = 2**64
ARRAY_FILE = re.compile(r"[\w.]{1,200}\.npy")


def read_value(folder: Path, artifact: str) -> Any:
    """The value in a folder, its arrays memory-mapped, once all of it is known to be what the digest says.

    Unlike a store, which reads what it wrote itself and sets aside what is damaged, this believes nothing and leaves
    everything where it is.

    Raises
    ------
    DamagedArtifact
        It is not; or it is nothing that a stage of ours could have given.
    """
    from pipeline.storage.store import data_types

    try:
        if not folder.is_dir() or any(p.is_symlink() or not p.is_file() for p in folder.iterdir()):
            raise DamagedArtifact(f"{folder} is no folder of files")
        content = read_json(folder / META, MOST_DESCRIPTION_BYTES)
        if content.get("format") != FORMAT or set(content) != {"format", "value"}:
            raise DamagedArtifact(f"{folder / META} is not what describes a value")
        arrays: dict[str, Mapping[str, Any]] = {}
        _check_description(content["value"], arrays, folder)
        for name, entry in arrays.items():
            _check_array(folder / name, entry)
        strangers = {p.name for p in folder.iterdir()} - {META, *arrays}
        if strangers:
            raise DamagedArtifact(f"{folder} holds {min(strangers)!r}, which its description does not name")
        return read_artifact(folder, data_types(), artifact=artifact)
    except (OSError, InputError) as error:
        raise DamagedArtifact(f"{folder} cannot be read: {error}") from None


def _check_description(description: Any, arrays: dict[str, Mapping[str, Any]], folder: Path) -> None:
    from pipeline.storage.store import data_types

    def refused(why: str) -> DamagedArtifact:
        return DamagedArtifact(f"{folder / META} {why}")

    if description is None or isinstance(description, bool | str):
        return
    if isinstance(description, int):
        if abs(description) >= LARGEST_WHOLE:
            raise refused("holds a whole number beyond 64 bits")
        return
    inner: list[Any] = []
    if isinstance(description, list):
        inner = description
    elif not isinstance(description, dict):
        raise refused(f"holds a {type(description).__name__}, which is no form of value")
    elif set(description) == {"number"}:
        _check_number(description["number"], refused)
    elif set(description) == {"mapping"} and isinstance(description["mapping"], dict):
        inner = list(description["mapping"].values())
    elif set(description) == {"array", "dtype", "shape", "digest", "bytes"}:
        _ARRAY.check(description, folder / META)
        if description["array"] in arrays or description["array"] == META:
            raise refused(f"names {description['array']!r} twice")
        arrays[description["array"]] = description
    elif set(description) == {"class", "fields"} and isinstance(description["fields"], dict):
        kind = data_types().get(str(description["class"]))
        if kind is None:
            raise refused(f"holds a {str(description['class'])!r}, which is no type of value here")
        if not set(description["fields"]) <= {field.name for field in fields(kind)}:
            raise refused(f"has fields that no {kind.__name__} has")
        inner = list(description["fields"].values())
    else:
        raise refused(f"holds an object of {sorted(description)[:5]}, which is no form of value")
    for item in inner:
        _check_description(item, arrays, folder)


_ARRAY = Form(
    {
        "array": ARRAY_FILE,
        "dtype": re.compile(r"[<|][biufcUS]\d{1,9}"),
        "shape": [int],
        "digest": DIGEST,
        "bytes": int,
    },
    "description of an array",
)


def _check_number(text: Any, refused: Any) -> None:
    try:
        float.fromhex(text)
    except (TypeError, ValueError, OverflowError):
        raise refused("holds a number that is none") from None


def _check_array(path: Path, entry: Mapping[str, Any]) -> None:
    """Refuse an array whose header does not fit its file, before NumPy takes the header's word for how much to read."""
    size = path.stat().st_size
    try:
        dtype, shape, start = _header(path)
    except (ValueError, SyntaxError, RecursionError, MemoryError, TypeError, KeyError) as error:
        raise DamagedArtifact(f"{path} has no header of an array: {error}") from None
    if dtype.hasobject or dtype.str != entry["dtype"]:
        raise DamagedArtifact(f"{path} is an array of {dtype}, and not of {entry['dtype']}")
    if list(shape) != entry["shape"] or size != entry["bytes"] or start + dtype.itemsize * math.prod(shape) != size:
        raise DamagedArtifact(f"{path} has {size} bytes, which do not fit an array of shape {list(shape)[:8]}")


def _header(path: Path) -> tuple[np.dtype, tuple[int, ...], int]:
    from tokenize import TokenError

    import numpy as np

    with path.open("rb") as file:
        if np.lib.format.read_magic(file) != (1, 0):
            raise ValueError("another version of the format")
        try:
            shape, by_column, dtype = np.lib.format.read_array_header_1_0(file)
        except TokenError as error:
            raise ValueError(str(error)) from None
        if by_column or any(length < 0 for length in shape):
            raise ValueError("columns first, or a length below 0")
        return dtype, shape, file.tell()
