"""Designs of gratings as SVG files, which drawing programs such as Inkscape write.

Any element or group may carry ``data-orientation``, degrees anticlockwise from +x as the page is seen, or ``along`` and
``across`` (of a stroke's own direction), or ``radial`` (away from the middle of a shape), and ``data-period-um`` or
``data-lines-per-mm``. Elements inherit them of the groups around them. Where there is no ``data-orientation``, a colour
tells it: half its hue, as in the reports' wheel of orientations. White always is ground.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.photo_files import readable_suffixes
from pipeline.errors import InputError, InputErrors, nearest

Float64Array = NDArray[np.float64]
Direction = Literal["along", "across", "radial"]

_log = logging.getLogger(__name__)

PIXELS_PER_MM = 96 / 25.4
MOST_ELEMENTS = 200_000
_LINK = "{http://www.w3.org/1999/xlink}href"
PICTURES = "maps=picture, or simulate.picture_design, draws a picture"
WORDS: tuple[Direction, ...] = ("along", "across", "radial")


@dataclass(frozen=True, eq=False)
class Shape:
    """The inside of a shape, or the band along its outline.

    Attributes
    ----------
    contours_mm : tuple of ndarray of shape (n, 2)
        Its outlines, x right, y up, from the middle of the page.
    width_mm : float or None
        Of the band; None for the inside.
    even_odd : bool
        Rule of the inside.
    orientation : float, str or None
        In radians, or a direction of the shape's own; None for ground.
    period_um : float or None
        None where the file does not say.
    """

    contours_mm: tuple[Float64Array, ...]
    width_mm: float | None
    even_odd: bool
    orientation: float | Direction | None
    period_um: float | None


@dataclass(frozen=True, eq=False)
class VectorDesign:
    """A page and the shapes on it, later ones on top."""

    width_mm: float
    height_mm: float
    shapes: tuple[Shape, ...]


def read_vector_file(path: Path, *, width_mm: float | None = None, step_mm: float = 0.05) -> VectorDesign:
    """Read a design.

    Parameters
    ----------
    path : Path
        An SVG file.
    width_mm : float, optional
        Width to which the page is scaled; otherwise it is as wide as it says, 96 of its pixels to the inch.
    step_mm : float
        Length of the straight pieces that curves are made of, at most.

    Raises
    ------
    InputError, InputErrors
        The file is missing, no SVG, without a size or a shape, or shapes in it do not tell an orientation.
    """
    import svgelements

    if not path.is_file():
        siblings = (p.name for p in path.parent.iterdir()) if path.parent.is_dir() else ()
        raise InputError(f"there is no file {path.name}", where=str(path), hint=nearest(path.name, siblings))
    try:
        if (elements := _expanded(ElementTree.parse(path).getroot())) > MOST_ELEMENTS:
            raise ValueError(f"its uses of other elements make {elements} of them, more than {MOST_ELEMENTS}")
        page = svgelements.SVG.parse(str(path), reify=False)
    except Exception as error:  # what is malformed fails in as many ways as there are attributes
        raise InputError(
            f"{path.name} cannot be read: {error}",
            where=str(path),
            expected="an SVG file",
            hint=PICTURES if path.suffix.lower() in readable_suffixes() else "",
        ) from None
    if not isinstance(page, svgelements.SVG):
        raise InputError(f"{path.name} holds no <svg>", where=str(path), expected="an SVG file")
    width, height = float(page.width), float(page.height)
    told = [str(page.values.get(name, "%")) for name in ("width", "height")]
    if not (width > 0 and height > 0) or (page.viewbox is None and any(side.endswith("%") for side in told)):
        raise InputError("the page has no size", where=str(path), expected="width and height, or a viewBox")
    scale = width_mm / width if width_mm is not None else 1 / PIXELS_PER_MM
    reader = _Reader(path, scale, (width / 2, height / 2), step_mm)
    shapes = tuple(shape for element in page.elements() for shape in reader.shapes(element))
    if reader.problems:
        raise InputErrors(reader.problems)
    if not shapes:
        raise InputError("there is no shape on the page", where=str(path), expected="paths, circles, rectangles, ...")
    return VectorDesign(width * scale, height * scale, shapes)


def _expanded(root: ElementTree.Element) -> int:
    """How many elements there are once all that is used stands where it is used."""
    named = {element.get("id"): element for element in root.iter()}
    counts: dict[ElementTree.Element, int | None] = {}

    def count(element: ElementTree.Element) -> int:
        if element not in counts:
            counts[element] = None
            total = 1 + sum(count(child) for child in element)
            used = (element.get("href") or element.get(_LINK) or "")[1:]
            if element.tag.endswith("}use") and used in named:
                total += count(named[used])
            counts[element] = total
        if (known := counts[element]) is None:
            raise ValueError(f"'{element.get('id', element.tag)}' uses itself")
        return known

    return count(root)


class _Reader:
    """Makes shapes of elements, and collects what is wrong with them."""

    def __init__(self, path: Path, scale: float, middle: tuple[float, float], step_mm: float) -> None:
        self.path = path
        self.scale = scale
        self.middle = middle
        self.step_mm = step_mm
        self.problems: list[InputError] = []

    def shapes(self, element: Any) -> Iterator[Shape]:
        import svgelements

        if isinstance(element, svgelements.Text | svgelements.Image):
            _log.warning("%s: text and pictures are left out; make text a path first", self._name(element))
        if not isinstance(element, svgelements.Shape) or self._hidden(element):
            return
        if element.values.get("clip-path") not in (None, "none") or element.values.get("mask") not in (None, "none"):
            _log.warning("%s: clips and masks do not count", self._name(element))
        try:
            contours = tuple(self._contours(svgelements.Path(element), element.transform))
            if not contours:
                return
            period = self._period(element)
            even_odd = str(element.values.get("fill-rule", "nonzero")).strip() == "evenodd"
            inside = tuple(contour for contour in contours if len(contour) > 2)
            if inside and self._painted(element, "fill"):
                yield Shape(inside, None, even_odd, self._orientation(element, "fill"), period)
            if self._painted(element, "stroke") and (width := float(element.implicit_stroke_width) * self.scale) > 0:
                yield Shape(contours, width, False, self._orientation(element, "stroke"), period)
        except InputError as error:
            self.problems.append(error.at(f"{self.path}: {self._name(element)}"))

    def _contours(self, path: Any, placed: Any) -> Iterator[Float64Array]:
        """Outlines as points; straight pieces keep their ends, curves become short ones and then are put in place."""
        import svgelements

        scale = float(abs(placed.a * placed.d - placed.b * placed.c)) ** 0.5 * self.scale
        for outline in path.as_subpaths():
            points: list[tuple[float, float]] = []
            for segment in svgelements.Path(outline):
                if isinstance(segment, svgelements.Move) or segment.start is None or segment.end is None:
                    continue
                if isinstance(segment, svgelements.Line | svgelements.Close):
                    corners = [(end.x, end.y) for end in (segment.start, segment.end)]
                else:
                    chords = np.diff(segment.npoint(np.linspace(0, 1, 65)), axis=0)
                    length = float(np.hypot(*chords.T).sum()) * scale
                    pieces = int(np.clip(np.ceil(length / self.step_mm), 8, 4096))
                    corners = segment.npoint(np.linspace(0, 1, pieces + 1)).tolist()
                points += corners
            if len(points) > 1:
                x, y = np.array(points, np.float64).T
                right = placed.a * x + placed.c * y + placed.e - self.middle[0]
                down = placed.b * x + placed.d * y + placed.f - self.middle[1]
                contour = np.stack([right, -down], axis=1) * self.scale
                if not np.isfinite(contour).all():
                    raise InputError("coordinates that are no numbers", expected="places on the page")
                yield contour

    def _painted(self, element: Any, kind: str) -> bool:
        return getattr(element, kind).value is not None and getattr(element, kind).opacity != 0

    def _orientation(self, element: Any, kind: str) -> float | Direction | None:
        written = element.values.get("data-orientation")
        colour = getattr(element, kind)
        plain = not str(element.values.get(kind, "")).strip().startswith("url(")
        if plain and colour.red == colour.green == colour.blue == 255:
            return None
        if written is not None:
            words = [word for word in WORDS if word == str(written).strip()]
            if words and (kind == "stroke" or words[0] == "radial"):
                return words[0]
            if not np.isfinite(degrees := _number(written)):
                right = "degrees, or along, across or radial" if kind == "stroke" else "degrees, or radial"
                raise InputError(
                    f"data-orientation of a {kind} is '{written}'", expected=right, hint=nearest(str(written), WORDS)
                )
            return float(np.deg2rad(degrees))
        if not plain:
            raise InputError(f"the {kind} is no plain colour", expected="a colour, or data-orientation")
        if colour.red == colour.green == colour.blue:
            if kind == "stroke":
                return "along"
            raise InputError(
                f"the fill '{element.values.get(kind)}' is grey or no colour, and tells no orientation",
                expected="a colour, whose hue is twice the orientation, or data-orientation",
            )
        return float(np.deg2rad(float(colour.hue) / 2))

    def _period(self, element: Any) -> float | None:
        given: dict[str, float] = {}
        names = ("data-period-um", "data-lines-per-mm")
        own = element.values.get("attributes", {})
        for name in names:
            written = (own if any(name in own for name in names) else element.values).get(name)
            if written is None:
                continue
            given[name] = _number(written)
            if not 0 < given[name] < np.inf:
                raise InputError(f"{name} is '{written}'", expected="a number above 0")
        if len(given) == 2:
            raise InputError("the period is told twice", expected="data-period-um or data-lines-per-mm")
        period, density = given.get("data-period-um"), given.get("data-lines-per-mm")
        return 1000 / density if density else period

    @staticmethod
    def _hidden(element: Any) -> bool:
        return element.values.get("visibility") in ("hidden", "collapse") or element.values.get("display") == "none"

    @staticmethod
    def _name(element: Any) -> str:
        return f"{element.values.get('tag', 'element')} '{element.id or 'without an id'}'"


def _number(text: object) -> float:
    """The number that a text writes; NaN where it is none."""
    try:
        return float(str(text))
    except ValueError:
        return float("nan")
