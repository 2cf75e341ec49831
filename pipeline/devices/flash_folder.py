"""Photographs of a sheet under a flash, from a folder of files, replayed as if it were a rig."""

from __future__ import annotations

import functools
import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.capture_yaml import CAPTURE_FILE
from pipeline.devices.flash_yaml import KIND, FlashCapture, read_flash_yaml
from pipeline.devices.photo_files import DISPLAY_SUFFIXES, RAW_SUFFIXES, read_photo
from pipeline.errors import InputError, InputErrors, nearest

_DARKER = 0.9
"""A longer exposure that is less bright than so much of a shorter one is not what it is stated to be."""


class FlashFolder:
    """A folder of photographs under a flash, replayed as if it were a rig.

    Parameters
    ----------
    folder : Path
        Photographs, and a ``capture.yaml`` of kind ``flash``, see :mod:`pipeline.devices.flash_yaml`.
    """

    def __init__(self, *, folder: Path) -> None:
        self._folder = Path(folder)
        self._index: int | None = None

    @property
    def camera(self) -> Self:
        """The camera; it is this folder."""
        return self

    @property
    def light(self) -> Self:
        """The flash; it is this folder."""
        return self

    @property
    def exposure_s(self) -> Sequence[float]:
        """Times of exposure that each place of the flash has."""
        return tuple(sorted(time for light, time in self._files if light == 1))

    @property
    def bits(self) -> int:
        """8 where all files have so many, else 16."""
        return self._bits

    @property
    def linear(self) -> bool:
        """Whether values are proportional to light."""
        return self._bits > 8 if self._capture.linear is None else self._capture.linear

    @property
    def has_room(self) -> bool:
        """Whether there is a photograph under room light."""
        return self._capture.room is not None

    @property
    def light_mm(self) -> NDArray[np.float64]:
        """Places of the flash, shape (L, 3); NaN where not known."""
        count = max(photo.light for photo in self._capture.photos)
        stated = self._capture.lights_mm
        return np.full((count, 3), np.nan) if stated is None else np.asarray(stated, np.float64)

    @property
    def camera_mm(self) -> NDArray[np.float64]:
        """Place of the camera; NaN where not known."""
        stated = self._capture.camera_mm
        return np.full(3, np.nan) if stated is None else np.asarray(stated, np.float64)

    @property
    def sheet_mm(self) -> tuple[float, float] | None:
        """Width and height of the sheet."""
        size = self._capture.sheet_mm
        return None if size is None else (size[0], size[1])

    @property
    def corners_px(self) -> NDArray[np.float64] | None:
        """Where its corners are seen."""
        corners = self._capture.corners_px
        return None if corners is None else np.asarray(corners, np.float64)

    @property
    def wavelength_nm(self) -> float | None:
        """Centre of the filter before the camera."""
        return self._capture.wavelength_nm

    @property
    def bandwidth_nm(self) -> float | None:
        """Its full width at half maximum."""
        return self._capture.bandwidth_nm

    @property
    def light_sigma_mm(self) -> float | None:
        """Standard deviation of the flash's extent."""
        return self._capture.light_sigma_mm

    def place(self, sample: GratingSample | None) -> None:
        """Refuse a virtual sample: what lay before the camera is decided.

        Raises
        ------
        InputError
            There is a sample.
        """
        if sample is not None:
            raise InputError(
                f"'{sample.name}' cannot be placed before a replay",
                where=str(self._folder),
                expected="no sample: `when: ${rig.simulated}` leaves its node out",
            )

    def check(self) -> None:
        """Decode all files and find everything that would make the replay fail.

        Raises
        ------
        InputError, InputErrors
            What is wrong, in which file or line, and what was expected.
        """
        problems, sizes, brightness = [], {}, {}
        for file in self._every_file:
            try:
                image = _read(file).image
            except InputError as error:
                problems.append(error.at(str(self._capture.source)))
                continue
            sizes[file] = image.shape[:2]
            brightness[file] = float(image.mean())
            if not np.isfinite(image).all():
                problems.append(InputError("pixels are NaN or infinite", where=str(file), expected="finite signal"))
        usual = next(iter(sizes.values()), None)
        for file, size in sizes.items():
            if size != usual and usual is not None:
                problems.append(
                    InputError(
                        f"a photo of {size[1]} x {size[0]} pixels",
                        where=str(file),
                        expected=f"{usual[1]} x {usual[0]} pixels, as {next(iter(sizes)).name} has",
                    )
                )
        if problems:
            raise InputErrors(problems)
        self._refuse_unequal_brackets()
        self._refuse_darker(brightness)

    def put(self, index: int | None) -> None:
        """Choose a place of the flash, or the room's light."""
        self._index = index

    def expose_for(self, exposure_s: float | None) -> Photo:
        """The photograph that was taken so."""
        room = self._capture.room
        if self._index is None or exposure_s is None:
            if room is None:
                raise InputError("there is no photograph under room light", where=str(self._capture.source))
            return self._told(_read(room), None)
        return self._told(_read(self._files[self._index + 1, exposure_s]), exposure_s)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Nothing is open."""

    def _told(self, photo: Photo, exposure_s: float | None) -> Photo:
        return Photo(photo.image, photo.saturated, exposure_s, {**photo.metadata, **self._capture.metadata})

    def _refuse_unequal_brackets(self) -> None:
        brackets: dict[int, list[float]] = {}
        for light, time in self._files:
            brackets.setdefault(light, []).append(time)
        for light, times in brackets.items():
            if sorted(times) != sorted(brackets.get(1, [])):
                raise InputError(
                    f"light {light} has exposures of {sorted(times)} s",
                    where=str(self._capture.source),
                    expected=f"{sorted(brackets.get(1, []))} s, as light 1 has",
                )

    def _refuse_darker(self, brightness: Mapping[Path, float]) -> None:
        problems = []
        for light in range(1, len(self.light_mm) + 1):
            for shorter, longer in itertools.pairwise(self.exposure_s):
                dim, bright = self._files[light, shorter], self._files[light, longer]
                if brightness[bright] < _DARKER * brightness[dim]:
                    problems.append(
                        InputError(
                            f"{bright.name} of {longer:g} s is darker than {dim.name} of {shorter:g} s",
                            where=str(self._capture.source),
                            expected="longer exposures that are brighter, ISO and aperture being the same",
                            hint="exposure_s is in seconds: 0.002 is 1/500 s",
                        )
                    )
                    break
        if problems:
            raise InputErrors(problems)

    @property
    def _every_file(self) -> list[Path]:
        room = self._capture.room
        return [photo.file for photo in self._capture.photos] + ([] if room is None else [room])

    @functools.cached_property
    def _files(self) -> dict[tuple[int, float], Path]:
        """File of each place and exposure."""
        found: dict[tuple[int, float], Path] = {}
        for photo in self._capture.photos:
            time = photo.exposure_s or _read(photo.file).exposure_s
            if time is None:
                raise InputError(
                    f"the exposure of {photo.file.name} is not known",
                    where=str(self._capture.source),
                    expected="exposure_s, or a file that states it",
                )
            if (photo.light, time) in found:
                raise InputError(
                    f"light {photo.light} has two photos of {time:g} s", where=str(self._capture.source), expected="one"
                )
            found[photo.light, time] = photo.file
        return found

    @functools.cached_property
    def _bits(self) -> int:
        return 8 if all(_has_8_bits(file) for file in self._every_file) else 16

    @functools.cached_property
    def _capture(self) -> FlashCapture:
        folder = self._folder
        path = folder / CAPTURE_FILE
        if not path.is_file():
            siblings = (p.name for p in folder.parent.iterdir() if p.is_dir()) if folder.parent.is_dir() else ()
            raise InputError(
                f"the folder has no {CAPTURE_FILE}" if folder.is_dir() else "the folder does not exist",
                where=str(folder),
                expected=f"photographs and a {CAPTURE_FILE} of kind {KIND}",
                hint="" if folder.is_dir() else nearest(folder.name, siblings),
            )
        return read_flash_yaml(path)


def _read(file: Path) -> Photo:
    """A photograph as the camera stored it."""
    return read_photo(file, linear=True)


def _has_8_bits(file: Path) -> bool:
    suffix = file.suffix.lower()
    if suffix in RAW_SUFFIXES:
        return False
    if suffix in DISPLAY_SUFFIXES:
        return True
    source = OpenImageIO.ImageInput.open(str(file))
    if source is None:
        OpenImageIO.geterror()
        return False
    try:
        return str(source.spec().format) == "uint8"
    finally:
        source.close()
