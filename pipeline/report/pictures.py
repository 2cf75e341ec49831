"""Photographs and colour pictures, laid out in rows with their angles and lights."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import PictureSeries
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import animated_webp_uri, webp_uri
from pipeline.report.maps import marked
from pipeline.report.shades import reduced
from pipeline.report.svg import Svg, curve

PHOTO_PIXELS = 360
PICTURE_PIXELS = 480
ABREAST = 6
"""Pictures in a row where rows are compared."""


@dataclass(frozen=True)
class Figure:
    """An element of the page with its title in a word, and its caption; a wide one takes the whole width."""

    title: str
    body: Markup
    caption: str
    wide: bool = False


def photos(value: PolarizerSequence) -> list[Figure]:
    """The photographs by angle, their means, and which pixels count."""
    order = np.argsort(value.polarizer_rad, kind="stable")
    angles = np.rad2deg(value.polarizer_rad)[order].tolist()
    images = [value.images[k] for k in order]
    white = _white(value.images[:, ::5, ::5])
    kept = value.valid if value.valid.any() else np.ones_like(value.valid)
    means = [float(np.mean(image, where=kept)) for image in images]
    cells = [
        _cell(encode_srgb(reduced(image, most=PHOTO_PIXELS) / white), f"{angle:.4g}°", f"mean {mean:.4f}")
        for image, angle, mean in zip(images, angles, means, strict=True)
    ]
    rows, columns = value.valid.shape
    light = f" at {value.wavelength_nm:g} nm" if value.wavelength_nm else ""
    wide = f", {columns * value.pixel_mm:.3g} × {rows * value.pixel_mm:.3g} mm" if value.pixel_mm else ""
    left_out = 100 * (1 - float(np.mean(value.valid)))
    figures = [
        Figure(
            "photographs",
            Markup('<div class="sheet">{}</div>').format(Markup("").join(cells)),
            f"The {len(angles)} photographs{light} by the angle of the polariser, {columns} × {rows} pixels{wide}. "
            f"Encoded for a display; in all of them black is 0 and white {white:.3g} of the sensor's full scale.",
            wide=True,
        ),
        Figure(
            "means",
            curve(angles, means, "angle of the polariser (°)", "mean signal (full scale 1)", _places(angles)),
            "Mean of each photograph over the pixels that count.",
        ),
    ]
    if left_out > 0:
        mean = np.asarray(np.mean(value.images, axis=0, dtype=np.float32))
        figures.append(
            Figure(
                "pixels left out",
                marked(mean, value.valid, value.pixel_mm, white=white),
                f"Mean of the photographs; black is 0, white {white:.3g} of full scale. Tinted: the {left_out:.2f} "
                "percent of the pixels that are left out, being saturated, not a number, outside the photographer's "
                "mask, or moved in from outside the picture.",
            )
        )
    return figures


def pictures(value: PictureSeries) -> list[Figure]:
    """Every picture of one series."""
    if value.frames_per_second is not None:
        return [_film(value, value.frames_per_second)]
    shown, exposure = _exposed(value)
    cells = [
        Markup('<div class="cell"><span>{}</span>{}</div>').format(head, _picture(picture))
        for head, picture in zip(_heads(value), shown, strict=True)
    ]
    grid = Markup('<div class="sheet large">{}</div>').format(Markup("").join(cells))
    return [Figure("pictures", grid, f"{_sentence(value.caption)}{_lights(value, _size(value))} {exposure}", wide=True)]


def _film(value: PictureSeries, frames_per_second: float) -> Figure:
    shown, exposure = _exposed(value)
    moving = Markup('<img alt="The light moves" src="{}">').format(animated_webp_uri(shown, frames_per_second))
    rows, columns = value.rgb.shape[1:3]
    azimuth, elevation = direction(value.light_mm[0])
    caption = (
        f"{_sentence(value.caption)}{len(shown)} pictures of {columns} × {rows} pixels: the light is carried "
        f"around the sheet, from azimuth {azimuth:.0f}° on and {elevation:.0f}° above it. {exposure}"
    )
    return Figure(
        "animation", Markup('<div class="sheet large"><div class="cell">{}</div></div>').format(moving), caption
    )


def beside(series: Mapping[str, PictureSeries]) -> Figure:
    """Pictures of several nodes under the same lights: a row a node, a column a light."""
    shown = {name: _exposed(one) for name, one in series.items()}
    first = next(iter(series.values()))
    sizes = {name: _size(one) for name, one in series.items()}
    told = _size(first) if len(set(sizes.values())) == 1 else ", ".join(f"{n}: {size}" for n, size in sizes.items())
    parts = []
    heads = _heads(first)
    for start in range(0, len(heads), ABREAST):
        chosen = slice(start, start + ABREAST)
        count = len(heads[chosen])
        cells = [Markup('<span class="head">{}</span>').format(head) for head in heads[chosen]]
        for name, (row, exposure) in shown.items():
            said = f"{_sentence(series[name].caption)} {exposure}"
            cells.append(Markup('<p class="row"><b><a href="#node-{0}">{0}</a></b> {1}</p>').format(name, said))
            cells += [_picture(picture) for picture in row[chosen]]
        parts.append(Markup('<div class="compared" style="--count:{}">{}</div>').format(count, Markup("").join(cells)))
    return Figure(
        "pictures",
        Markup("").join(parts),
        f"{' and '.join(series)} beside each other: each row a node, each column a light.{_lights(first, told)}",
        wide=True,
    )


def direction(light_mm: NDArray[np.floating]) -> tuple[float, float]:
    """Azimuth, anticlockwise from +x, and elevation of a light above the sheet, in degrees."""
    x, y, z = (float(c) for c in light_mm)
    return float(np.rad2deg(np.arctan2(y, x))) + 0.0, float(np.rad2deg(np.arctan2(z, np.hypot(x, y))))


def _heads(value: PictureSeries) -> list[Markup]:
    """What stands over each picture: its light, or that all of them are on."""
    lights = [_light(light) for light in value.light_mm]
    return [Markup(", ").join(lights)] if value.together else lights


def _light(light_mm: NDArray[np.floating]) -> Markup:
    """Where a light stands: seen from above in a small disc whose middle is the zenith, and in degrees."""
    azimuth, elevation = direction(light_mm)
    disc = Svg(18, 18)
    disc.dot(9, 9, 8, "sky")
    away = 8 * np.cos(np.deg2rad(elevation))
    disc.dot(9 + away * np.cos(np.deg2rad(azimuth)), 9 - away * np.sin(np.deg2rad(azimuth)), 2.6, "lamp")
    words = f"azimuth {azimuth:.0f}°, elevation {elevation:.0f}°".replace("-", "−")
    return Markup('{}<span title="{}">{:.0f}°, {:.0f}° up</span>').format(
        disc.markup(words, "where"), words, azimuth, elevation
    )


def _size(value: PictureSeries) -> str:
    rows, columns = value.rgb.shape[1:3]
    wide = f" ({columns * value.pixel_mm:.3g} × {rows * value.pixel_mm:.3g} mm)" if value.pixel_mm else ""
    return f"{columns} × {rows} pixels{wide}"


def _lights(value: PictureSeries, size: str) -> str:
    distances = np.linalg.norm(value.light_mm, axis=1)
    near, far = float(distances.min(initial=np.inf)), float(distances.max(initial=0))
    away = f"{far:.0f} mm" if far - near < 1 else f"{near:.0f} to {far:.0f} mm"
    return (
        f" The light is named by azimuth (anticlockwise from +x) and elevation above the sheet, {away} from its "
        f"middle; {size}, sRGB."
    )


def _exposed(value: PictureSeries) -> tuple[list[NDArray[np.float32]], str]:
    """Pictures for a display, and by how much they were brightened; one exposure for all of a series."""
    white = _white(value.rgb[:, ::3, ::3].max(axis=-1)) if value.rgb.size else 1.0
    if 0.35 <= white <= 1.5:
        white = 1.0
    shown = [encode_srgb(reduced(rgb, most=PICTURE_PIXELS) / white) for rgb in value.rgb]
    brightened = "" if white == 1 else f"Shown at {1 / white:.3g} times the exposure. "
    return shown, f"{brightened}Black is 0, white {white:.3g}."


def _white(signal: NDArray[np.floating]) -> float:
    known = signal[np.isfinite(signal)]
    white = float(np.percentile(known, 99.8)) if known.size else 1.0
    return white if white > 0 else 1.0


def _picture(shown: NDArray[np.floating]) -> Markup:
    return Markup('<img alt="" src="{}">').format(webp_uri(shown))


def _cell(shown: NDArray[np.floating], over: str, under: str) -> Markup:
    return Markup('<div class="cell"><span><b>{}</b> <i>{}</i></span>{}</div>').format(over, under, _picture(shown))


def _places(angles: list[float]) -> list[float]:
    span = max(angles) - min(angles)
    step = next((s for s in (15.0, 30.0, 45.0, 90.0) if span / s <= 9), 90.0)
    return [i * step for i in range(int(np.ceil(min(angles) / step)), int(max(angles) // step) + 1)]


def _sentence(words: str) -> str:
    return words if not words or words.endswith(".") else f"{words}."
