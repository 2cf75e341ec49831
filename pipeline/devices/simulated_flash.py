"""A simulated bench on which a phone's flash is put around a holographic sheet."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo
from pipeline.devices.flash_scene import FlashScene, lamps
from pipeline.devices.sheet_views import WIDEST_VIEW_DEG, blind_camera, camera_view, unusable_counts
from pipeline.devices.simulated import LARGEST_WELL
from pipeline.devices.virtual_light import Image, Lighting, check_lighting
from pipeline.devices.virtual_sheet import MOST_SAMPLES, Sheet
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, found_by, refuse, within, zero_or_more
from pipeline.optics.charuco import Board
from pipeline.optics.colour import encode_srgb
from pipeline.optics.imaging import seen_by_lens, sensor_signal

Float64Array = NDArray[np.float64]

_FULLEST = 0.8
"""Of full scale, to which the room's light is exposed."""
_RAW_BITS = 14


class FlashCamera:
    """A digital camera on a stand, its sensor not quite parallel to the sheet.

    Parameters
    ----------
    camera_mm, target_mm, up : [x, y, z]
        Where it is, what lies in the middle of its picture, and what points up in it.
    field_of_view_deg : float, optional
        Across the picture's width; by default as wide as shows the whole sheet.
    size_px : [columns, rows]
        Of the picture.
    exposure_s : list of float
        Times of a bracket, shortest first. The one in the middle brings bright gratings to full scale.
    raw : bool
        True for 14 bits proportional to light; false for 8 bits behind a response curve.
    contrast : float
        Of the response curve: 0 for that of sRGB, 1 for a steep one that blends into both ends.
    full_well_electrons, read_noise_electrons : float
        Of the sensor.
    blur_px : float
        Standard deviation of the lens' point spread function.
    samples : int
        Points along each side of a pixel at which the sheet is rendered.
    wavelength_nm, bandwidth_nm : float, optional
        Centre and full width at half maximum of a filter before the lens.
    seed : int
        Of the noise.
    """

    def __init__(
        self,
        *,
        camera_mm: list[float] = [12.0, -18.0, 500.0],  # noqa: B006 - read from the syntax tree, never modified
        target_mm: list[float] = [1.0, 2.0, 0.0],  # noqa: B006
        up: list[float] = [0.02, 1.0, 0.0],  # noqa: B006
        field_of_view_deg: float | None = None,
        size_px: list[int] = [1200, 800],  # noqa: B006
        exposure_s: list[float] = [0.0005, 0.002, 0.008, 0.032, 0.128],  # noqa: B006
        raw: bool = False,
        contrast: float = 0.3,
        full_well_electrons: float = 40000.0,
        read_noise_electrons: float = 5.0,
        blur_px: float = 0.5,
        samples: int = 2,
        wavelength_nm: float | None = None,
        bandwidth_nm: float | None = None,
        seed: int = 0,
    ) -> None:
        self.camera_mm = camera_mm
        self.target_mm = target_mm
        self.up = up
        self.field_of_view_deg = field_of_view_deg
        self.size_px = size_px
        self.exposure_s = exposure_s
        self.raw = raw
        self.contrast = contrast
        self.full_well_electrons = full_well_electrons
        self.read_noise_electrons = read_noise_electrons
        self.blur_px = blur_px
        self.samples = samples
        self.wavelength_nm = wavelength_nm
        self.bandwidth_nm = bandwidth_nm
        self.seed = seed

    def check(self) -> None:
        """Refuse settings that no camera can have.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        problems = list(blind_camera(self.camera_mm, self.target_mm, self.up))
        if (self.wavelength_nm is None) != (self.bandwidth_nm is None):
            problems.append(
                InputError(
                    "a filter has both a centre and a width", where="wavelength_nm, bandwidth_nm", expected="both"
                )
            )
        refuse(
            problems,
            above_zero_up_to(WIDEST_VIEW_DEG, field_of_view_deg=self.field_of_view_deg),
            unusable_counts("size_px", self.size_px, "[columns, rows] in pixels, whole numbers from 1"),
            unordered_exposures(self.exposure_s),
            within(0, 1, contrast=self.contrast),
            above_zero_up_to(LARGEST_WELL, full_well_electrons=self.full_well_electrons),
            zero_or_more(read_noise_electrons=self.read_noise_electrons, blur_px=self.blur_px, seed=self.seed),
            within(1, MOST_SAMPLES, samples=self.samples),
            within(380, 780, wavelength_nm=self.wavelength_nm),
            within(0.1, 200, bandwidth_nm=self.bandwidth_nm),
        )

    def photograph(self, radiance: Image, exposure_s: float | None, number: int) -> Photo:
        """What the camera stores of light for which the middle exposure makes 1 full scale, or of room light."""
        usual = self.exposure_s[len(self.exposure_s) // 2]
        gain = exposure_s / usual if exposure_s is not None else _FULLEST / float(np.percentile(radiance, 99.9))
        signal, full = sensor_signal(
            seen_by_lens(radiance, blur_px=self.blur_px) * np.float32(gain),
            full_well_electrons=self.full_well_electrons,
            read_noise_electrons=self.read_noise_electrons,
            shot_noise=True,
            bits=_RAW_BITS,
            rng=np.random.default_rng([self.seed, number]),
        )
        stored = signal if self.raw else np.rint(255 * self._encoded(signal)) / np.float32(255)
        return Photo(stored, np.asarray(full.any(axis=-1)), exposure_s, {"model": "simulated camera"})

    def _encoded(self, signal: Image) -> Image:
        """sRGB, blended with a curve that is level at both ends, as film's is."""
        level = encode_srgb(signal)
        return np.asarray((1 - self.contrast) * level + self.contrast * level**2 * (3 - 2 * level), np.float32)


class PhoneFlash:
    """The flash of a phone that is held around the sheet, and the lamps of the room.

    Parameters
    ----------
    lights_mm : list of [x, y, z]
        Places of the flash: x right, y up, z towards the camera, origin at the centre of the sheet.
    light_sigma_mm : float
        Standard deviation of its Gaussian extent.
    illuminant : {"D65", "A", "inverse A", "E"}
        Its spectrum.
    coherence_um : float
        Width 4 sigma_s of the coherence window.
    wavelength_step_nm : float
        Step of the spectral sum.
    lamps_mm, lamp_sigma_mm : list of [x, y, z], float
        Places of the room's lamps, and standard deviation of their extent.
    """

    def __init__(
        self,
        *,
        lights_mm: list[list[float]] = [[120.0, 40.0, 250.0], [-60.0, 110.0, 250.0], [-70.0, -100.0, 250.0]],  # noqa: B006
        light_sigma_mm: float = 4.0,
        illuminant: Literal["D65", "A", "inverse A", "E"] = "inverse A",
        coherence_um: float = 65.0,
        wavelength_step_nm: float = 2.0,
        lamps_mm: list[list[float]] = [[800.0, 250.0, 1800.0], [-100.0, 900.0, 2000.0], [-700.0, 350.0, 1900.0]],  # noqa: B006
        lamp_sigma_mm: float = 300.0,
    ) -> None:
        self.lights_mm = lights_mm
        self.light_sigma_mm = light_sigma_mm
        self.illuminant: Literal["D65", "A", "inverse A", "E"] = illuminant
        self.coherence_um = coherence_um
        self.wavelength_step_nm = wavelength_step_nm
        self.lamps_mm = lamps_mm
        self.lamp_sigma_mm = lamp_sigma_mm

    def check(self) -> None:
        """Refuse places behind the sheet, and sizes that no light has.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        problems = [
            InputError(f"{list(place)} is no place", where=f"lamps_mm[{index}]", expected="[x, y, z] in mm, z above 0")
            for index, place in enumerate(self.lamps_mm)
            if len(place) != 3 or not np.isfinite(place).all() or place[2] <= 0
        ]
        refuse(problems, above_zero(lamp_sigma_mm=self.lamp_sigma_mm))
        check_lighting(
            lights_mm=self.lights_mm,
            camera_mm=[0.0, 0.0, 1.0],
            light_sigma_mm=self.light_sigma_mm,
            coherence_um=self.coherence_um,
            wavelength_step_nm=self.wavelength_step_nm,
        )


class FlashBench:
    """A simulated camera above a sheet of tiles, around which a simulated phone is held.

    Parameters
    ----------
    camera : simulated_flash.FlashCamera
        The camera.
    light : simulated_flash.PhoneFlash
        The phone, and the lamps of the room.
    tiles : [columns, rows]
        How often the sample is repeated on the sheet.
    paper : float
        Brightness of what scatters evenly on the sheet, relative to the brightest gratings.
    board : [columns, rows], optional
        Squares of a ChArUco board that lies below the sheet and is seen around it.
    square_mm, marker_mm : float
        Sides of its squares, and of the markers in them.
    knows_corners : bool
        Whether it says where the corners of the sheet are seen.
    camera_error_mm, light_error_mm : [x, y, z]
        What it says of the places of camera and flash, minus where they are.
    """

    def __init__(
        self,
        *,
        camera: FlashCamera,
        light: PhoneFlash,
        tiles: list[int] = [10, 7],  # noqa: B006
        paper: float = 0.003,
        board: list[int] | None = None,
        square_mm: float = 12.0,
        marker_mm: float = 9.0,
        knows_corners: bool = False,
        camera_error_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
        light_error_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
    ) -> None:
        self.camera = camera
        self.light = light
        self.tiles = tiles
        self.paper = paper
        self.board = board
        self.square_mm = square_mm
        self.marker_mm = marker_mm
        self.knows_corners = knows_corners
        self.camera_error_mm = camera_error_mm
        self.light_error_mm = light_error_mm
        self._scene: FlashScene | None = None
        self._lighting: Lighting | None = None
        self._index: int | None = None
        self._taken = 0

    @property
    def exposure_s(self) -> Sequence[float]:
        """Times of exposure of a bracket, shortest first."""
        return tuple(self.camera.exposure_s)

    @property
    def bits(self) -> int:
        """Depth of the photographs."""
        return 16 if self.camera.raw else 8

    @property
    def linear(self) -> bool:
        """Whether their values are proportional to light."""
        return self.camera.raw

    @property
    def has_room(self) -> bool:
        """There always is a photograph under the room's lamps."""
        return True

    @property
    def light_mm(self) -> Float64Array:
        """Places of the flash as they were measured, shape (L, 3)."""
        return np.asarray(self.light.lights_mm, np.float64) + self.light_error_mm

    @property
    def camera_mm(self) -> Float64Array:
        """Place of the camera as it was measured."""
        return np.asarray(self.camera.camera_mm, np.float64) + self.camera_error_mm

    @property
    def sheet_mm(self) -> tuple[float, float] | None:
        """Width and height of the sheet, once it is there."""
        return None if self._scene is None else self._scene.sheet.size_mm

    @property
    def corners_px(self) -> Float64Array | None:
        """Where its corners are seen, if the bench says so."""
        return self._scene.corners_px() if self.knows_corners and self._scene is not None else None

    @property
    def wavelength_nm(self) -> float | None:
        """Centre of the filter before the camera."""
        return self.camera.wavelength_nm

    @property
    def bandwidth_nm(self) -> float | None:
        """Its full width at half maximum."""
        return self.camera.bandwidth_nm

    @property
    def light_sigma_mm(self) -> float:
        """Standard deviation of the flash's extent."""
        return self.light.light_sigma_mm

    def place(self, sample: GratingSample | None) -> None:
        """Lay a sheet of tiles on the table.

        Raises
        ------
        InputError
            No sample is given, or the camera does not see the whole sheet and no field of view is set.
        """
        if sample is None:
            raise InputError("the simulated bench has no sample", expected="sample: a node such as simulate.polygons")
        camera, light, band = self.camera, self.light, None
        if camera.wavelength_nm is not None and camera.bandwidth_nm is not None:
            band = (camera.wavelength_nm, camera.bandwidth_nm)
        sheet = Sheet(sample.orientation_rad, sample.period_um, sample.pixel_mm, (self.tiles[0], self.tiles[1]))
        eye = np.asarray(camera.camera_mm, np.float64)
        self._scene = FlashScene(
            sheet=sheet,
            view=camera_view(sheet, eye, camera.target_mm, camera.up, camera.field_of_view_deg, camera.size_px),
            samples=camera.samples,
            paper=self.paper,
            board=None if self.board is None else Board(self.board[0], self.board[1], self.square_mm, self.marker_mm),
        )
        self._lighting = Lighting(
            lights_mm=np.asarray(light.lights_mm, np.float64),
            camera_mm=eye,
            light_sigma_mm=light.light_sigma_mm,
            illuminant=light.illuminant,
            depth_um=sample.depth_um,
            coherence_um=light.coherence_um,
            wavelength_step_nm=light.wavelength_step_nm,
            band_nm=band,
        )
        self.__dict__.pop("_flashes", None)
        self._taken = 0

    def check(self) -> None:
        """Find settings that no bench can have.

        Raises
        ------
        InputError, InputErrors
            All of them, each with its place.
        """
        misplaced = [
            InputError(f"{list(error)} is no displacement", where=where, expected="[x, y, z] in mm")
            for where, error in (("camera_error_mm", self.camera_error_mm), ("light_error_mm", self.light_error_mm))
            if len(error) != 3 or not np.isfinite(error).all()
        ]
        refuse(
            found_by({"camera": self.camera, "light": self.light}),
            misplaced,
            unusable_counts("tiles", self.tiles, "[columns, rows] of tiles, whole numbers from 1"),
            [] if self.board is None else unusable_counts("board", self.board, "[columns, rows] of squares"),
            above_zero(square_mm=self.square_mm),
            above_zero_up_to(self.square_mm, marker_mm=self.marker_mm),
            zero_or_more(paper=self.paper),
        )

    def put_light(self, index: int | None) -> None:
        """Put the flash in one of its places, or switch it off and the lamps on."""
        self._index = index

    def expose(self, exposure_s: float | None) -> Photo:
        """Take one photograph in colour."""
        self._taken += 1
        radiance = self._room() if self._index is None else self._flashes[self._index]
        return self.camera.photograph(radiance, exposure_s, self._taken)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.__dict__.pop("_flashes", None)

    @cached_property
    def _flashes(self) -> Image:
        scene, lighting = self._laid()
        return scene.under_flash(lighting)

    def _room(self) -> Image:
        scene, lighting = self._laid()
        return scene.under_lamps(lamps(self.light.lamps_mm, self.light.lamp_sigma_mm, lighting))

    def _laid(self) -> tuple[FlashScene, Lighting]:
        if self._scene is None or self._lighting is None:
            raise InputError("nothing lies before the simulated camera", expected="rig.place(sample) first")
        return self._scene, self._lighting


def unordered_exposures(exposure_s: Sequence[float]) -> list[InputError]:
    """What is wrong with the times of a bracket."""
    times = list(exposure_s)
    if times and times[0] > 0 and times == sorted(set(times)) and np.isfinite(times).all():
        return []
    return [InputError(f"exposure_s is {times}", where="exposure_s", expected="times above 0 in s, the shortest first")]
