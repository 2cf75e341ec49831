"""Print layouts: how they look, and the files that a printer takes."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.printing import PrintLayout
from pipeline.report.maps import map_with_bar, orientation_map, size_of, spread
from pipeline.report.naming import plain
from pipeline.report.pictures import Figure

HEADER = "row,column,x_mm,y_mm,orientation_deg,lines_per_mm"


def print_layouts(value: PrintLayout) -> list[Figure]:
    """Orientation and line density of the dots."""
    shape = value.orientation_deg.shape
    pitch = f"Dots {plain(1000 * value.dot_mm)} µm apart"
    return [
        Figure(
            "orientation",
            orientation_map(np.deg2rad(value.orientation_deg), value.dot_mm),
            f"{pitch}; hue by the wheel: in which direction each diffracts, degrees anticlockwise from +x; grey: none. "
            f"{size_of(shape, axial=True)}",
        ),
        Figure(
            "line density",
            map_with_bar(value.lines_per_mm, value.dot_mm, spread(value.lines_per_mm, "lines per mm")),
            f"{pitch}; grey: none. {size_of(shape)}",
        ),
    ]


def dots_csv(value: PrintLayout) -> str:
    """A row for each dot: where it lies on the grid, and in mm from its middle, x right and y up; its grating."""
    rows, columns = np.nonzero(np.isfinite(value.orientation_deg))
    height, width = value.orientation_deg.shape
    x = (columns + 0.5 - width / 2) * value.dot_mm
    y = (height / 2 - rows - 0.5) * value.dot_mm
    angle, density = value.orientation_deg[rows, columns], value.lines_per_mm[rows, columns]
    table = zip(rows.tolist(), columns.tolist(), x.tolist(), y.tolist(), angle.tolist(), density.tolist(), strict=True)
    lines = (f"{r},{c},{a:.6g},{b:.6g},{d:.6g},{n:.6g}" for r, c, a, b, d, n in table)
    return "\n".join([HEADER, *lines, ""])


def tiff(values: NDArray[np.float32], dot_mm: float) -> bytes:
    """A picture of floating-point numbers, NaN where there is no dot, that states its pitch as dots per cm."""
    centimetres, density = 3, round(10 / dot_mm)
    settings = [cv2.IMWRITE_TIFF_RESUNIT, centimetres, cv2.IMWRITE_TIFF_XDPI, density, cv2.IMWRITE_TIFF_YDPI, density]
    _, encoded = cv2.imencode(".tif", values, settings)
    return encoded.tobytes()
