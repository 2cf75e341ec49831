"""A simulated bench on which a phone's flash is put around a holographic sheet."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from types import TracebackType
from typing import Literal, Self

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices import protocols
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.flash_scene import FlashScene, lamps
from pipeline.devices.sheet_views import camera_view, unusable_counts
from pipeline.devices.virtual_light import Image, Lighting, check_lighting
from pipeline.devices.virtual_sheet import Sheet
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, found_by, refuse, zero_or_more
from pipeline.optics.charuco import Board

Float64Array = NDArray[np.float64]


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
    error_mm : [x, y, z]
        What it says of its places, minus where they are.
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
        error_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
    ) -> None:
        self.lights_mm = lights_mm
        self.light_sigma_mm = light_sigma_mm
        self.illuminant: Literal["D65", "A", "inverse A", "E"] = illuminant
        self.coherence_um = coherence_um
        self.wavelength_step_nm = wavelength_step_nm
        self.lamps_mm = lamps_mm
        self.lamp_sigma_mm = lamp_sigma_mm
        self.error_mm = error_mm
        self.index: int | None = None

    @property
    def light_mm(self) -> Float64Array:
        """Places of the flash as they were measured, shape (L, 3)."""
        return np.asarray(self.lights_mm, np.float64) + self.error_mm

    def put(self, index: int | None) -> None:
        """Put it in one of its places, or switch it off and the lamps on."""
        self.index = index

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
        refuse(problems, no_displacement(error_mm=self.error_mm), above_zero(lamp_sigma_mm=self.lamp_sigma_mm))
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
    camera : flash_camera.FlashCamera
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
    camera_error_mm : [x, y, z]
        What it says of the place of the camera, minus where it is.
    """

    has_room = True

    def __init__(
        self,
        *,
        camera: protocols.BracketingCamera,
        light: protocols.MovedFlash,
        tiles: list[int] = [10, 7],  # noqa: B006
        paper: float = 0.003,
        board: list[int] | None = None,
        square_mm: float = 12.0,
        marker_mm: float = 9.0,
        knows_corners: bool = False,
        camera_error_mm: list[float] = [0.0, 0.0, 0.0],  # noqa: B006
    ) -> None:
        if not isinstance(camera, FlashCamera) or not isinstance(light, PhoneFlash):
            raise InputError(
                "the simulated bench needs a simulated camera and flash",
                expected="camera: {device: flash_camera.FlashCamera}, light: {device: simulated_flash.PhoneFlash}",
            )
        self.camera = camera
        self.light = light
        self.tiles = tiles
        self.paper = paper
        self.board = board
        self.square_mm = square_mm
        self.marker_mm = marker_mm
        self.knows_corners = knows_corners
        self.camera_error_mm = camera_error_mm
        self._scene: FlashScene | None = None
        self._lighting: Lighting | None = None

    @property
    def bits(self) -> int:
        """Depth of the photographs."""
        return 16 if self.camera.raw else 8

    @property
    def linear(self) -> bool:
        """Whether their values are proportional to light."""
        return self.camera.raw

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
        camera.look_at(self._radiance)

    def check(self) -> None:
        """Find settings that no bench can have.

        Raises
        ------
        InputError, InputErrors
            All of them, each with its place.
        """
        refuse(
            found_by({"camera": self.camera, "light": self.light}),
            no_displacement(camera_error_mm=self.camera_error_mm),
            unusable_counts("tiles", self.tiles, "[columns, rows] of tiles, whole numbers from 1"),
            [] if self.board is None else unusable_counts("board", self.board, "[columns, rows] of squares"),
            above_zero(square_mm=self.square_mm),
            above_zero_up_to(self.square_mm, marker_mm=self.marker_mm) if self.square_mm > 0 else [],
            zero_or_more(paper=self.paper),
        )

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

    def _radiance(self) -> Image:
        if self.light.index is not None:
            return self._flashes[self.light.index]
        scene, lighting = self._laid()
        return scene.under_lamps(lamps(self.light.lamps_mm, self.light.lamp_sigma_mm, lighting))

    def _laid(self) -> tuple[FlashScene, Lighting]:
        if self._scene is None or self._lighting is None:
            raise InputError("nothing lies before the simulated camera", expected="rig.place(sample) first")
        return self._scene, self._lighting


def no_displacement(**settings: Sequence[float]) -> list[InputError]:
    """Settings that do not say by how much something is misplaced."""
    return [
        InputError(f"{list(error)} is no displacement", where=name, expected="[x, y, z] in mm")
        for name, error in settings.items()
        if len(error) != 3 or not np.isfinite(error).all()
    ]
