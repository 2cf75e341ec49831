"""What a capture stage may ask of a rig; simulated, replayed and real devices answer alike."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from pipeline.data.arrays import FloatArray
from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import Photo


@runtime_checkable
class Light(Protocol):
    """A light that can be switched."""

    def switch(self, on: bool) -> None:
        """Turn the light on or off."""


@runtime_checkable
class Camera(Protocol):
    """A camera with fixed settings."""

    def expose(self) -> Photo:
        """Take one photograph of what stands before the camera now."""


@runtime_checkable
class RotationMount(Protocol):
    """A polariser in a rotation mount."""

    @property
    def stops_rad(self) -> Sequence[float] | None:
        """The only angles this mount can take, or None where it turns freely."""

    def move_to(self, angle_rad: float) -> float:
        """Turn the polariser to ``angle_rad`` and return the angle reached once it stands still.

        Raises
        ------
        DeviceError
            The axis did not get there: its name and the cause are in the message, and it has been stopped.
        """


@runtime_checkable
class PolarizationRig(Protocol):
    """A camera behind a turning polariser, looking at a lit sample. A context manager: hardware is open inside."""

    @property
    def camera(self) -> Camera:
        """The camera."""

    @property
    def mount(self) -> RotationMount:
        """The polariser's mount."""

    @property
    def light(self) -> Light:
        """The panel."""

    @property
    def wavelength_nm(self) -> float | None:
        """Centre of the spectral filter."""

    @property
    def pixel_mm(self) -> float | None:
        """Pixel pitch on the sample."""

    def place(self, sample: GratingSample | None) -> None:
        """Put a virtual sample before the camera; a real rig takes None and photographs what lies there."""

    def check(self) -> None:
        """Find, before anything runs, all that would make a capture fail.

        Raises
        ------
        InputError
            What is wrong, in which file, and what was expected.
        """

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


@runtime_checkable
class BracketingCamera(Protocol):
    """A camera that exposes as long as it is told."""

    @property
    def exposure_s(self) -> Sequence[float]:
        """Times of exposure of a bracket, shortest first."""

    def expose_for(self, exposure_s: float | None) -> Photo:
        """Take one photograph in colour, its values as the camera stores them, full scale 1.

        Without a time of exposure the camera takes one that suits the room's light.
        """


@runtime_checkable
class MovedFlash(Protocol):
    """A flash that is put in one place after another."""

    @property
    def light_mm(self) -> FloatArray:
        """Its places, shape (L, 3); NaN where not known."""

    def put(self, index: int | None) -> None:
        """Put it in one of its places, or switch it off and the room's lamps on."""


@runtime_checkable
class FlashRig(Protocol):
    """A camera above a sheet, and a flash that is put in one place after another. A context manager, as others.

    What is known of the bench has the meaning and the units of :class:`pipeline.data.flash.FlashBrackets`.
    """

    @property
    def camera(self) -> BracketingCamera:
        """The camera."""

    @property
    def light(self) -> MovedFlash:
        """The flash."""

    @property
    def bits(self) -> int:
        """Depth of the photographs, 8 or 16."""

    @property
    def linear(self) -> bool:
        """Whether their values are proportional to light."""

    @property
    def has_room(self) -> bool:
        """Whether there is a photograph under room light."""

    @property
    def camera_mm(self) -> FloatArray:
        """Place of the camera, shape (3,); NaN where not known."""

    @property
    def sheet_mm(self) -> tuple[float, float] | None:
        """Width and height of the sheet."""

    @property
    def corners_px(self) -> FloatArray | None:
        """Where the sheet's corners are seen, shape (4, 2)."""

    @property
    def wavelength_nm(self) -> float | None:
        """Centre of the filter before the camera."""

    @property
    def bandwidth_nm(self) -> float | None:
        """Its full width at half maximum."""

    @property
    def light_sigma_mm(self) -> float | None:
        """Standard deviation of the flash's extent."""

    def place(self, sample: GratingSample | None) -> None:
        """Lay a virtual sample on the table; a real rig takes None and photographs what lies there."""

    def check(self) -> None:
        """Find, before anything runs, all that would make a capture fail.

        Raises
        ------
        InputError
            What is wrong, in which file, and what was expected.
        """

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...
