"""Photographs of a recorded capture, corrected and at full resolution, one angle of the polariser at a time."""

from __future__ import annotations

import filecmp
import functools
import logging
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.data.photographs import SIMULTANEOUS, Photo
from pipeline.devices.capture_yaml import Capture, PhotoEntry
from pipeline.devices.photo_files import Channel, channel_of, read_photo
from pipeline.errors import InputError
from pipeline.optics.mosaic import REACH, Demosaic, demosaic, spread

FloatImage = NDArray[np.float32]
BoolImage = NDArray[np.bool_]

LEAST_FLAT = 0.01
"""Part of its mean below which a flat field tells nothing."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Frame:
    """A photograph at one angle: a file, or one of the four places in the block of a mosaic.

    Attributes
    ----------
    entry : PhotoEntry
        The file.
    place : int or None
        Place in the block, row by row; None for a photograph without a mosaic.
    angle_rad : float
        Angle of the polariser.
    """

    entry: PhotoEntry
    place: int | None
    angle_rad: float


@dataclass(frozen=True, eq=False)
class Corrections:
    """What is common to all photographs of a capture.

    Attributes
    ----------
    dark : ndarray of shape (M, N), float32, or None
        Mean of the dark frames.
    flat : ndarray of shape (M, N), float32, or None
        Mean of the flat fields less ``dark``, of unit mean; 1 where it is unusable.
    mask : ndarray of shape (M, N), bool, or None
        Inside the photographer's mask, with a finite dark frame and a flat field that is bright enough and unsaturated.
    """

    dark: FloatImage | None
    flat: FloatImage | None
    mask: BoolImage | None


class Recording:
    """The photographs of a capture, read when they are asked for.

    Parameters
    ----------
    capture : Capture
        Which files there are.
    channel : str
        What to take of colour photographs, see :func:`pipeline.devices.photo_files.channel_of`.
    wavelength_nm : float, optional
        Decides the channel where it is ``auto``.
    method : {"bilinear", "guided"}
        How a mosaic is brought to full resolution.
    """

    def __init__(
        self, capture: Capture, *, channel: Channel = "auto", wavelength_nm: float | None, method: Demosaic = "bilinear"
    ) -> None:
        self.capture = capture
        self._channel = channel
        self._wavelength_nm = wavelength_nm
        self._method = method
        self._planes: tuple[PhotoEntry, list[Photo]] | None = None

    @functools.cached_property
    def stated(self) -> tuple[Frame, ...]:
        """All frames in the order of the capture, without looking at the files."""
        frames = []
        for entry in self.capture.photos:
            if entry.mosaic_rad is not None:
                angles = [angle for row in entry.mosaic_rad for angle in row]
                frames += [Frame(entry, place, angle) for place, angle in enumerate(angles)]
            elif entry.polarizer_rad is not None:
                frames.append(Frame(entry, None, entry.polarizer_rad))
        return tuple(frames)

    @functools.cached_property
    def frames(self) -> tuple[Frame, ...]:
        """Frames to replay: those stated, repeats of the same photograph left out.

        Raises
        ------
        InputError
            An angle is stated twice for different photographs.
        """
        kept: dict[float, Frame] = {}
        for frame in self.stated:
            earlier = kept.setdefault(frame.angle_rad, frame)
            if earlier is frame:
                continue
            if earlier.place != frame.place or not self._same(earlier.entry.file, frame.entry.file):
                raise InputError(
                    f"{frame.entry.file.name} and {earlier.entry.file.name} differ, but both are stated at "
                    f"{np.rad2deg(frame.angle_rad):g} degrees",
                    where=frame.entry.where,
                    expected="one photograph an angle; average repeated exposures beforehand",
                )
            log.info("%s repeats %s and is left out", frame.entry.file.name, earlier.entry.file.name)
        return tuple(kept.values())

    @functools.cached_property
    def corrections(self) -> Corrections:
        """Mean dark frame, normalised flat field and mask."""
        dark = self._mean(self.capture.dark)
        flat = self._mean(self.capture.flat)
        good = None if self.capture.mask is None else read_mask(self.capture.mask)
        if dark is not None:
            good, dark = _and(good, np.isfinite(dark)), np.nan_to_num(dark)
        if flat is not None:
            if dark is not None:
                flat = flat - dark
            burnt = [self.raw(file).saturated for file in self.capture.flat]
            usable = np.isfinite(flat) & ~np.logical_or.reduce(burnt)
            if usable.any():
                usable &= flat > LEAST_FLAT * np.mean(flat, where=usable)
            if not usable.all():
                log.warning("%d pixels have no usable flat field and are left out", np.count_nonzero(~usable))
            level = np.mean(flat, where=usable) if usable.any() else np.float32(1)
            flat = np.where(usable, flat / level, np.float32(1))
            good = _and(good, usable)
        return Corrections(dark, flat, good)

    def raw(self, file: Path) -> Photo:
        """One file as one grey image, uncorrected."""
        photo = read_photo(file, linear=self.capture.linear, saturation=self.capture.saturation)
        return channel_of(photo, self._channel, wavelength_nm=self._wavelength_nm)

    def photo(self, frame: Frame) -> Photo:
        """One frame, corrected and at full resolution."""
        entry = frame.entry
        if frame.place is None:
            return self._corrected(entry)
        if self._planes is None or self._planes[0] is not entry:
            self._planes = entry, self._demosaiced(entry)
        return self._planes[1][frame.place]

    def _same(self, left: Path, right: Path) -> bool:
        if filecmp.cmp(left, right, shallow=False):
            return True
        return np.array_equal(self.raw(left).image, self.raw(right).image, equal_nan=True)

    def _mean(self, files: Sequence[Path]) -> FloatImage | None:
        if not files:
            return None
        total = np.sum([self.raw(file).image for file in files], axis=0, dtype=np.float64)
        return np.asarray(total / len(files), np.float32)

    def _corrected(self, entry: PhotoEntry) -> Photo:
        photo = self.raw(entry.file)
        image = photo.image
        if self.corrections.dark is not None:
            image = image - self.corrections.dark
        if self.corrections.flat is not None:
            image = image / self.corrections.flat
        exposure = photo.exposure_s if entry.exposure_s is None else entry.exposure_s
        metadata = photo.metadata if self.capture.metadata is None else self.capture.metadata
        return Photo(image, photo.saturated, exposure, dict(metadata))

    def _demosaiced(self, entry: PhotoEntry) -> list[Photo]:
        photo = self._corrected(entry)
        planes = demosaic(np.asarray(photo.image, np.float32), method=self._method)
        log.info("%s demosaiced to full resolution by %s interpolation", entry.file.name, self._method)
        saturated = spread(photo.saturated, REACH[self._method])
        metadata = {**photo.metadata, SIMULTANEOUS: "yes"}
        return [Photo(plane, saturated, photo.exposure_s, metadata) for plane in planes]


def read_mask(file: Path) -> BoolImage:
    """A photographer's mask: where the brightest channel is above half of full scale."""
    image = read_photo(file, linear=True).image
    return np.asarray((image if image.ndim == 2 else image.max(axis=-1)) > 0.5)


def _and(left: BoolImage | None, right: BoolImage) -> BoolImage:
    return right if left is None else left & right
