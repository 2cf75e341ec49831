"""Drawing inside the page: shapes, axes with ticks, and curves, coloured by the page's style sheet.

Charts are SVG in the page itself, so that text stays sharp in print and follows the reader's light or dark colours;
matplotlib would take 1.5 s to import and 0.2 s a figure.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from functools import lru_cache
from html import escape
from pathlib import Path

from markupsafe import Markup

Points = Sequence[tuple[float, float]]

CHARACTER = 6.6
"""Width of a digit of the ticks, about."""

TEMPLATES = Path(__file__).with_name("templates")


class Svg:
    """A drawing that grows shape by shape; lengths in CSS pixels, y down."""

    def __init__(self, width: float, height: float) -> None:
        self.width, self.height = width, height
        self._parts: list[str] = []

    def text(self, x: float, y: float, words: str, *, anchor: str = "start", kind: str = "tick", turn: int = 0) -> None:
        """Write words with their baseline's start, middle or end at a point."""
        turned = f' transform="rotate({turn} {x:.1f} {y:.1f})"' if turn else ""
        self._parts.append(
            f'<text class="{kind}" x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{turned}>{escape(words)}</text>'
        )

    def line(self, x0: float, y0: float, x1: float, y1: float, kind: str = "axis") -> None:
        """Draw a straight line."""
        self._parts.append(f'<line class="{kind}" x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"/>')

    def rect(self, x: float, y: float, width: float, height: float, kind: str = "frame") -> None:
        """Draw a rectangle."""
        self._parts.append(f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}"/>')

    def path(self, points: Points, kind: str, *, closed: bool = False) -> None:
        """Draw a line through points, or the area inside."""
        if points:
            steps = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
            self._parts.append(f'<path class="{kind}" d="M{steps}{"Z" if closed else ""}"/>')

    def dot(self, x: float, y: float, radius: float, kind: str = "dot", title: str = "") -> None:
        """Draw a filled circle."""
        said = f"<title>{escape(title)}</title>" if title else ""
        self._parts.append(f'<circle class="{kind}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:.1f}">{said}</circle>')

    def image(self, uri: str, x: float, y: float, width: float, height: float) -> None:
        """Place a picture, stretched to a rectangle."""
        self._parts.append(
            f'<image x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" height="{height:.1f}" preserveAspectRatio="none" '
            f'href="{uri}"/>'
        )

    def markup(self, label: str, kind: str = "chart") -> Markup:
        """The drawing, as an element of the page."""
        return Markup(
            f'<svg class="{kind}" viewBox="0 0 {self.width:.0f} {self.height:.0f}" role="img" '
            f'aria-label="{escape(label)}" style="max-width:{self.width:.0f}px">{"".join(self._parts)}</svg>'
        )


def standalone(drawing: str) -> str | None:
    """A chart of the page as a file of its own, in the page's light colours; None for what is no chart."""
    found = re.fullmatch(r'<svg class="chart" viewBox="0 0 (\d+) (\d+)"[^>]*>(.*)</svg>', drawing, re.DOTALL)
    if found is None:
        return None
    width, height, shapes = found.groups()
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" class="chart" viewBox="0 0 {width} {height}" width="{width}" '
        f'height="{height}"><style>{_light_style()}</style><rect width="100%" height="100%" fill="#fff"/>'
        f"{shapes}</svg>\n"
    )


@lru_cache
def _light_style() -> str:
    """The style sheet of charts with the colours of a light page written out, which not every program looks up."""
    colours: dict[str, str] = {}
    for name, colour in re.findall(r"--(\w+): (#\w+)", (TEMPLATES / "report.css").read_text()):
        colours.setdefault(name, colour)
    return re.sub(r"var\(--(\w+)\)", lambda match: colours[match[1]], (TEMPLATES / "svg.css").read_text())


def room_for(places: Sequence[tuple[float, str]]) -> float:
    """Width that a left axis takes with these ticks and its name."""
    return 31 + CHARACTER * max((len(words) for _, words in places), default=0)


def ticks(low: float, high: float, most: int = 6) -> list[tuple[float, str]]:
    """At most ``most`` + 1 round numbers between two, with their text."""
    span = high - low
    if not (math.isfinite(span) and span > 0):
        return []
    power = math.floor(math.log10(span / most))
    factor = next(f for f in (1, 2, 2.5, 5, 10) if f * 10.0**power >= span / most * (1 - 1e-9))
    step = factor * 10.0**power
    decimals = max(0, -power + (factor == 2.5) - (factor == 10))
    places = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    return [(i * step, f"{i * step + 0.0:.{decimals}f}".replace("-", "−")) for i in places]


class Axes:
    """A frame in a drawing with data coordinates inside, x to the right and y up.

    Parameters
    ----------
    svg : Svg
        Where to draw.
    box : tuple of float
        Left, top, width and height of the frame in the drawing.
    x, y : tuple of float
        Data at left and right, and at bottom and top; either may run backwards.
    """

    def __init__(
        self, svg: Svg, box: tuple[float, float, float, float], x: tuple[float, float], y: tuple[float, float]
    ) -> None:
        self.svg, self.x, self.y = svg, x, y
        self.left, self.top, self.width, self.height = box
        self.right, self.bottom = self.left + self.width, self.top + self.height

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Where a data point lies in the drawing."""
        return (
            self.left + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.width,
            self.bottom - (y - self.y[0]) / (self.y[1] - self.y[0]) * self.height,
        )

    def label_x(self, label: str, places: Sequence[tuple[float, str]] | None = None) -> None:
        """Draw ticks along the lower side, and name it."""
        for value, words in ticks(min(self.x), max(self.x)) if places is None else places:
            x, _ = self.at(value, self.y[0])
            self.svg.line(x, self.bottom, x, self.bottom + 4)
            self.svg.text(x, self.bottom + 15, words, anchor="middle")
        self.svg.text(self.left + self.width / 2, self.bottom + 31, label, anchor="middle", kind="label")

    def label_y(self, label: str, places: Sequence[tuple[float, str]] | None = None) -> None:
        """Draw ticks along the left side, and name it."""
        marks = ticks(min(self.y), max(self.y)) if places is None else places
        for value, words in marks:
            _, y = self.at(self.x[0], value)
            self.svg.line(self.left - 4, y, self.left, y)
            self.svg.text(self.left - 7, y + 4, words, anchor="end")
        middle = self.top + self.height / 2
        self.svg.text(self.left - room_for(marks) + 14, middle, label, anchor="middle", kind="label", turn=-90)

    def frame(self) -> None:
        """Draw the frame."""
        self.svg.rect(self.left, self.top, self.width, self.height)


def curve(x: Sequence[float], y: Sequence[float], x_label: str, y_label: str, places: Sequence[float]) -> Markup:
    """A curve through measured points, its y axis from zero; ``places`` are the ticks of x."""
    svg = Svg(440, 230)
    known = [value for value in y if math.isfinite(value)]
    margin = 0.04 * ((max(x) - min(x)) or 1.0)
    axes = Axes(svg, (62, 12, 362, 170), (min(x) - margin, max(x) + margin), (0, 1.1 * max([*known, 1e-9])))
    axes.label_x(x_label, [(place, f"{place:g}") for place in places])
    axes.label_y(y_label)
    svg.line(axes.left, axes.bottom, axes.right, axes.bottom)
    svg.line(axes.left, axes.top, axes.left, axes.bottom)
    points = [axes.at(a, b) for a, b in zip(x, y, strict=True) if math.isfinite(b)]
    svg.path(points, "curve")
    for (px, py), a, b in zip(points, x, y, strict=False):
        svg.dot(px, py, 3, title=f"{a:.4g}, {b:.4g}")
    return svg.markup(f"{y_label} over {x_label}")
