"""Whether a PNG or TIFF file, or a camera raw file built like a TIFF, is as long as it says."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

_PNG_START, _PNG_END = b"\x89PNG\r\n\x1a\n", b"IEND\xaeB`\x82"
_BYTES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4, 16: 8, 17: 8, 18: 8}
_CODES = {3: "H", 4: "I", 13: "I", 16: "Q", 18: "Q"}
_MOST_DIRECTORIES = 64
_SUB_DIRECTORIES = 330
_PIXELS = ((273, 279), (324, 325), (513, 514))
"""Tags of offsets and byte counts: of strips, tiles and embedded JPEG pictures."""


def is_cut_short(path: Path, *, tags: bool = True) -> bool:
    """Whether a TIFF or PNG file ends before what it promises; False for other formats.

    Decoders do not notice a file that lost only the end of its tags, and some fill lost pixels with zeros.

    Parameters
    ----------
    path : Path
        File to look at.
    tags : bool
        Whether the values of TIFF tags count too, not only pixels. Those of makers' raw formats may point where they
        like.
    """
    data = path.read_bytes()
    if data.startswith(_PNG_START):
        return _PNG_END not in data
    try:
        return max(_extents(data, tags), default=0) > len(data)
    except struct.error:
        return True


def _extents(data: bytes, tags: bool) -> Iterator[int]:
    """Where each directory, tag value and run of pixels ends."""
    order = {b"II": "<", b"MM": ">"}.get(data[:2])
    if order is None:
        return
    version = struct.unpack_from(order + "H", data, 2)[0]
    if version not in (42, 43):
        return
    big = version == 43
    offset_code, count_code, entry_bytes, inline = ("Q", "Q", 20, 8) if big else ("I", "H", 12, 4)
    pending = [struct.unpack_from(order + offset_code, data, 8 if big else 4)[0]]
    seen: set[int] = set()
    while pending and len(seen) < _MOST_DIRECTORIES:
        start = pending.pop()
        if not start or start in seen:
            continue
        seen.add(start)
        count = struct.unpack_from(order + count_code, data, start)[0]
        first = start + struct.calcsize(count_code)
        numbers: dict[int, tuple[int, ...]] = {}
        for entry in range(first, first + count * entry_bytes, entry_bytes):
            tag, kind, length = struct.unpack_from(order + "HH" + offset_code, data, entry)
            size = _BYTES.get(kind, 0) * length
            place = entry + entry_bytes - inline
            if size > inline:
                place = struct.unpack_from(order + offset_code, data, place)[0]
                if tags:
                    yield place + size
            if kind in _CODES and (tag == _SUB_DIRECTORIES or any(tag in pair for pair in _PIXELS)):
                numbers[tag] = struct.unpack_from(f"{order}{length}{_CODES[kind]}", data, place)
        for offsets, sizes in _PIXELS:
            yield from (a + b for a, b in zip(numbers.get(offsets, ()), numbers.get(sizes, ()), strict=False))
        pending += numbers.get(_SUB_DIRECTORIES, ())
        end = first + count * entry_bytes
        pending.append(struct.unpack_from(order + offset_code, data, end)[0])
        yield end + struct.calcsize(offset_code)
