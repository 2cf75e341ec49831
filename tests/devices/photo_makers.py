"""Files as cameras write them, made for tests."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

FORMATS = {
    np.dtype(np.uint8): OpenImageIO.UINT8,
    np.dtype(np.uint16): OpenImageIO.UINT16,
    np.dtype(np.float32): OpenImageIO.FLOAT,
}


def write_image(path: Path, pixels: NDArray, **attributes: object) -> Path:
    """Any format of OpenImageIO, with its attributes."""
    image = pixels if pixels.ndim == 3 else pixels[..., np.newaxis]
    rows, columns, channels = image.shape
    spec = OpenImageIO.ImageSpec(columns, rows, channels, FORMATS[image.dtype])
    for name, value in attributes.items():
        spec.attribute(name.replace("__", ":"), value)
    target = OpenImageIO.ImageOutput.create(str(path))
    assert target.open(str(path), spec), target.geterror()
    assert target.write_image(np.ascontiguousarray(image)), target.geterror()
    assert target.close(), target.geterror()
    return path


def write_dng(path: Path, pixels: NDArray, *, colour: bool, black: int = 64, white: int = 4095) -> Path:
    """A minimal uncompressed DNG 1.4: an RGGB mosaic, or the frame of a camera without colour filters."""
    data = pixels.astype("<u2").tobytes()
    rows, columns = pixels.shape
    byte, text, short, long, rational, signed_rational = 1, 2, 3, 4, 5, 10
    identity = [number for entry in np.eye(3, dtype=int).ravel() for number in (int(entry), 1)]
    tags: list[tuple[int, int, list[int] | str]] = [
        (254, long, [0]),
        (256, long, [columns]),
        (257, long, [rows]),
        (258, short, [16]),
        (259, short, [1]),
        (262, short, [32803 if colour else 34892]),
        (271, text, "Acme"),
        (272, text, "Bench One"),
        (273, long, [8]),
        (277, short, [1]),
        (278, long, [rows]),
        (279, long, [len(data)]),
        *([(33421, short, [2, 2]), (33422, byte, [0, 1, 1, 2])] if colour else []),
        (33434, rational, [1, 200]),
        (50706, byte, [1, 4, 0, 0]),
        (50708, text, "Acme Bench1"),
        (50714, long, [black]),
        (50717, long, [white]),
        *([(50721, signed_rational, identity)] if colour else []),
    ]
    directory, values = struct.pack("<H", len(tags)), b""
    behind = 8 + len(data) + 2 + 12 * len(tags) + 4
    for tag, kind, content in tags:
        if isinstance(content, str):
            packed, count = content.encode() + b"\0", len(content) + 1
        else:
            code = {byte: "B", short: "H", long: "I", rational: "I", signed_rational: "i"}[kind]
            packed = struct.pack(f"<{len(content)}{code}", *content)
            count = len(content) // (2 if kind in (rational, signed_rational) else 1)
        if len(packed) > 4:
            place = struct.pack("<I", behind + len(values))
            values += packed + b"\0" * (len(packed) % 2)
        else:
            place = packed.ljust(4, b"\0")
        directory += struct.pack("<HHI", tag, kind, count) + place
    path.write_bytes(b"II*\0" + struct.pack("<I", 8 + len(data)) + data + directory + struct.pack("<I", 0) + values)
    return path
