"""The page's shader without a page: OpenGL through EGL, on a graphics card or on Mesa's software driver."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Mapping
from functools import cache
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.optics.sheet.view import View
from pipeline.viewer.scene import Scene
from pipeline.viewer.shader import METHODS, OPENGL, Method, fragment, table, vertex
from pipeline.viewer.textures import COLOURS, Textures, textures

_HOW = "moderngl (pip install 'optibench[gpu]') and EGL (on Debian: apt install libegl1 libgl1-mesa-dri)"
_PROBE = (
    "import moderngl; print(moderngl.create_context(standalone=True, backend='egl', require=330).info['GL_RENDERER'])"
)


@cache
def renderer() -> str:
    """Name of what draws.

    Raises
    ------
    InputError
        There is no OpenGL 3.3 through EGL. It is tried in another process, as some drivers end theirs.
    """
    tried = subprocess.run([sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=60, check=False)
    if tried.returncode:
        said = (tried.stderr.strip().splitlines() or [f"the driver ended its process ({tried.returncode})"])[-1]
        raise InputError(f"cannot draw off screen: {said}", expected=_HOW)
    return tried.stdout.strip()


class OffScreen:
    """A scene on the graphics card, to be drawn from any view; a context manager of one thread."""

    def __init__(self, scene: Scene) -> None:
        renderer()
        import moderngl

        self.scene = scene
        create: Any = moderngl.create_context  # its annotations leave the backend's settings out
        self._context = create(standalone=True, backend="egl", require=330)
        self._target: Any = None
        self._programs: dict[Method, Any] = {}
        prepared = textures(scene)
        self._constants = prepared.constants
        self._textures = self._uploaded(prepared)
        self._textures |= self._table()

    def __enter__(self) -> OffScreen:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._context.release()

    def picture(
        self,
        view: View,
        *,
        method: Method = "spectral",
        light_mm: NDArray[np.float64] | None = None,
        samples: int = 1,
        pixel_part: float = 0.0,
    ) -> NDArray[np.float32]:
        """Relative radiance, linear sRGB of shape (rows, columns, 3).

        Parameters
        ----------
        view : View
            The picture; its eye is the one that sees.
        method : {"spectral", "table"}
            Orders summed over wavelengths, or looked up.
        light_mm : ndarray of shape (3,), optional
            Where the light is, if not where the scene has it.
        samples : int
            Points along each side of a pixel.
        pixel_part : float
            Side of the area that a point stands for, in pixels; 0 for a point.
        """
        self.draw(view, method=method, light_mm=light_mm, samples=samples, pixel_part=pixel_part)
        flat = np.frombuffer(self._target.read(components=3, dtype="f4"), np.float32)
        return flat.reshape(view.rows, view.columns, 3)[::-1].copy()

    def draw(
        self,
        view: View,
        *,
        method: Method = "spectral",
        light_mm: NDArray[np.float64] | None = None,
        samples: int = 1,
        pixel_part: float = 0.0,
    ) -> None:
        """Draw :meth:`picture` without reading it, or waiting for it."""
        self._aim_at(view.columns, view.rows)
        program, triangle = self._program(method)
        light = self.scene.light_mm if light_mm is None else light_mm
        uniforms: dict[str, Any] = {
            **self._constants,
            "to_sheet": view.homography.T.ravel().tolist(),
            "eye": view.eye_mm.tolist(),
            "light": light.tolist(),
            "light_sigma": self.scene.light_sigma_mm,
            "depth": self.scene.depth_um,
            "period_scale": 1.0,
            "exposure": 1.0,
            "encoded": False,
            "lines_from": 0.0,
            "rows": float(view.rows),
            "samples": samples,
            "pixel_part": pixel_part,
        }
        self._set(program, uniforms)
        triangle.render(vertices=3)

    def finish(self) -> None:
        """Wait until all is drawn."""
        self._context.finish()

    def _aim_at(self, columns: int, rows: int) -> None:
        if self._target is None or self._target.size != (columns, rows):
            if self._target is not None:
                self._target.color_attachments[0].release()
                self._target.release()
            self._target = self._context.framebuffer([self._context.texture((columns, rows), 4, dtype="f4")])
        self._target.use()

    def _program(self, method: Method) -> tuple[Any, Any]:
        if method not in METHODS:
            raise InputError(f"there is no method {method}", expected=" or ".join(METHODS))
        if method not in self._programs:
            program = self._context.program(vertex_shader=vertex(OPENGL), fragment_shader=fragment(OPENGL, method))
            self._programs[method] = program, self._context.vertex_array(program, [])
        return self._programs[method]

    def _table(self) -> dict[str, Any]:
        """The table of colours, drawn."""
        import moderngl

        names = ("shorter", "middle", "longer")
        found = {name: self._context.texture(COLOURS, 4, dtype="f2") for name in names}
        for texture in found.values():
            texture.filter = moderngl.LINEAR, moderngl.LINEAR
            texture.repeat_x = texture.repeat_y = False
        program = self._context.program(vertex_shader=vertex(OPENGL), fragment_shader=table(OPENGL))
        self._context.framebuffer(list(found.values())).use()
        self._set(program, self._constants)
        self._context.vertex_array(program, []).render(vertices=3)
        return found

    def _set(self, program: Any, uniforms: Mapping[str, Any]) -> None:
        for unit, (name, texture) in enumerate(self._textures.items()):
            if name in program:
                texture.use(unit)
                program[name].value = unit
        for name, value in uniforms.items():
            if name in program:
                program[name].value = tuple(value) if isinstance(value, list) else value

    def _uploaded(self, prepared: Textures) -> dict[str, Any]:
        import moderngl

        found = {}
        for name, kind in (("maps", "u2"), ("shares", "f4"), ("spectrum", "f4")):
            array = np.ascontiguousarray(getattr(prepared, name))
            channels = array.shape[2] if array.ndim == 3 else 1
            texture = self._context.texture(array.shape[1::-1], channels, array.tobytes(), dtype=kind, alignment=1)
            texture.filter = moderngl.NEAREST, moderngl.NEAREST
            found[name] = texture
        return found
