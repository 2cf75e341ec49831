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


class VirtualCamera:
    """What stands before libgphoto2's virtual camera."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def sees(self, pixels: NDArray[np.uint8], **attributes: object) -> None:
        """Let the next photograph be these pixels, 8 bits, encoded for a display."""
        write_image(self.folder / "DCIM" / "seen.jpg", pixels, Compression="jpeg:100", **attributes)

    def sees_grey(self, level: int) -> None:
        """Let the next photograph be even."""
        self.sees(np.full((ROWS, COLUMNS, 3), level, np.uint8))


@contextmanager
def connected(folder: Path, *, cameras: bool = True) -> Iterator[VirtualCamera]:
    """Connect the virtual camera, or none: libgphoto2 looks for ports where IOLIBS says."""
    (folder / "DCIM").mkdir(parents=True)
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("VCAMERADIR", str(folder))
        libraries = Path(pytest.importorskip("gphoto2").__file__).parent / "libgphoto2"
        if not (libraries / "vusb").is_dir():
            pytest.skip("this libgphoto2 has no virtual camera")
        patch.setenv("IOLIBS", str(libraries / ("vusb" if cameras else "iolibs")))
        yield VirtualCamera(folder)
