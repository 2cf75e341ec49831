"""A sample drawn by a designer with vectors."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import drawn_sample, foreseen, undrawable
from pipeline.devices.vector_file import Shape, VectorDesign, read_vector_file
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse
from pipeline.optics.drawing import Drawing, azimuth
from pipeline.optics.vector_shapes import band, bounds, filled


def vector_design(
    *,
    file: Path,
    width_mm: float | None = None,
    pixel_mm: float = 0.025,
    period_um: float = 1.4,
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw the shapes of an SVG file as gratings, later ones on top.

    Paths, circles, ellipses, rectangles, polygons, polylines and lines count, with their groups, transforms and styles;
    text has to be made a path first. A shape's orientation is what ``data-orientation`` says, on itself or on a group
    around it: degrees anticlockwise from +x as the page is seen, whatever turns the shape; ``along`` or ``across`` a
    stroke; or ``radial``, away from its middle. Where nothing says it, a colour does: the orientation is half its hue,
    so that the wheel of a drawing program is that of the report. Strokes in grey diffract along themselves, a
    fill in grey is refused, and white always is ground.

    Parameters
    ----------
    file : Path
        The SVG file.
    width_mm : float, optional
        Width to which the page is scaled; otherwise it is as wide as it says.
    pixel_mm : float
        Pitch of the map.
    period_um : float
        Where neither ``data-period-um`` nor ``data-lines-per-mm`` tells it.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Of the page's shape; ends and corners of strokes are round.

    Raises
    ------
    InputError, InputErrors
        The file is missing, no SVG or without a shape, a shape tells no orientation, or the map is too large to draw.
    """
    common = {"depth_um": depth_um, "amplitude_ratio": amplitude_ratio, "ground_reflectance": ground_reflectance}
    design = _readable(file=file, width_mm=width_mm, pixel_mm=pixel_mm, period_um=period_um, **common)
    columns, rows = (max(1, round(side / pixel_mm)) for side in (design.width_mm, design.height_mm))
    drawing = Drawing(columns, pixel_mm, rows)
    for shape in design.shapes:
        _paint(drawing, shape, period_um)
    if not np.isfinite(drawing.orientation_rad).any():
        raise InputError("no shape covers a point of the map", where=str(file), expected="shapes on the page")
    return drawn_sample(
        drawing,
        file.stem,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        phase_deg=phase_deg,
        retardation_deg=retardation_deg,
        film_axis_deg=film_axis_deg,
        ground_reflectance=ground_reflectance,
    )


def _paint(drawing: Drawing, shape: Shape, period_um: float) -> None:
    if shape.width_mm is None:
        window = drawing.window(*bounds(shape.contours_mm))
        inside = filled(shape.contours_mm, window, even_odd=shape.even_odd)
        direction = np.zeros(inside.shape)
    else:
        window, inside, direction = band(shape.contours_mm, shape.width_mm, drawing)
    period = shape.period_um or period_um
    if shape.orientation is None:
        drawing.paint(window, inside, np.nan, np.nan)
    elif shape.orientation == "radial":
        left, low, right, high = bounds(shape.contours_mm)
        drawing.paint(window, inside, azimuth(((left + right) / 2, (low + high) / 2)), period)
    elif isinstance(shape.orientation, float):
        drawing.paint(window, inside, shape.orientation, period)
    else:
        turned = direction[inside] + (np.pi / 2 if shape.orientation == "across" else 0.0)
        drawing.paint(window, inside, lambda _x, _y: turned, period)


_foresee_vector_design = foreseen


def _readable(
    *,
    file: Path,
    width_mm: float | None,
    pixel_mm: float,
    period_um: float,
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
    **_: object,
) -> VectorDesign:
    """The design, where it and its settings can be drawn."""
    refuse(above_zero(width_mm=width_mm, pixel_mm=pixel_mm, period_um=period_um))
    design = read_vector_file(file, width_mm=width_mm, step_mm=2 * pixel_mm)
    refuse(
        undrawable(
            width_mm=max(design.width_mm, design.height_mm),
            margin_mm=0.0,
            pixel_mm=pixel_mm,
            depth_um=depth_um,
            amplitude_ratio=amplitude_ratio,
            ground_reflectance=ground_reflectance,
        )
    )
    return design


def _check_vector_design(
    *,
    file: Path,
    width_mm: float | None,
    pixel_mm: float,
    period_um: float,
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
    **_: object,
) -> None:
    """Read the file before anything runs."""
    _readable(
        file=file,
        width_mm=width_mm,
        pixel_mm=pixel_mm,
        period_um=period_um,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
