"""The shader's text, put together from files of one idea each."""

from __future__ import annotations

from functools import cache
from importlib.resources import files
from typing import Literal, get_args

Method = Literal["spectral", "table"]
METHODS: tuple[Method, ...] = get_args(Method)

OPENGL = "#version 330 core\n"
WEBGL = "#version 300 es\n" + "".join(
    f"precision highp {kind};\n" for kind in ("float", "int", "sampler2D", "usampler2D")
)


@cache
def part(name: str) -> str:
    """One of the files."""
    return files("pipeline.viewer").joinpath(name).read_text(encoding="utf-8")


def vertex(head: str) -> str:
    """The vertex shader behind a line that names its language."""
    return head + part("whole.vert.glsl")


def table(head: str) -> str:
    """The fragment shader that draws the table of colours."""
    return head + part("colours.glsl")


def fragment(head: str, method: Method) -> str:
    """The fragment shader behind such lines, with the orders' sum over the spectrum by one of the methods."""
    return head + "\n".join(part(f"{name}.glsl") for name in ("sheet", "orders", method, "picture"))
