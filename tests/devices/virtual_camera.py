"""The camera that libgphoto2 makes up, a Nikon D750 that delivers a JPEG from a folder."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from photo_makers import write_image

ROWS, COLUMNS = 24, 32
FILE_BYTES = 8192
"""Of every file: libgphoto2's virtual camera remembers how long the first one was, and where it lay."""


class VirtualCamera:
    """What stands before libgphoto2's virtual camera."""

    def __init__(self, folder: Path) -> None:
        self._file = folder / "DCIM" / "seen.jpg"

    def sees(self, pixels: NDArray[np.uint8], **attributes: object) -> None:
        """Let the next photograph be these pixels, 8 bits, encoded for a display."""
        self.delivers(write_image(self._file, pixels, Compression="jpeg:100", **attributes).read_bytes())

    def sees_grey(self, level: int) -> None:
        """Let the next photograph be even."""
        self.sees(np.full((ROWS, COLUMNS, 3), level, np.uint8))

    def delivers(self, content: bytes) -> None:
        """Let the next photograph be a file of this content, and zeros behind it."""
        assert len(content) <= FILE_BYTES
        self._file.write_bytes(content.ljust(FILE_BYTES, b"\0"))


@contextmanager
def connected(base: Path, *, cameras: bool = True) -> Iterator[VirtualCamera]:
    """Connect the virtual camera, or none: libgphoto2 looks for ports where IOLIBS says.

    All tests of one process use the same ``base``.
    """
    folder = base / "virtual camera"
    (folder / "DCIM").mkdir(parents=True, exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VCAMERADIR", str(folder))
        libraries = Path(pytest.importorskip("gphoto2").__file__).parent / "libgphoto2"
        if not (libraries / "vusb").is_dir():
            pytest.skip("this libgphoto2 has no virtual camera")
        patch.setenv("IOLIBS", str(libraries / ("vusb" if cameras else "iolibs")))
        yield VirtualCamera(folder)
