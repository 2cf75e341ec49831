"""Photographs under a flash: brackets as they were taken, radiance, the response curve, and the tiles of the sheet."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.flash import FlashBrackets, FlashPhotographs, Tiles
from pipeline.optics.colour import encode_srgb
from pipeline.optics.tile_alignment import corners_of
from pipeline.report.encoded import webp_uri
from pipeline.report.pictures import PICTURE_PIXELS, Figure
from pipeline.report.shades import reduced
from pipeline.report.svg import Axes, Svg

_WHITE_PERCENTILE = 99.0
"""So that the highlight, which is hundreds of times as bright, does not darken the rest."""
_DARKEST_SHOWN = 4
"""Level below which a response curve says nothing."""

Picture = NDArray[np.floating]


def brackets(value: FlashBrackets) -> list[Figure]:
    """Every photograph as the camera stored it: a row for each place of the flash, a column for each exposure."""
    full = float(np.iinfo(value.images.dtype).max)
    cells = [Markup('<span class="head">{}</span>').format(f"{time:.4g} s") for time in value.exposure_s]
    for index, row in enumerate(value.images):
        cells.append(Markup('<p class="row"><b>{}</b></p>').format(_place(index, value.light_mm[index])))
        cells += [_img(_shown(picture / full, linear=value.linear)) for picture in row]
    count = len(value.exposure_s)
    grid = Markup('<div class="compared" style="--count:{}">{}</div>').format(count, Markup("").join(cells))
    rows, columns = value.images.shape[2:4]
    stored = "raw, encoded here for a display" if value.linear else "as the camera stored them"
    figures = [
        Figure(
            "photographs",
            grid,
            f"{len(value.images)} places of the flash, x right, y up, z towards the camera; {count} exposures each. "
            f"{columns} × {rows} pixels, {stored}.{_filter(value)}",
            wide=True,
        )
    ]
    if value.room is not None:
        shown = _shown(value.room / float(np.iinfo(value.room.dtype).max), linear=value.linear)
        figures.append(Figure("room light", _alone(shown), "The same under the lamps of the room, the flash off."))
    return figures


def flash_pictures(value: FlashPhotographs) -> list[Figure]:
    """Radiance under each place of the flash, the photograph under room light, and the camera's response."""
    bright = value.radiance[:, ::3, ::3].max(axis=-1)
    white = float(np.percentile(bright, _WHITE_PERCENTILE)) or 1.0
    cells = [
        Markup('<div class="cell"><span>{}</span>{}</div>').format(
            _place(index, value.light_mm[index]), _img(_shown(picture / white, linear=True))
        )
        for index, picture in enumerate(value.radiance)
    ]
    rows, columns = value.radiance.shape[1:3]
    pitch = f" of {value.pixel_mm:.3g} mm; row 0 at the largest y" if value.pixel_mm else "; not rectified"
    peak = float(value.radiance.max())
    figures = [
        Figure(
            "radiance",
            Markup('<div class="sheet few">{}</div>').format(Markup("").join(cells)),
            f"{columns} × {rows} pixels{pitch}. Black is 0, white {white:.3g} of what fills the sensor in the shortest "
            f"exposure; the highlight reaches {peak:.3g}.{_filter(value)}",
            wide=True,
        )
    ]
    if value.room is not None:
        figures.append(Figure("room light", _alone(_shown(value.room, linear=True)), "Under the lamps of the room."))
    if value.response is not None:
        said = (
            "Natural logarithm of the exposure, light times seconds, that makes each level of red, green and blue, "
            "found from the brackets after Debevec and Malik; 0 at level 128."
        )
        figures.append(Figure("response", _response(value.response), said))
    return figures


def tiles(value: Tiles) -> list[Figure]:
    """Outlines of the tiles on the sheet, and their mean."""
    figures = [
        Figure(
            "tiles",
            _outlines(value),
            f"{len(value.homographies)} tiles of {value.shape[1]} × {value.shape[0]} pixels of {value.pixel_mm:.3g} mm "
            f"on the rectified sheet, each moved by at most {float(value.moved_px.max()):.2g} px from where it lies "
            f"beside its neighbours. Filled: the reference.",
        )
    ]
    if value.pattern is not None:
        said = "Mean of the edges of all tiles under room light: sharp where they are aligned."
        figures.append(Figure("pattern", _alone(shown_pattern(value.pattern)), said))
    return figures


def shown_pattern(pattern: Picture) -> NDArray[np.float32]:
    """Edges as grey, the steepest white."""
    low, high = np.nanpercentile(pattern, [1, 99.5])
    return np.asarray(np.clip((np.nan_to_num(pattern) - low) / max(high - low, 1e-9), 0, 1), np.float32)


def tile_columns(value: Tiles) -> dict[str, NDArray[np.float64]]:
    """A table with a row for each tile: where the centres of its corner pixels lie, and how well it is aligned."""
    corners = np.stack([corners_of(homography, value.shape) for homography in value.homographies])
    names = ("top_left", "top_right", "bottom_right", "bottom_left")
    columns = {f"{name}_{axis}_px": corners[:, k, i] for k, name in enumerate(names) for i, axis in enumerate("xy")}
    aligned = {"moved_px": value.moved_px, "residual_px": value.residual_px, "correlation": value.correlation}
    return columns | {name: np.asarray(column, np.float64) for name, column in aligned.items()}


def _shown(picture: Picture, *, linear: bool) -> NDArray[np.float32]:
    small = reduced(np.asarray(picture, np.float32), most=PICTURE_PIXELS)
    return np.asarray(encode_srgb(np.nan_to_num(small)) if linear else small, np.float32)


def _img(shown: Picture) -> Markup:
    return Markup('<img alt="" src="{}">').format(webp_uri(shown))


def _alone(shown: Picture) -> Markup:
    return Markup('<img class="alone" alt="" src="{}">').format(webp_uri(shown))


def _place(index: int, light_mm: NDArray[np.floating]) -> str:
    if not np.isfinite(light_mm).all():
        return f"flash {index + 1}, somewhere"
    return f"flash {index + 1} at ({', '.join(f'{part:.0f}' for part in light_mm)}) mm".replace("-", "−")


def _filter(value: FlashBrackets | FlashPhotographs) -> str:
    if value.wavelength_nm is None:
        return ""
    width = "" if value.bandwidth_nm is None else f", {value.bandwidth_nm:g} nm wide"
    return f" Through a filter at {value.wavelength_nm:g} nm{width}."


def _response(response: NDArray[np.floating]) -> Markup:
    curve = np.log(np.maximum(response, 1e-12))[_DARKEST_SHOWN:]
    svg = Svg(440, 230)
    axes = Axes(svg, (62, 12, 362, 170), (0, 255), (float(curve.min()), float(curve.max())))
    axes.label_x("level")
    axes.label_y("ln exposure")
    axes.frame()
    for channel in curve.T.tolist():
        svg.path([axes.at(_DARKEST_SHOWN + level, value) for level, value in enumerate(channel)], "curve")
    return svg.markup("response curve of the camera")


def _outlines(value: Tiles) -> Markup:
    outlines = np.stack([corners_of(homography, value.shape) for homography in value.homographies])
    low, high = outlines.min(axis=(0, 1)), outlines.max(axis=(0, 1))
    wide, tall = (high - low).tolist()
    scale = 350.0 / max(wide, tall)
    svg = Svg(wide * scale + 74, tall * scale + 60)
    axes = Axes(
        svg, (62, 12, wide * scale, tall * scale), (float(low[0]), float(high[0])), (float(high[1]), float(low[1]))
    )
    axes.label_x("column (px)")
    axes.label_y("row (px)")
    for index, corners in enumerate(outlines.tolist()):
        points = [axes.at(x, y) for x, y in corners]
        svg.path(points, "bars" if index == value.reference else "frame", closed=True)
        x, y = (float(np.mean(part)) for part in zip(*points, strict=True))
        svg.dot(x, y, 2, title=f"{value.residual_px[index]:.2g} px beside the reference")
    return svg.markup("tiles on the sheet")
