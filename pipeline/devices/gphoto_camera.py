"""A digital camera on a cable, through libgphoto2: set, released, and its file read as linear signal."""

from __future__ import annotations

import importlib.util
import logging
import math
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from pipeline.data.photographs import Photo
from pipeline.devices.photo_files import DISPLAY_SUFFIXES, RAW_SUFFIXES, read_photo
from pipeline.errors import DeviceError, InputError, nearest
from pipeline.limits import above_zero, refuse

log = logging.getLogger(__name__)

_INSTALL = "pip install gphoto2"
_SETTLE_S, _SETTLE_POLL_S = 2.0, 0.05
_SHUTTER = "shutterspeed"
_NEAR_ENOUGH = 0.2
"""Of the logarithm: shutter speeds stand a third of a stop apart, 0.23."""
_SWITCH = {"on": 1, "true": 1, "off": 0, "false": 0}
_STATED = {
    "make": ("manufacturer",),
    "serial": ("serialnumber", "eosserialnumber"),
    "lens": ("lensname",),
    "iso": ("iso",),
    "aperture": ("f-number", "aperture"),
    "shutter": ("shutterspeed",),
}
"""What a photo's metadata takes from the camera's settings where the file does not tell."""


class GphotoCamera:
    """A camera that libgphoto2 controls.

    Parameters
    ----------
    model : str
        Part of the camera's name, in any case; needed where several cameras are connected.
    port : str
        Its port, such as ``usb:001,004``; needed where two of one model are connected.
    settings : dict of str to str, optional
        Settings by libgphoto2's names, such as ``{iso: "100", shutterspeed: "1/4", f-number: "f/8"}``; ``gphoto2
        --list-all-config`` tells what the camera has. Each is read back.
    wait_ms : int
        Silence after a photo that shows that the camera has no further file of it.
    keep : bool
        Whether photos stay on the camera, too.
    exposure_s : list of float
        Times of a bracket of exposures, shortest first, for stages that take one.
    room_exposure_s : float, optional
        For what a room's lamps light; by default what the camera is set to.
    """

    physical = True

    def __init__(
        self,
        *,
        model: str = "",
        port: str = "",
        settings: dict[str, str] | None = None,
        wait_ms: int = 100,
        keep: bool = False,
        exposure_s: list[float] = [],  # noqa: B006 - read from the syntax tree, never modified
        room_exposure_s: float | None = None,
    ) -> None:
        self.model, self.port = model, port
        self.settings = dict(settings or {})
        self.wait_ms, self.keep = wait_ms, keep
        self.exposure_s, self.room_exposure_s = tuple(exposure_s), room_exposure_s
        self.name = f"camera {model}".strip()
        self._model = model
        self._camera: Any = None
        self._warned = False

    def check(self) -> None:
        """Refuse a camera that is not waited for, and where the library that talks to cameras is not installed.

        Raises
        ------
        InputError
            It says what was expected, or what to install.
        """
        refuse(above_zero(wait_ms=self.wait_ms, room_exposure_s=self.room_exposure_s))
        if importlib.util.find_spec("gphoto2") is None:
            raise InputError("the package gphoto2, which talks to cameras, is not installed", hint=_INSTALL)

    def expose(self) -> Photo:
        """Take one photograph.

        Returns
        -------
        Photo
            The raw file where the camera delivers one, else the best that it delivers; ``metadata`` and ``exposure_s``
            from the file or, where it does not tell, from the camera's settings.

        Raises
        ------
        DeviceError
            The camera is not open, does not release, or delivers no file that can be read.
        """
        return self._taken(linear=None)

    def expose_for(self, exposure_s: float | None) -> Photo:
        """Take one photograph at the shutter speed nearest to a time of exposure, its values as the camera stores them.

        Raises
        ------
        DeviceError
            As of :meth:`expose`, or the camera has no shutter speed that is near.
        """
        time_s = self.room_exposure_s if exposure_s is None else exposure_s
        if time_s is not None:
            self._set_shutter(time_s)
        return self._taken(linear=True)

    def _taken(self, linear: bool | None) -> Photo:
        if self._camera is None:
            raise DeviceError(f"{self.name}: the camera is not open")
        import gphoto2

        with tempfile.TemporaryDirectory(prefix="optibench-") as folder:
            with self._talking("does not take the photo"):
                stored = self._camera.capture(gphoto2.GP_CAPTURE_IMAGE)
            paths = list(dict.fromkeys([(stored.folder, stored.name), *self._further_files()]))
            place, name = min(paths, key=lambda path: _rank(path[1]))
            file = Path(folder) / Path(name).name
            with self._talking(f"does not hand out {name}"):
                self._camera.file_get(place, name, gphoto2.GP_FILE_TYPE_NORMAL).save(str(file))
            try:
                photo = read_photo(file, linear=linear)
            except InputError as error:
                raise DeviceError(f"{self.name}: what it delivered as {name} is no photo: {error.what}") from error
        if not self.keep:
            self._delete(paths)
        if linear is None and file.suffix.lower() in DISPLAY_SUFFIXES and not self._warned:
            log.warning("%s delivers %s, whose tone curve is only guessed: set it to raw", self.name, file.suffix)
            self._warned = True
        return self._told(photo)

    def __enter__(self) -> Self:
        try:
            import gphoto2
        except ImportError as error:
            raise DeviceError(f"{self.name}: the package gphoto2 is not installed: {_INSTALL}") from error
        model, port = self._found(gphoto2)
        self._model, self.name = model, f"camera {model} on {port}"
        camera = gphoto2.Camera()
        with self._talking("cannot be opened; does another program hold it?"):
            ports = gphoto2.PortInfoList()
            ports.load()
            camera.set_port_info(ports[ports.lookup_path(port)])
            abilities = gphoto2.CameraAbilitiesList()
            abilities.load()
            camera.set_abilities(abilities[abilities.lookup_model(model)])
            camera.init()
        self._camera, self._warned = camera, False
        try:
            self._set_all()
        except BaseException:
            self.__exit__(None, None, None)
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        camera, self._camera = self._camera, None
        try:
            with self._talking("cannot be closed"):
                camera.exit()
        except DeviceError as failure:
            log.warning("%s", failure)

    def _found(self, gphoto2: Any) -> tuple[str, str]:
        with self._talking("cannot be looked for"):
            found = gphoto2.Camera.autodetect()
            there = [(found.get_name(i), found.get_value(i)) for i in range(found.count())]
        return _meant(there, self.model, self.port)

    def _further_files(self) -> Iterator[tuple[str, str]]:
        """Files that the camera announces beside the first, such as the JPEG of a raw photo."""
        import gphoto2

        while True:
            with self._talking("does not say whether the photo is complete"):
                event, data = self._camera.wait_for_event(self.wait_ms)
            if event == gphoto2.GP_EVENT_TIMEOUT:
                return
            if event == gphoto2.GP_EVENT_FILE_ADDED:
                yield data.folder, data.name

    def _delete(self, paths: list[tuple[str, str]]) -> None:
        for folder, name in paths:
            try:
                with self._talking(f"does not delete {name}"):
                    self._camera.file_delete(folder, name)
            except DeviceError as failure:
                log.warning("%s: its memory may fill up", failure)

    # Settings

    def _set_all(self) -> None:
        with self._talking("does not tell its settings"):
            widgets = {widget.get_name(): widget for widget in _leaves(self._camera.get_config())}
        for name, value in self.settings.items():
            if name not in widgets:
                raise DeviceError(f"{self.name} has no setting '{name}'; {nearest(name, widgets)}")
            self._set(widgets[name], str(value))

    def _set_shutter(self, time_s: float) -> None:
        if self._camera is None:
            raise DeviceError(f"{self.name}: the camera is not open")
        with self._talking(f"does not tell its setting '{_SHUTTER}'"):
            widget = self._camera.get_single_config(_SHUTTER)
            speeds = [widget.get_choice(i) for i in range(widget.count_choices())]
        known = {speed: seconds for speed in speeds if (seconds := _seconds(speed))}
        if not known:
            raise DeviceError(f"{self.name} offers no shutter speeds: is it set to manual exposure?")
        nearest_one = min(known, key=lambda speed: abs(math.log(known[speed] / time_s)))
        if abs(math.log(known[nearest_one] / time_s)) > _NEAR_ENOUGH:
            raise DeviceError(f"{self.name} cannot expose for {time_s:g} s; the nearest is {nearest_one}")
        self._set(widget, nearest_one)

    def _set(self, widget: Any, value: str) -> None:
        import gphoto2

        name = widget.get_name()
        with self._talking(f"does not tell its setting '{name}'"):
            kind, read_only, before = widget.get_type(), widget.get_readonly(), widget.get_value()
            menu = kind in (gphoto2.GP_WIDGET_RADIO, gphoto2.GP_WIDGET_MENU)
            choices = [widget.get_choice(i) for i in range(widget.count_choices())] if menu else []
        if menu and value not in choices:
            raise DeviceError(f"{self.name} cannot set '{name}' to '{value}'; {nearest(value, choices)}")
        try:
            wanted = _as_type_of(before, value)
        except ValueError:
            raise DeviceError(f"{self.name} cannot set '{name}' to '{value}': it is no number") from None
        if wanted == before:
            return
        if read_only:
            raise DeviceError(f"{self.name} does not let '{name}' be set from outside; it is {before}")
        with self._talking(f"does not accept '{value}' for '{name}'"):
            widget.set_value(wanted)
            self._camera.set_single_config(name, widget)
        deadline = time.monotonic() + _SETTLE_S
        while (now := self._value(name)) != wanted:
            if time.monotonic() > deadline:
                raise DeviceError(f"{self.name} keeps '{name}' at '{now}' instead of '{value}'")
            time.sleep(_SETTLE_POLL_S)

    def _value(self, name: str) -> Any:
        with self._talking(f"does not tell its setting '{name}'"):
            return self._camera.get_single_config(name).get_value()

    def _told(self, photo: Photo) -> Photo:
        """The photo with what only the camera says of it."""
        with self._talking("does not tell its settings"):
            values = {widget.get_name(): widget.get_value() for widget in _leaves(self._camera.get_config())}
        stated = {"model": self._model}
        for key, names in _STATED.items():
            known = [str(values[name]) for name in names if values.get(name) not in (None, "")]
            stated |= {key: known[0]} if known else {}
        exposure_s = photo.exposure_s if photo.exposure_s is not None else _seconds(stated.get("shutter", ""))
        return Photo(photo.image, photo.saturated, exposure_s, {**stated, **photo.metadata})

    @contextmanager
    def _talking(self, complaint: str) -> Iterator[None]:
        """Turn libgphoto2's errors into one in words."""
        import gphoto2

        try:
            yield
        except gphoto2.GPhoto2Error as error:
            raise DeviceError(f"{self.name} {complaint}: {error.string} (libgphoto2 error {error.code})") from error


def _meant(there: list[tuple[str, str]], model: str, port: str) -> tuple[str, str]:
    """Model and port of the one connected camera that the settings mean."""
    meant = [camera for camera in there if model.lower() in camera[0].lower() and port in ("", camera[1])]
    if len(meant) == 1:
        return meant[0]
    wanted = f"camera {model}".strip() + (f" on {port}" if port else "")
    listed = ", ".join(f"{other} on {place}" for other, place in meant or there)
    if meant:
        raise DeviceError(f"{wanted}: several cameras fit ({listed}): name one by its model or port")
    where = f"connected is {listed}" if there else "no camera is: are its cable, power and USB mode (PTP) right?"
    raise DeviceError(f"{wanted} is not connected; {where}")


def _leaves(widget: Any) -> Iterator[Any]:
    if widget.count_children() == 0:
        yield widget
    for index in range(widget.count_children()):
        yield from _leaves(widget.get_child(index))


def _rank(name: str) -> int:
    """Raw files before all others, and pictures for a display last."""
    suffix = Path(name).suffix.lower()
    return 0 if suffix in RAW_SUFFIXES else 2 if suffix in DISPLAY_SUFFIXES else 1


def _as_type_of(before: Any, value: str) -> Any:
    """The value as libgphoto2 holds settings of this type: text, whole number or number."""
    if isinstance(before, int):
        return _SWITCH[value.lower()] if value.lower() in _SWITCH else int(value)
    return float(value) if isinstance(before, float) else value


def _seconds(shutter: str) -> float | None:
    """Seconds from a shutter setting: ``1/4``, ``0.0100s``, ``2``; None for bulb and the like."""
    try:
        return float(Fraction(shutter.strip().removesuffix("s").strip()))
    except (ValueError, ZeroDivisionError):
        return None
