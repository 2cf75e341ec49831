"""A rig that gives back photographs taken elsewhere, from a folder of files."""

from __future__ import annotations

import functools
import logging
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.angle_names import capture_from_names
from pipeline.devices.capture_yaml import CAPTURE_FILE, Capture, read_capture_yaml
from pipeline.devices.photo_files import DISPLAY_SUFFIXES, readable_suffixes
from pipeline.devices.recording import Recording
from pipeline.devices.recording_check import check_recording
from pipeline.errors import DeviceError, InputError, nearest
from pipeline.limits import above_zero, refuse, within

_TOLERANCE_RAD = 1e-9

log = logging.getLogger(__name__)


class PhotoFolder:
    """A folder of photographs through a polariser, replayed as if it were a rig.

    The folder holds ``capture.yaml``, see :mod:`pipeline.devices.capture_yaml`, or photographs whose names carry their
    angles, see :mod:`pipeline.devices.angle_names`. The raw frame of a polarisation camera counts as four photographs.

    Parameters
    ----------
    folder : Path
        Where the photographs are.
    channel : {"auto", "green", "red", "blue", "luminance"}
        What to take of colour photographs; ``auto`` is the channel in which the wavelength falls, green where none is
        stated.
    saturation_warning : float
        Share of saturated pixels in a photograph from which on it is reported; saturated pixels are always left out.
    wavelength_nm, pixel_mm : float, optional
        Centre of the spectral filter and pixel pitch on the sample, instead of what ``capture.yaml`` says.
    demosaic : {"bilinear", "guided"}
        How frames of a polarisation camera are brought to full resolution, see :func:`pipeline.optics.mosaic.demosaic`.

    Notes
    -----
    Photographs are linear when handed out: dark frames are averaged and subtracted, flat fields divided out (of unit
    mean), both before a mosaic is interpolated. Stated angles that differ by 180 degrees are two measurements; a
    photograph repeated at the same stated angle is dropped where it is the same and an error where it is not.
    """

    def __init__(
        self,
        *,
        folder: Path,
        channel: Literal["auto", "green", "red", "blue", "luminance"] = "auto",
        saturation_warning: float = 0.001,
        wavelength_nm: float | None = None,
        pixel_mm: float | None = None,
        demosaic: Literal["bilinear", "guided"] = "bilinear",
    ) -> None:
        self._folder = Path(folder)
        self._channel = channel
        self.saturation_warning = saturation_warning
        self._demosaic = demosaic
        self._wavelength_nm = wavelength_nm
        self._pixel_mm = pixel_mm
        self._position = 0
        self._saturated: dict[str, float] = {}
        self.light = RecordedLight()

    @property
    def camera(self) -> Self:
        """The camera; it is this folder."""
        return self

    @property
    def mount(self) -> Self:
        """The polariser's mount; it is this folder."""
        return self

    @functools.cached_property
    def recording(self) -> Recording:
        """The photographs.

        Raises
        ------
        InputError, InputErrors
            The folder is missing, or does not say which photographs were taken at which angle.
        """
        return Recording(
            self._capture,
            channel=self._channel,
            wavelength_nm=self.wavelength_nm,
            method=self._demosaic,
        )

    @property
    def wavelength_nm(self) -> float | None:
        """Centre of the spectral filter."""
        return self._capture.wavelength_nm if self._wavelength_nm is None else self._wavelength_nm

    @property
    def pixel_mm(self) -> float | None:
        """Pixel pitch on the sample."""
        return self._capture.pixel_mm if self._pixel_mm is None else self._pixel_mm

    @property
    def mask(self) -> NDArray[np.bool_] | None:
        """Pixels inside the photographer's mask that dark frames and flat fields leave usable; None where all are."""
        return self.recording.corrections.mask

    @property
    def stops_rad(self) -> Sequence[float]:
        """The angles of the photographs, in the order of the capture."""
        return tuple(frame.angle_rad for frame in self.recording.frames)

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
            What is wrong, in which file or setting, and what was expected.
        """
        refuse(
            above_zero(wavelength_nm=self._wavelength_nm, pixel_mm=self._pixel_mm),
            within(0, 1, saturation_warning=self.saturation_warning),
        )
        check_recording(self.recording)

    def move_to(self, angle_rad: float) -> float:
        """Choose the photograph taken at an angle.

        Raises
        ------
        DeviceError
            No photograph was taken there.
        """
        stops = np.asarray(self.stops_rad)
        self._position = int(np.argmin(np.abs(stops - angle_rad)))
        reached = float(stops[self._position])
        if abs(reached - angle_rad) > _TOLERANCE_RAD:
            raise DeviceError(
                f"{self._folder} holds no photograph at {np.rad2deg(angle_rad):g} degrees; "
                f"the nearest is at {np.rad2deg(reached):g}"
            )
        return reached

    def expose(self) -> Photo:
        """The photograph at the angle where the mount stands, linear and corrected."""
        frame = self.recording.frames[self._position]
        photo = self.recording.photo(frame)
        self._saturated[frame.entry.file.name] = float(photo.saturated.mean())
        return photo

    def __enter__(self) -> Self:
        capture = self._capture
        if capture.source.is_dir():
            angles = ", ".join(f"{e.file.name} {np.rad2deg(e.polarizer_rad or 0):g}" for e in capture.photos)
            log.info("angles in degrees, read from the names of the files: %s", angles)
        encoded = [e.file.name for e in capture.photos if e.file.suffix.lower() in DISPLAY_SUFFIXES]
        if encoded and capture.linear is None:
            log.warning(
                "%s and %d more decoded as sRGB; a camera's own tone curve differs, so prefer raw or TIFF files",
                encoded[0],
                len(encoded) - 1,
            )
        self._saturated = {}
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        above = {name: share for name, share in self._saturated.items() if share > self.saturation_warning}
        if above:
            shares = ", ".join(f"{name} {100 * share:.2g} %" for name, share in above.items())
            log.warning("saturated pixels, which are left out: %s", shares)

    @functools.cached_property
    def _capture(self) -> Capture:
        folder = self._folder
        if not folder.is_dir():
            what = "is a file" if folder.exists() else "does not exist"
            siblings = (p.name for p in folder.parent.iterdir() if p.is_dir()) if folder.parent.is_dir() else ()
            raise InputError(
                f"the folder of photographs {what}",
                where=str(folder),
                expected="a folder",
                hint=nearest(folder.name, siblings),
            )
        stated = folder / CAPTURE_FILE
        return read_capture_yaml(stated) if stated.is_file() else capture_from_names(folder, readable_suffixes())


class RecordedLight:
    """The light of a capture that is over: on in every photograph."""

    def switch(self, on: bool) -> None:
        """Do nothing: the photographs are taken."""
