"""Photographs from files, as linear signal: anything that OpenImageIO reads, and camera raw through LibRaw."""

from __future__ import annotations

import functools
import re
from pathlib import Path
from typing import Any, Literal

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from pipeline.data.photographs import Photo
from pipeline.devices.file_extent import is_cut_short
from pipeline.devices.single_precision import shortest
from pipeline.errors import InputError, nearest
from pipeline.optics.colour import LUMINANCE

Channel = Literal["auto", "green", "red", "blue", "luminance"]
FloatImage = NDArray[np.float32]

RAW_SUFFIXES = frozenset(
    f".{ending}"
    for ending in (
        *("3fr", "arw", "cr2", "cr3", "crw", "dcr", "dng", "erf", "fff", "iiq", "k25", "kdc", "mef", "mos", "mrw"),
        *("nef", "nrw", "orf", "pef", "raf", "raw", "rw2", "rwl", "sr2", "srf", "srw", "x3f"),
    )
)
DISPLAY_SUFFIXES = frozenset({".jpg", ".jpeg", ".jpe", ".jif", ".jfif", ".jfi", ".webp", ".gif", ".heic", ".heif"})
"""Endings of files that hold pictures made for a display, encoded as sRGB."""

_CAMERA = {
    "make": ("Make",),
    "model": ("Model",),
    "lens": ("Exif:LensModel",),
    "iso": ("Exif:PhotographicSensitivity", "Exif:ISOSpeedRatings"),
    "aperture": ("FNumber", "Exif:FNumber"),
    "focal_length_mm": ("Exif:FocalLength",),
    "taken": ("Exif:DateTimeOriginal",),
}


def read_photo(path: Path, *, linear: bool | None = None, saturation: float | None = None) -> Photo:
    """Read one photograph as linear signal.

    Integers are scaled so that full scale is 1. Camera raw comes with black subtracted, white level 1, all white
    balance gains 1 and in the camera's own colours, so that nothing but the sensor's signal is in it. An orientation
    tag is obeyed: the image stands as it is displayed. Transparency is dropped.

    Parameters
    ----------
    path : Path
        The file.
    linear : bool, optional
        Whether values are proportional to light. By default JPEG, WebP, GIF and HEIF are taken to be encoded as sRGB
        and decoded; TIFF, PNG, EXR, 16-bit JPEG XL and others are taken as linear, whatever colour space their tags
        name, for cameras on a bench write them so. Camera raw always is linear.
    saturation : float, optional
        Value at which the sensor was full in a file of floating-point numbers, which does not say; it becomes 1.

    Returns
    -------
    Photo
        ``image`` of shape (M, N) or (M, N, 3), NaN kept; ``saturated`` where any channel is at or above full scale,
        nowhere in a file of floating-point numbers without ``saturation``.

    Raises
    ------
    InputError
        The file is missing, unreadable, truncated, or has neither one nor three channels.
    """
    if not path.is_file():
        siblings = (p.name for p in path.parent.iterdir()) if path.parent.is_dir() else ()
        raise InputError(f"there is no photo {path.name}", where=str(path), hint=nearest(path.name, siblings))
    is_raw = path.suffix.lower() in RAW_SUFFIXES
    try:
        if is_cut_short(path, tags=not is_raw or path.suffix.lower() == ".dng"):
            raise InputError("the photo is truncated: the file ends before its pixels or tags do", where=str(path))
    except OSError as error:
        raise InputError(f"the photo cannot be read: {error.strerror}", where=str(path)) from None
    return _read_raw(path) if is_raw else _read_plain(path, linear, saturation)


def readable_suffixes() -> frozenset[str]:
    """File name endings that may be photographs, with their dots, in lower case."""
    formats = (
        entry.split(":")[1].split(",") for entry in str(OpenImageIO.get_string_attribute("extension_list")).split(";")
    )
    return RAW_SUFFIXES | {f".{ending}" for endings in formats for ending in endings}


def channel_of(photo: Photo, channel: Channel = "auto", *, wavelength_nm: float | None = None) -> Photo:
    """The photograph as one grey image.

    Parameters
    ----------
    photo : Photo
        Grey photographs are given back as they are.
    channel : str
        ``auto`` is the channel in which ``wavelength_nm`` falls, green where it is not known. ``luminance`` weighs the
        channels by Rec. 709, still proportional to light.
    wavelength_nm : float, optional
        Centre of the spectral filter.

    Returns
    -------
    Photo
        With ``image`` of shape (M, N); ``saturated`` where a channel that was used is at or above full scale.
    """
    if photo.image.ndim == 2:
        return photo
    if channel == "luminance":
        image = photo.image @ np.asarray(LUMINANCE, np.float32)
        return Photo(image, photo.saturated, photo.exposure_s, photo.metadata)
    name = _nearest_channel(wavelength_nm) if channel == "auto" else channel
    image = np.ascontiguousarray(photo.image[..., ("red", "green", "blue").index(name)])
    return Photo(image, photo.saturated & (image >= 1), photo.exposure_s, photo.metadata)


def _nearest_channel(wavelength_nm: float | None) -> str:
    if wavelength_nm is None:
        return "green"
    return "blue" if wavelength_nm < 490 else "green" if wavelength_nm < 580 else "red"


def _read_plain(path: Path, linear: bool | None, saturation: float | None) -> Photo:
    hints = OpenImageIO.ImageSpec()
    hints.attribute("oiio:UnassociatedAlpha", 1)
    source = OpenImageIO.ImageInput.open(str(path), hints)
    if source is None:
        raise InputError(f"the photo cannot be read: {_reason(OpenImageIO.geterror(), path)}", where=str(path))
    try:
        spec = source.spec()
        pixels = source.read_image(0, 0, 0, spec.nchannels, OpenImageIO.UNKNOWN)
        complaint = source.geterror()
    finally:
        source.close()
    if pixels is None or complaint:
        raise InputError(f"the photo is truncated or damaged: {_reason(complaint, path)}", where=str(path))
    if spec.alpha_channel >= 0:  # of a GIF it is one too large
        pixels = np.delete(pixels, min(spec.alpha_channel, pixels.shape[-1] - 1), axis=-1)
    if pixels.shape[-1] not in (1, 3):
        names = ", ".join(spec.channelnames)
        raise InputError(f"the photo has the channels {names}", where=str(path), expected="grey or red, green, blue")
    pixels = _upright(pixels, spec.get_int_attribute("Orientation", 1))
    if linear is None:
        linear = path.suffix.lower() not in DISPLAY_SUFFIXES
    image, saturated = _to_linear(pixels[..., 0] if pixels.shape[-1] == 1 else pixels, linear, saturation)
    exposure = spec.get_float_attribute("ExposureTime", spec.get_float_attribute("Exif:ExposureTime", 0.0))
    return Photo(image, saturated, shortest(exposure) if exposure > 0 else None, _metadata(spec))


def _to_linear(pixels: NDArray[Any], linear: bool, saturation: float | None) -> tuple[FloatImage, NDArray[np.bool_]]:
    """Linear image with full scale 1, and where it is at full scale."""
    if pixels.dtype.kind == "f":
        image = np.ascontiguousarray(pixels, np.float32)
        if saturation is not None:
            image = image / np.float32(saturation)
        if not linear:
            image = _decode_srgb(image)
        full = image >= 1 if saturation is not None else np.zeros(image.shape, bool)
    else:
        scale = np.iinfo(pixels.dtype).max
        full = pixels == scale
        if saturation is not None:
            level = saturation * scale if saturation <= 1 else saturation
            full |= pixels >= level
            image = np.divide(pixels, np.float32(level), dtype=np.float32)
            image = image if linear else _decode_srgb(image)
        elif linear:
            image = np.divide(pixels, np.float32(scale), dtype=np.float32)
        else:
            image = (
                _srgb_table(pixels.dtype.str)[pixels]
                if pixels.dtype.itemsize <= 2
                else _decode_srgb(np.divide(pixels, np.float32(scale), dtype=np.float32))
            )
    return image, np.asarray(full if full.ndim == 2 else full.any(axis=-1))


@functools.cache
def _srgb_table(kind: str) -> FloatImage:
    scale = np.iinfo(kind).max
    return _decode_srgb(np.arange(scale + 1) / scale)


def _decode_srgb(encoded: NDArray[Any]) -> FloatImage:
    """IEC 61966-2-1, extended above 1 and, by symmetry, below 0."""
    size = np.abs(encoded)
    light = np.where(size <= 0.04045, size / 12.92, ((size + 0.055) / 1.055) ** 2.4)
    return np.copysign(light, encoded).astype(np.float32)


def _upright(pixels: NDArray[Any], orientation: int) -> NDArray[Any]:
    """Turn and flip as the Exif orientation (1 to 8) asks, so that rows run as displayed."""
    if orientation >= 5:
        pixels = np.swapaxes(pixels, 0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(pixels)


def _metadata(spec: Any) -> dict[str, str]:
    found = {}
    for name, tags in _CAMERA.items():
        value = next((v for v in map(spec.getattribute, tags) if v not in (None, "")), None)
        if value is not None:
            found[name] = f"{value:g}" if isinstance(value, float) else str(value).strip()
    return found


def _read_raw(path: Path) -> Photo:
    import rawpy

    try:
        with rawpy.imread(str(path)) as raw:
            pixels = raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                adjust_maximum_thr=0.0,
                user_wb=[1, 1, 1, 1],
                output_color=rawpy.ColorSpace.raw,
                output_bps=16,
                highlight_mode=rawpy.HighlightMode.Clip,
            )
            other, lens = getattr(raw, "other", None), getattr(raw, "lens", None)
    except rawpy.LibRawError as error:
        reason = _reason(error.args[0] if error.args else "", path)
        raise InputError(f"the camera raw file is truncated or cannot be read: {reason}", where=str(path)) from error
    image, saturated = _to_linear(pixels[..., 0] if pixels.shape[-1] == 1 else pixels, True, None)
    stated = {
        **_tags_of_raw(path),
        "lens": getattr(lens, "model", ""),
        "iso": f"{getattr(other, 'iso_speed', 0):g}",
        "aperture": f"{getattr(other, 'aperture', 0):g}",
    }
    exposure = getattr(other, "shutter_speed", 0.0)
    known = {name: value for name, value in stated.items() if value not in ("", "0")}
    return Photo(image, saturated, shortest(exposure) if exposure > 0 else None, known)


def _tags_of_raw(path: Path) -> dict[str, str]:
    """Maker and model, which LibRaw's wrapper keeps to itself but most camera raw formats carry as TIFF tags."""
    source = OpenImageIO.ImageInput.open(str(path))
    if source is None:
        OpenImageIO.geterror()
        return {}
    try:
        return _metadata(source.spec())
    finally:
        source.close()


def _reason(complaint: object, path: Path) -> str:
    text = complaint.decode(errors="replace") if isinstance(complaint, bytes) else str(complaint)
    lines = [line.strip() for line in re.sub(re.escape(str(path)), path.name, text).splitlines() if line.strip()]
    return lines[0] if lines else "it is none of the formats that OpenImageIO and LibRaw read"
