"""Defects of an item: numbered on its maps, and listed."""

from __future__ import annotations

import csv
import io

import numpy as np
from markupsafe import Markup
from scipy import ndimage

from pipeline.data.inspection import Defects, Inspection
from pipeline.report.maps import Mark, Scale, map_with_bar, orientation_map, size_of
from pipeline.report.pictures import Figure

MARGIN_MM = 0.12
"""Between a defect and its box."""

COLUMNS = ("number", "kind", "x_mm", "y_mm", "area_mm2", "width_mm", "turn_deg", "period_ratio", "significance")
HEADS = ("", "Kind", "x (mm)", "y (mm)", "Area (mm²)", "Width (mm)", "Turn (°)", "Period ratio", "Significance")
DIGITS = (".0f", "", ".3f", ".3f", ".4f", ".3f", ".2f", ".4f", ".1f")


def inspection(value: Inspection, _: float | None) -> list[Figure]:
    """The item with its defects in boxes, how significantly it differs where, and the list."""
    shape, marks, pixel_mm = value.significance.shape, _marks(value.defects), value.defects.pixel_mm
    count = len(value.defects.kind)
    boxes = f"{count} numbered boxes: the defects" if count else "No defects were found"
    known = value.significance[np.isfinite(value.significance)]
    most = max(2 * value.threshold, 10.0)
    beyond = 100 * float(np.mean(known > value.threshold)) if known.size else 0.0
    return [
        Figure(
            "defects",
            orientation_map(value.suspect.orientation_rad, pixel_mm, marks),
            f"The suspect's orientations, brought onto the reference: moved by ({value.shift_mm[0]:.3f}, "
            f"{value.shift_mm[1]:.3f}) mm, turned by {np.rad2deg(value.turn_rad):.3f}°, and freed of an offset of "
            f"{np.rad2deg(value.offset_rad):.3f}°. {boxes}. Grey: no grating, or not in the photograph. "
            f"{size_of(shape, axial=True)}",
        ),
        Figure(
            "significance",
            map_with_bar(
                value.significance, pixel_mm, Scale("significance (σ)", 0.0, most, "viridis", log=True), marks
            ),
            "How far each place differs from the reference, in standard deviations of the noise, at the scale at which "
            f"it differs most. Noise is not expected to reach {value.threshold:.1f}; {beyond:.2g} percent lie beyond. "
            f"Colours end at {most:.0f}. Grey: not judged, as along the edges of facets. {size_of(shape)}",
        ),
        *([_table(value.defects, "Defects found, the most significant first.")] if count else []),
    ]


def drawn(value: Defects, _: float | None) -> list[Figure]:
    """The list of defects that are known."""
    return [_table(value, "Truth: defects as drawn.")] if value.kind else []


def csv_of(value: Defects) -> str:
    """One line a defect."""
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(COLUMNS)
    rows.writerows(
        [cell if isinstance(cell, str) else "" if np.isnan(cell) else f"{cell:.9g}" for cell in row]
        for row in _rows(value)
    )
    return text.getvalue()


def _rows(value: Defects) -> list[tuple[float | str, ...]]:
    return [
        (
            index + 1,
            kind,
            *value.centre_mm[index].tolist(),
            float(value.area_mm2[index]),
            float(value.width_mm[index]),
            float(np.rad2deg(value.turn_rad[index])),
            float(value.period_ratio[index]),
            float(value.significance[index]),
        )
        for index, kind in enumerate(value.kind)
    ]


def _table(value: Defects, said: str) -> Figure:
    cells = [
        [word if isinstance(word, str) else _number(word, digits) for word, digits in zip(row, DIGITS, strict=True)]
        for row in _rows(value)
    ]
    head = Markup("").join(
        Markup("<th{}>{}</th>").format(Markup(' class="n"') if i != 1 else "", name) for i, name in enumerate(HEADS)
    )
    body = Markup("").join(
        Markup("<tr>{}</tr>").format(
            Markup("").join(
                Markup("<td{}>{}</td>").format(Markup(' class="n"') if i != 1 else "", word)
                for i, word in enumerate(row)
            )
        )
        for row in cells
    )
    return Figure(
        "list",
        Markup('<div class="scroll"><table><thead><tr>{}</tr></thead><tbody>{}</tbody></table></div>').format(
            head, body
        ),
        f"{said} Centre and size in the frame of the reference, origin at the centre of the map; width is the largest. "
        "Turn, anticlockwise, and the ratio of the period to the reference's are left out where there is no grating.",
        wide=True,
    )


def _number(value: float, digits: str) -> str:
    return "–" if np.isnan(value) else f"{value:{digits}}".replace("-", "−")


def _marks(value: Defects) -> list[Mark]:
    """A box around each defect, in mm."""
    rows, columns = value.labels.shape
    marks = []
    for index, window in enumerate(ndimage.find_objects(value.labels, len(value.kind))):
        down, right = window
        marks.append(
            Mark(
                str(index + 1),
                (right.start - columns / 2) * value.pixel_mm - MARGIN_MM,
                (right.stop - columns / 2) * value.pixel_mm + MARGIN_MM,
                (rows / 2 - down.stop) * value.pixel_mm - MARGIN_MM,
                (rows / 2 - down.start) * value.pixel_mm + MARGIN_MM,
            )
        )
    return marks
