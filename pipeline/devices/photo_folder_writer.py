"""Photographs written as a folder that a replay takes in again, bit for bit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
import yaml
from numpy.typing import NDArray

from pipeline.data.flash import FlashBrackets
from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import PictureSeries
from pipeline.devices.capture_yaml import CAPTURE_FILE, KIND
from pipeline.devices.decimal_angles import degrees_of
from pipeline.devices.flash_yaml import KIND as FLASH
from pipeline.devices.point_light_folder import KIND as POINT_LIGHT
from pipeline.errors import DeviceError, InputError

MASK_FILE = "mask.png"

_FORMATS = {
    np.dtype(np.uint8): OpenImageIO.UINT8,
    np.dtype(np.uint16): OpenImageIO.UINT16,
    np.dtype(np.float32): OpenImageIO.FLOAT,
}


def write_polarizer_sequence(sequence: PolarizerSequence, folder: Path) -> Path:
    """Write photographs as 32-bit float TIFF with a mask and ``capture.yaml``, which comes last.

    Parameters
    ----------
    sequence : PolarizerSequence
        The photographs; replaying the folder gives this very value, bit for bit.
    folder : Path
        Where to write; made where it is missing.

    Returns
    -------
    Path
        The ``capture.yaml``.

    Raises
    ------
    InputError
        The sequence states an angle twice, marks pixels valid that are no numbers, or holds what no photograph does.
    DeviceError
        A file cannot be written.
    """
    _check(sequence)
    count = len(sequence.images)
    names = _names("photo", count)
    lines = [
        "# Angles: anticlockwise from +x, y up, as seen in the displayed photograph.",
        f"# python -m pipeline +experiment=polarization_logo rig=replay rig.folder={folder.name}",
        f"kind: {KIND}",
    ]
    if sequence.wavelength_nm is not None:
        lines.append(f"wavelength_nm: {float(sequence.wavelength_nm)!r}")
    if sequence.pixel_mm is not None:
        lines.append(f"pixel_mm: {float(sequence.pixel_mm)!r}")
    lines.append("photos:")
    exposures = sequence.exposure_s or (None,) * count
    for name, angle, exposure in zip(names, sequence.polarizer_rad, exposures, strict=True):
        stated = "" if exposure is None else f", exposure_s: {float(exposure)!r}"
        lines.append(f"  - {{file: {name}, polarizer_deg: {degrees_of(float(angle))}{stated}}}")
    if not sequence.valid.all():
        lines.append(f"mask: {MASK_FILE}")
    text = "\n".join(lines) + "\n" + yaml.safe_dump({"metadata": dict(sequence.metadata)}, width=math.inf)
    images = dict(zip(names, sequence.images, strict=True))
    if not sequence.valid.all():
        images[MASK_FILE] = np.where(sequence.valid, np.uint8(255), np.uint8(0))
    return _write(folder, images, text)


def write_point_light(series: PictureSeries, folder: Path) -> Path:
    """Write pictures under a torch as 32-bit float TIFF with ``capture.yaml``, which comes last.

    Parameters
    ----------
    series : PictureSeries
        The pictures; ``capture.recorded_point_light`` gives their arrays again, bit for bit.
    folder : Path
        Where to write; made where it is missing.

    Returns
    -------
    Path
        The ``capture.yaml``.

    Raises
    ------
    InputError
        There is no picture, or one has pixels that are no numbers.
    DeviceError
        A file cannot be written.
    """
    if series.together:
        raise InputError("all lights are on in one picture", expected="a picture for each light")
    if series.rgb.dtype != np.float32 or series.rgb.ndim != 4 or not series.rgb.size or series.rgb.shape[3] != 3:
        raise InputError(
            f"pictures of shape {series.rgb.shape} and type {series.rgb.dtype}",
            expected="(lights, rows, columns, 3) of float32",
        )
    if not np.isfinite(series.rgb).all():
        raise InputError("pixels are NaN or infinite", expected="finite signal everywhere")
    names = _names("torch", len(series.rgb))
    lines = [
        "# Places in mm: x right, y up, z towards the camera, origin at the sample in the middle of the photo.",
        "# graph.torch.stage=capture.recorded_point_light graph.torch.folder=" + folder.name,
        f"kind: {POINT_LIGHT}",
        f"camera_mm: {[float(x) for x in series.camera_mm]}",
        *([] if series.pixel_mm is None else [f"pixel_mm: {float(series.pixel_mm)!r}"]),
        "photos:",
    ]
    lines += [
        f"  - {{file: {name}, light_mm: {[float(x) for x in light]}}}"
        for name, light in zip(names, series.light_mm, strict=True)
    ]
    return _write(folder, dict(zip(names, series.rgb, strict=True)), "\n".join(lines) + "\n")


def write_flash(brackets: FlashBrackets, folder: Path) -> Path:
    """Write brackets of exposures under a flash as PNG with ``capture.yaml``, which comes last.

    Parameters
    ----------
    brackets : FlashBrackets
        The photographs; a replay gives their arrays again, bit for bit.
    folder : Path
        Where to write; made where it is missing.

    Returns
    -------
    Path
        The ``capture.yaml``.

    Raises
    ------
    InputError
        There is no photograph.
    DeviceError
        A file cannot be written.
    """
    if brackets.images.ndim != 5 or not brackets.images.size:
        raise InputError(f"photographs of shape {brackets.images.shape}", expected="one of each light at least")
    entries = {
        f"light_{light + 1}_exposure_{index + 1}.png": (light + 1, float(time), brackets.images[light, index])
        for light in range(len(brackets.images))
        for index, time in enumerate(brackets.exposure_s)
    }
    known = {
        "camera_mm": brackets.camera_mm,
        "lights_mm": brackets.light_mm,
        "sheet_mm": brackets.sheet_mm,
        "corners_px": brackets.corners_px,
        "wavelength_nm": brackets.wavelength_nm,
        "bandwidth_nm": brackets.bandwidth_nm,
        "light_sigma_mm": brackets.light_sigma_mm,
    }
    lines = [
        "# Places in mm: x right, y up, z towards the camera, origin in the middle of the sheet.",
        f"# python -m pipeline +experiment=flash_polygons rig=flash_replay rig.folder={folder.name}",
        f"kind: {FLASH}",
        f"linear: {str(brackets.linear).lower()}",
    ]
    lines += [
        f"{name}: {np.asarray(value, np.float64).tolist()!r}"
        for name, value in known.items()
        if value is not None and np.isfinite(np.asarray(value, np.float64)).all()
    ]
    lines += ["photos:"]
    lines += [f"  - {{file: {name}, light: {k}, exposure_s: {time!r}}}" for name, (k, time, _) in entries.items()]
    images = {name: image for name, (_, _, image) in entries.items()}
    if brackets.room is not None:
        images["room.png"] = brackets.room
        lines.append("room: room.png")
    text = "\n".join(lines) + "\n" + yaml.safe_dump({"metadata": dict(brackets.metadata)}, width=math.inf)
    return _write(folder, images, text)


def _names(stem: str, count: int) -> list[str]:
    return [f"{stem}_{index:0{len(str(count))}d}.tif" for index in range(1, count + 1)]


def _write(folder: Path, images: Mapping[str, NDArray[Any]], capture: str) -> Path:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, image in images.items():
            _write_image(folder / name, image)
        path = folder / CAPTURE_FILE
        path.write_text(capture, encoding="utf-8")
    except OSError as error:
        raise DeviceError(f"{folder} cannot be written: {error.strerror}") from error
    return path


def _check(sequence: PolarizerSequence) -> None:
    angles = np.asarray(sequence.polarizer_rad)
    if sequence.images.dtype != np.float32 or sequence.images.ndim != 3 or not sequence.images.size:
        raise InputError(
            f"images of shape {sequence.images.shape} and type {sequence.images.dtype}",
            expected="(angles, rows, columns) of float32",
        )
    if angles.dtype != np.float64 or angles.shape != sequence.images.shape[:1] or not np.isfinite(angles).all():
        raise InputError(
            f"{angles.size} angles of type {angles.dtype}", expected="a finite float64 for each photograph"
        )
    if len(np.unique(angles)) != len(angles):
        raise InputError("an angle of the polariser stands twice", expected="one photograph an angle")
    if sequence.exposure_s is not None and not all(0 < e < math.inf for e in sequence.exposure_s):
        raise InputError(f"exposures of {sequence.exposure_s} s", expected="positive numbers")
    if sequence.valid.shape != sequence.images.shape[1:] or not sequence.valid.any():
        raise InputError("no valid pixel", expected="a mask of the photographs' size that leaves some")
    if not np.isfinite(sequence.images[:, sequence.valid]).all():
        raise InputError("valid pixels are NaN or infinite", expected="finite signal wherever it is valid")


def _write_image(path: Path, image: NDArray[Any]) -> None:
    rows, columns = image.shape[:2]
    channels = image.shape[2] if image.ndim == 3 else 1
    spec = OpenImageIO.ImageSpec(columns, rows, channels, _FORMATS[image.dtype])
    if image.dtype == np.float32:
        spec.attribute("compression", "zip")
        spec.attribute("tiff:zipquality", 1)
    target = OpenImageIO.ImageOutput.create(str(path))
    if target is None or not target.open(str(path), spec):
        raise DeviceError(
            f"{path} cannot be written: {OpenImageIO.geterror() if target is None else target.geterror()}"
        )
    # OpenImageIO reads beyond the end of arrays without a channel axis.
    written = target.write_image(np.ascontiguousarray(image).reshape(rows, columns, channels))
    complaint = target.geterror()
    if not target.close() or not written:
        raise DeviceError(f"{path} cannot be written: {complaint or target.geterror()}")
