"""Figures of a value, chosen by its type: axes in mm, units, colour bars, captions that say what is seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.diffraction import BrdfMap, DiffractionPeaks, SlitPatterns
from pipeline.data.flash import FlashBrackets, FlashPhotographs, Tiles
from pipeline.data.flash_maps import GratingDistribution, Highlights
from pipeline.data.gratings import GratingSample, OrientationError, OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.data.inspection import Defects, Inspection
from pipeline.data.light_probes import LightProbe
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import Pictures, PictureSeries
from pipeline.data.polarization import LineDeviation, PolarizerResponse
from pipeline.data.printing import PrintLayout
from pipeline.optics.colour import encode_srgb
from pipeline.report import flash, flash_maps
from pipeline.report.brdf_maps import brdf_maps
from pipeline.report.diffraction_peaks import diffraction_peaks
from pipeline.report.encoded import webp_uri
from pipeline.report.heights import heights, periods
from pipeline.report.inspections import drawn, inspection
from pipeline.report.labelled_pictures import labelled_pictures
from pipeline.report.light_probes import light_probe
from pipeline.report.maps import Scale, map_with_bar, marked, orientation_map, size_of, spread
from pipeline.report.naming import labelled
from pipeline.report.pictures import PICTURE_PIXELS, Figure, photos, pictures
from pipeline.report.print_layouts import print_layouts
from pipeline.report.response_curves import response_curves
from pipeline.report.responses import deviations, responses
from pipeline.report.shades import reduced
from pipeline.report.slit_patterns import slit_patterns

CLIPPED_AT = 99
"""Percentile of the error's size at which its colours end."""

HUES = "Hue by the wheel, in degrees anticlockwise from +x; grey: masked. In the wheel: how common each orientation is."


def figures_of(value: object, pixel_mm: float | None = None) -> list[Figure]:
    """All figures of a value; the pixel's size is used where the value does not know it."""
    return DRAWN.get(type(value), _anything)(value, getattr(value, "pixel_mm", None) or pixel_mm)


def _orientation(value: OrientationMap, pixel_mm: float | None) -> list[Figure]:
    known = (
        "absolute" if value.absolute else "known up to one offset, the same everywhere, which polarisation leaves open"
    )
    correlation = value.correlation[value.mask & np.isfinite(value.correlation)]
    bright = value.intensity[np.isfinite(value.intensity)]
    return [
        Figure(
            "orientation",
            orientation_map(value.orientation_rad, pixel_mm),
            f"Orientation of the grating's tangent, the direction in which it diffracts; {known}. {HUES} "
            f"{size_of(value.mask.shape, axial=True)}",
        ),
        *_standard_error(value, pixel_mm),
        *response_curves(value),
        *([_correlation(value, correlation, pixel_mm)] if correlation.size else []),
        *([_mask(value, bright, pixel_mm)] if bright.size else []),
    ]


def _mask(value: OrientationMap, known: NDArray[Any], pixel_mm: float | None) -> Figure:
    white = float(np.percentile(known, 99.8)) or 1.0
    masked = 100 * (1 - float(np.mean(value.mask)))
    return Figure(
        "mask",
        marked(value.intensity, value.mask, pixel_mm, white=white),
        f"Mean over the photographs, encoded for a display; black is 0, white {white:.3g} of full scale. Tinted: "
        f"the {masked:.1f} percent of the pixels that the mask leaves out. {size_of(value.mask.shape)}",
    )


def _standard_error(value: OrientationMap, pixel_mm: float | None) -> list[Figure]:
    if value.standard_error_rad is None or not np.isfinite(value.standard_error_rad).any():
        return []
    degrees = np.rad2deg(value.standard_error_rad)
    scale = spread(degrees, "standard error (°)", 1)
    return [
        Figure(
            "standard error",
            map_with_bar(degrees, pixel_mm, scale),
            f"What the fit states for the orientation of each pixel, median {float(np.nanmedian(degrees)):.3g}°; grey: "
            f"masked. {_ends(degrees, scale)}{size_of(value.mask.shape)}",
        )
    ]


def _correlation(value: OrientationMap, known: NDArray[Any], pixel_mm: float | None) -> Figure:
    low = min(float(np.percentile(known, 1)), 0.999)
    return Figure(
        "correlation",
        map_with_bar(value.correlation, pixel_mm, Scale("correlation", low, 1.0, "viridis", log=True)),
        f"Correlation of the fitted model with the photographs, mean {float(np.mean(known, dtype=np.float64)):.4f} "
        f"over {known.size} pixels; grey: masked. Colours and bars begin at the first percentile, {low:.4f}. "
        f"{size_of(value.mask.shape)}",
    )


def _period(value: PeriodMap, pixel_mm: float | None) -> list[Figure]:
    kind = "relative: the longest was given" if value.relative else "absolute"
    scale = spread(value.period_um, "period (µm)")
    return [
        Figure(
            "period",
            map_with_bar(value.period_um, pixel_mm, scale),
            f"Grating period, {kind}; grey: masked. {_ends(value.period_um, scale)}{size_of(value.period_um.shape)}",
        )
    ]


def _sample(value: GratingSample, pixel_mm: float | None) -> list[Figure]:
    scale = spread(value.period_um, "period (µm)")
    shape = value.orientation_rad.shape
    return [
        Figure(
            "orientation",
            orientation_map(value.orientation_rad, pixel_mm),
            f"Truth: orientation of the grating's tangent in the {value.name}, as drawn. {HUES} "
            f"{size_of(shape, axial=True)}",
        ),
        Figure(
            "period",
            map_with_bar(value.period_um, pixel_mm, scale),
            f"Truth: grating period, as drawn; grey: no grating. Profile {value.depth_um:g} µm deep; zeroth order "
            f"reflects s to p as {_range(value.amplitude_ratio)} exp(i {_range(np.rad2deg(value.phase_rad))}°); film "
            f"retards by {_range(np.rad2deg(value.retardation_rad))}° a pass along "
            f"{_range(np.rad2deg(value.film_axis_rad))}°. {size_of(shape)}",
        ),
    ]


def _range(value: float | np.floating | NDArray[np.floating]) -> str:
    """A number, or the least and the largest of a map."""
    low, high = float(np.min(value)), float(np.max(value))
    return f"{low:.4g}" if low == high else f"({low:.4g} to {high:.4g})"


def _error(value: OrientationError, pixel_mm: float | None) -> list[Figure]:
    error = np.rad2deg(value.error_rad)
    known = np.abs(error[np.isfinite(error)])
    limit = max(float(np.percentile(known, CLIPPED_AT)), 0.01) if known.size else 1.0
    largest = f"the largest is {float(known.max()):.3g}°" if known.size else "none is known"
    return [
        Figure(
            "error",
            map_with_bar(error, pixel_mm, Scale("error (°)", -limit, limit, "diverging", log=True)),
            f"Estimate minus truth, anticlockwise positive. {_offset(value)} Grey: masked in either. Colours end at "
            f"±{limit:.3g}°, the {CLIPPED_AT}th percentile of the error's size; {largest}. {size_of(error.shape)}",
        )
    ]


def _offset(value: OrientationError) -> str:
    """What became of the turn between estimate and truth that all pixels share."""
    if value.offset_rad == 0:
        return "No offset was removed: the map is taken at its word."
    removed = float(np.rad2deg(value.offset_rad))
    return (
        f"One offset of {removed:.2f}° was removed from every pixel: by so much the map stands ahead of the truth, "
        f"which polarisation alone cannot know unless a film lies over the gratings. To make it absolute, "
        f"{-removed:.2f}° have to be added."
    )


def _anything(value: Any, pixel_mm: float | None) -> list[Figure]:
    """Maps and pictures among the fields of a type that is not known here, and a table of all fields."""
    if not is_dataclass(value):
        return [Figure("value", Markup("<pre>{}</pre>").format(repr(value)[:2000]), type(value).__name__)]
    found, rows = [], []
    for field in fields(value):
        content, name = getattr(value, field.name), labelled(field.name, 0)
        rows.append(Markup("<tr><td><code>{}</code></td><td>{}</td></tr>").format(field.name, _described(content)))
        if not isinstance(content, np.ndarray) or content.dtype.kind not in "fiub" or not content.size:
            continue
        if content.ndim == 2 and min(content.shape) > 1:
            numbers = content.astype(np.float32)
            scale = spread(numbers, f"{name.label} ({name.unit})" if name.unit else name.label)
            said = f"{name.label.capitalize()}. {_ends(numbers, scale)}{size_of(content.shape)}"
            found.append(Figure(name.label, map_with_bar(numbers, pixel_mm, scale), said))
        elif content.ndim == 3 and content.shape[2] == 3:
            shown = encode_srgb(reduced(content, most=PICTURE_PIXELS))
            body = Markup('<img class="alone" alt="{}" src="{}">').format(field.name, webp_uri(shown))
            size = size_of(content.shape, most=PICTURE_PIXELS)
            found.append(Figure(name.label, body, f"{name.label.capitalize()}, taken for linear sRGB. {size}"))
    table = Markup('<div class="scroll"><table>{}</table></div>').format(Markup("").join(rows))
    return [*found, Figure("fields", table, f"What the {type(value).__name__} holds.", wide=True)]


def _described(content: object) -> str:
    if not isinstance(content, np.ndarray):
        return repr(content)[:200]
    shape = " × ".join(str(n) for n in content.shape)
    known = _numbers(content)
    if not known.size:
        return f"{content.dtype}, {shape}"
    mean = float(np.mean(known, dtype=np.float64))
    return f"{content.dtype}, {shape}: {known.min():.4g} to {known.max():.4g}, mean {mean:.4g}"


def _numbers(content: NDArray[Any]) -> NDArray[Any]:
    if content.dtype.kind not in "fiub":
        return np.empty(0)
    return content[np.isfinite(content)]


def _ends(values: NDArray[np.floating], scale: Scale) -> str:
    """What lies beyond the colours, in words."""
    known = values[np.isfinite(values)]
    beyond = 100 * float(np.mean((known < scale.low) | (known > scale.high))) if known.size else 0.0
    return f"{beyond:.1f} percent lie beyond the colours. " if beyond >= 0.05 else ""


DRAWN: dict[type, Callable[[Any, float | None], list[Figure]]] = {
    GratingSample: _sample,
    PolarizerSequence: lambda value, _: photos(value),
    FlashBrackets: lambda value, _: flash.brackets(value),
    FlashPhotographs: lambda value, _: flash.flash_pictures(value),
    Tiles: lambda value, _: flash.tiles(value),
    Highlights: lambda value, _: flash_maps.highlights(value),
    GratingDistribution: lambda value, _: flash_maps.distribution(value),
    OrientationMap: _orientation,
    PeriodMap: _period,
    PrintLayout: lambda value, _: print_layouts(value),
    OrientationError: _error,
    PictureSeries: lambda value, _: pictures(value),
    BrdfMap: lambda value, _: brdf_maps(value),
    Pictures: lambda value, _: labelled_pictures(value),
    LightProbe: lambda value, _: light_probe(value),
    PolarizerResponse: lambda value, _: responses(value),
    LineDeviation: lambda value, _: deviations(value),
    Defects: drawn,
    Inspection: inspection,
    HeightField: lambda value, _: heights(value),
    Periodicity: lambda value, _: periods(value),
    DiffractionPeaks: lambda value, _: diffraction_peaks(value),
    SlitPatterns: lambda value, _: slit_patterns(value),
    Metrics: lambda *_: [],
}
