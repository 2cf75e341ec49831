"""What a capture stage may ask of a rig; simulated, replayed and real devices answer alike."""

from __future__ import annotations

from collections.abc import Sequence
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

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
