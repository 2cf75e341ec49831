"""OpenEXR files with named float channels."""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO as oiio
from numpy.typing import NDArray

from pipeline.errors import PipelineError
from pipeline.storage.disks import DiskError, writing


def write_exr(path: Path, channels: Mapping[str, NDArray[Any]], attributes: Mapping[str, float | str | None]) -> None:
    """Write channels of one shape (M, N) by name, numbers and words as attributes; the file appears whole.

    Raises
    ------
    PipelineError
        The file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    stack = np.stack([np.asarray(channel, dtype=np.float32) for channel in channels.values()], axis=-1)
    spec = oiio.ImageSpec(stack.shape[1], stack.shape[0], stack.shape[2], "float")
    spec.channelnames = tuple(channels)
    spec.attribute("compression", "zip:1")
    for name, value in attributes.items():
        if value is not None:
            spec.attribute(name, value if isinstance(value, str) else float(value))
    temporary = path.with_name(f".{path.stem}.{uuid.uuid4().hex[:8]}.exr")
    try:
        out = oiio.ImageOutput.create(str(temporary))
        if out is None or not out.open(str(temporary), spec) or not out.write_image(stack) or not out.close():
            with writing(path):
                temporary.write_bytes(bytes(stack.nbytes))  # tells why the disk refuses, which OpenEXR does not
            raise PipelineError(f"{path} cannot be written: {oiio.geterror() if out is None else out.geterror()}")
        temporary.replace(path)
    except DiskError:
        raise
    except OSError as error:
        raise PipelineError(f"{path} cannot be written: {error.strerror}") from None
    finally:
        temporary.unlink(missing_ok=True)
