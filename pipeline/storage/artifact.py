"""Values on disk: a folder with ``meta.json`` and one ``.npy`` file an array; nothing in it is ever executed.

``meta.json`` holds the value's type, its plain fields, and for each array the file, dtype, shape and digest. The
digest of the whole is computed from ``meta.json`` alone; each array is checked against its own digest when it is read.
"""

from __future__ import annotations

import io
import json
import re
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import PipelineError
from pipeline.storage.files import write_pieces
from pipeline.storage.keys import Digest, digest, digest_array, plain_bytes

if TYPE_CHECKING:
    import numpy as np

FORMAT = 1
META = "meta.json"
_JOINED_BYTES = 65_536
"""Arrays no larger than this are written together with their header."""
_TRIES = 20
_MALFORMED = (KeyError, TypeError, ValueError, AttributeError, OverflowError)


class DamagedArtifact(PipelineError):
    """An artifact's files are not what its digests say."""


def content_of(value: object) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Split a value into its description, which JSON can hold, and its arrays by file name."""
    arrays: dict[str, np.ndarray] = {}
    description = _describe(value, "value", arrays)
    return description, arrays


def digest_of(description: Mapping[str, Any]) -> str:
    """Digest of a value, from its description."""
    return digest(_digestible(description))


def write_artifact(folder: str | Path, description: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write a value into an empty folder that has no name yet which counts."""
    for name, array in arrays.items():
        header, data = _header(array.dtype.str, array.shape), plain_bytes(array)
        pieces = (header + bytes(data),) if array.nbytes <= _JOINED_BYTES else (header, data)
        write_pieces(f"{folder}/{name}", *pieces)
    write_pieces(f"{folder}/{META}", json.dumps({"format": FORMAT, "value": description}).encode())


def read_description(folder: Path) -> dict[str, Any]:
    """The description of the value in a folder.

    Raises
    ------
    DamagedArtifact
        ``meta.json`` is missing or not what this version writes.
    """
    try:
        content = json.loads((folder / META).read_text())
        if content["format"] != FORMAT:
            raise DamagedArtifact(f"{folder / META} has format {content['format']}, expected {FORMAT}")
        return dict(content["value"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise DamagedArtifact(f"{folder / META} cannot be read: {error}") from None


def is_whole(folder: Path) -> bool:
    """Whether all files are there with the right sizes, without reading them."""
    try:
        return all((folder / name).stat().st_size == size for name, size in _files(read_description(folder)).items())
    except (OSError, DamagedArtifact, *_MALFORMED):
        return False


def read_artifact(folder: Path, types: Mapping[str, type], *, artifact: str | None = None) -> Any:
    """The value in a folder, its arrays memory-mapped and read-only.

    Parameters
    ----------
    folder : Path
        The artifact.
    types : mapping of str to type
        The classes that a value may have; no other is looked for.
    artifact : str, optional
        Digest that the value must have; all is read to check it. Without, nothing is checked but forms and sizes.

    Raises
    ------
    DamagedArtifact
        A file is missing, torn, of another type than described, or has another digest.
    """

    def load(entry: Mapping[str, Any]) -> np.ndarray:
        name = str(entry["array"])
        if "/" in name or "\\" in name or not name.endswith(".npy"):
            raise DamagedArtifact(f"{folder} names a file outside itself: {name}")
        try:
            array = _load(folder / name, mapped=bool(entry["shape"]))
        except Exception as error:  # a header that was damaged can fail in any way
            raise DamagedArtifact(f"{folder / name} cannot be read: {error}") from None
        if array.dtype.str != entry["dtype"] or list(array.shape) != entry["shape"]:
            raise DamagedArtifact(f"{folder / name} is not the array that {META} describes")
        if artifact is not None and digest_array(array) != entry["digest"]:
            raise DamagedArtifact(f"{folder / name} has changed since it was written")
        return array

    try:
        description = read_description(folder)
        if artifact is not None and digest_of(description) != artifact:
            raise DamagedArtifact(f"{folder} is not the value of its name")
        return _rebuild(description, types, load, folder)
    except _MALFORMED as error:
        raise DamagedArtifact(f"{folder / META} is not what this version writes: {error!r}") from None


def _load(path: Path, *, mapped: bool) -> np.ndarray:
    """An array of a file, tried again where threads get in each other's way: see CPython's issue 106905."""
    import numpy as np

    for _ in range(_TRIES - 1):
        with suppress(SystemError):
            return np.load(path, mmap_mode="r" if mapped else None, allow_pickle=False)
    return np.load(path, mmap_mode="r" if mapped else None, allow_pickle=False)


def frozen(arrays: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Copies of arrays that nobody can write to, nor make writeable, as those of :func:`read_artifact`."""
    import numpy as np

    return {name: np.ndarray(a.shape, a.dtype, bytes(plain_bytes(a))) for name, a in arrays.items()}


def rebuilt(description: Mapping[str, Any], types: Mapping[str, type], arrays: Mapping[str, np.ndarray]) -> Any:
    """The value of a description and its arrays, as :func:`read_artifact` gives it; all but the arrays is made anew."""
    return _rebuild(description, types, lambda entry: arrays[entry["array"]], Path())


def _describe(value: Any, name: str, arrays: dict[str, np.ndarray]) -> Any:
    import numpy as np

    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, int | float):
        return {"number": value.hex()} if isinstance(value, float) else value
    if isinstance(value, np.ndarray):
        file = _file_name(name, arrays)
        plain = value.astype(value.dtype.newbyteorder("<"), copy=False)
        arrays[file] = plain
        return {
            "array": file,
            "dtype": plain.dtype.str,
            "shape": list(plain.shape),
            "digest": digest_array(plain),
            "bytes": len(_header(plain.dtype.str, plain.shape)) + plain.nbytes,
        }
    if is_dataclass(value) and not isinstance(value, type):
        members = {f.name: _describe(getattr(value, f.name), f"{name}.{f.name}", arrays) for f in fields(value)}
        return {"class": type(value).__name__, "fields": members}
    if isinstance(value, tuple | list):
        return [_describe(item, f"{name}.{i}", arrays) for i, item in enumerate(value)]
    if isinstance(value, Mapping):
        return {"mapping": {str(k): _describe(v, f"{name}.{k}", arrays) for k, v in value.items()}}
    raise PipelineError(f"{name} is of type {type(value).__name__}, which has no form on disk")


def _file_name(name: str, taken: Mapping[str, object]) -> str:
    plain = re.sub(r"[^\w.]+", "_", name.removeprefix("value.")) + ".npy"
    return plain if plain not in taken else f"{len(taken)}_{plain}"


@lru_cache(maxsize=1024)
def _header(dtype: str, shape: tuple[int, ...]) -> bytes:
    """What stands before an array's bytes in a ``.npy`` file."""
    import numpy as np

    header = io.BytesIO()
    descr = np.lib.format.dtype_to_descr(np.dtype(dtype))
    np.lib.format.write_array_header_1_0(header, {"descr": descr, "fortran_order": False, "shape": shape})
    return header.getvalue()


def _digestible(description: Any) -> Any:
    """The description with arrays and numbers in their places; names that a user gave are never taken for tags."""
    if isinstance(description, list):
        return [_digestible(item) for item in description]
    if not isinstance(description, Mapping):
        return description
    if "array" in description:
        return Digest(description["digest"])
    if "number" in description:
        return float.fromhex(description["number"])
    inside = "mapping" if "mapping" in description else "fields"
    members = {name: _digestible(item) for name, item in description[inside].items()}
    return {**description, inside: members}


def _files(description: Any) -> dict[str, int]:
    """Sizes of the files of all arrays."""
    if isinstance(description, list):
        inner: Iterable[Any] = description
    elif not isinstance(description, Mapping) or "number" in description:
        return {}
    elif "array" in description:
        return {str(description["array"]): int(description["bytes"])}
    else:
        inner = description["mapping" if "mapping" in description else "fields"].values()
    return {name: size for item in inner for name, size in _files(item).items()}


def _rebuild(
    description: Any, types: Mapping[str, type], load: Callable[[Mapping[str, Any]], np.ndarray], folder: Path
) -> Any:
    if isinstance(description, list):
        return tuple(_rebuild(item, types, load, folder) for item in description)
    if not isinstance(description, Mapping):
        return description
    if "array" in description:
        return load(description)
    if "number" in description:
        return float.fromhex(description["number"])
    if "mapping" in description:
        return {k: _rebuild(v, types, load, folder) for k, v in description["mapping"].items()}
    name = description.get("class")
    kind = types.get(str(name))
    if kind is None:
        raise DamagedArtifact(f"{folder} holds a '{name}', which is no type of value here")
    members = {k: _rebuild(v, types, load, folder) for k, v in description["fields"].items()}
    try:
        return kind(**members)
    except TypeError as error:
        raise DamagedArtifact(f"{folder} does not fit {name}: {error}") from None
