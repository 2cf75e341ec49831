"""Everything that would make a recorded capture fail, found before it is replayed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.capture_yaml import CAPTURE_FILE
from pipeline.devices.photo_files import read_photo
from pipeline.devices.recording import Recording, read_mask
from pipeline.errors import InputError, InputErrors
from pipeline.parallel import over_rows

LEAST_ANGLES = 3

BoolImage = NDArray[np.bool_]


@dataclass(frozen=True)
class _File:
    """A file to look at: what it is to the capture, and where the capture names it."""

    path: Path
    role: str
    where: str
    is_mosaic: bool = False


def check_recording(recording: Recording) -> None:
    """Decode every file of a recording and look for all that is wrong with it.

    Raises
    ------
    InputErrors
        Missing, unreadable, truncated or NaN photographs; photographs, masks, dark frames or flat fields of different
        sizes; an angle stated for different photographs; fewer than three angles.
    """
    files = list(_files(recording))
    problems: list[InputError] = []
    mask = _mask(recording, problems)
    sizes = _sizes(recording, files, mask, problems)
    problems += _different_sizes(sizes, mask, recording.capture.mask)
    problems += _too_few_angles(recording)
    if not problems:
        problems += _at_last(recording)
    if problems:
        raise InputErrors(problems)


def _at_last(recording: Recording) -> Iterator[InputError]:
    """What can be asked only of files that are all readable and of one size."""
    try:
        _ = recording.frames
    except InputError as error:
        yield error
    usable = recording.corrections.mask
    if usable is not None and not usable.any():
        yield InputError(
            "mask, dark frames and flat fields together leave no pixel", where=str(recording.capture.source)
        )


def _files(recording: Recording) -> Iterator[_File]:
    capture = recording.capture
    for entry in capture.photos:
        yield _File(entry.file, "photo", entry.where, entry.mosaic_rad is not None)
    for role, paths in (("dark frame", capture.dark), ("flat field", capture.flat)):
        for path in paths:
            yield _File(path, role, str(capture.source))


def _mask(recording: Recording, problems: list[InputError]) -> BoolImage | None:
    path = recording.capture.mask
    if path is None:
        return None
    try:
        mask = read_mask(path)
    except InputError as error:
        problems.append(error.at(str(recording.capture.source)))
        return None
    if not mask.any():
        problems.append(InputError("the mask leaves no pixel", where=str(path), expected="white where pixels are used"))
    return mask


def _sizes(
    recording: Recording, files: list[_File], mask: BoolImage | None, problems: list[InputError]
) -> dict[_File, tuple[int, ...]]:
    """Size of every readable file; what is wrong with its content goes to ``problems``, in the order of the files."""
    sizes: dict[int, tuple[int, ...]] = {}
    found: dict[int, InputError] = {}

    def look(start: int, stop: int) -> None:
        for index in range(start, stop):
            file = files[index]
            try:
                sizes[index] = _look_at(recording, file, mask)
            except InputError as error:
                found[index] = error if file.where in error.where else error.at(file.where)

    over_rows(look, len(files), tile=1)
    problems += [found[index] for index in sorted(found)]
    return {files[index]: sizes[index] for index in sorted(sizes)}


def _look_at(recording: Recording, file: _File, mask: BoolImage | None) -> tuple[int, ...]:
    if file.is_mosaic and read_photo(file.path, linear=True).image.ndim == 3:
        raise InputError(
            "a mosaic in colour", where=str(file.path), expected="the raw frame, grey as the sensor gave it"
        )
    image = recording.raw(file.path).image
    if file.role == "photo":
        good = np.isfinite(image)
        if mask is not None and mask.shape == image.shape:
            good |= ~mask
        if not good.all():
            count = np.count_nonzero(~good)
            raise InputError(
                f"{count} of {image.size} pixels are NaN or infinite",
                where=str(file.path),
                expected="finite signal wherever the mask has pixels used",
                hint=f"mask: in {CAPTURE_FILE} names a picture that is black where pixels are to be left out",
            )
    return image.shape


def _different_sizes(
    sizes: dict[_File, tuple[int, ...]], mask: BoolImage | None, mask_file: Path | None
) -> Iterator[InputError]:
    photos = Counter(size for file, size in sizes.items() if file.role == "photo")
    if not photos:
        return
    usual = photos.most_common(1)[0][0]
    expected = f"{_wide(usual)}, as most photos have"
    for file, size in sizes.items():
        if size != usual:
            yield InputError(f"a {file.role} of {_wide(size)}", where=str(file.path), expected=expected)
    if mask is not None and mask.shape != usual:
        yield InputError(f"a mask of {_wide(mask.shape)}", where=str(mask_file), expected=expected)


def _wide(size: tuple[int, ...]) -> str:
    return f"{size[1]} x {size[0]} pixels"


def _too_few_angles(recording: Recording) -> Iterator[InputError]:
    angles = [frame.angle_rad for frame in recording.stated]
    distinct = len(np.unique(np.round(np.exp(2j * np.asarray(angles, np.float64)), 9)))
    if distinct < LEAST_ANGLES:
        yield InputError(
            f"{len(angles)} photographs at {distinct} distinct angles of the polariser",
            where=str(recording.capture.source),
            expected=f"at least {LEAST_ANGLES} angles that differ modulo 180 degrees",
        )
