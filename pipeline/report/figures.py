"""Figures of a value, chosen by its type: axes in mm, units, colour bars, captions."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from pipeline.data import (
    GratingSample,
    Metrics,
    OrientationError,
    OrientationMap,
    PeriodMap,
    PictureSeries,
    PolarizerSequence,
)
from pipeline.optics.colour import encode_srgb
from pipeline.report.shades import orientation_colours, reduced, wheel_colours

DPI = 110
STYLE = {"font.size": 8.5, "axes.titlesize": 9, "axes.spines.top": False, "axes.spines.right": False}


@dataclass(frozen=True)
class Picture:
    """A figure as PNG, with its caption."""

    png: bytes
    caption: str
    wide: bool = False


def figures_of(value: object) -> list[Picture]:
    """All figures of a value."""
    import matplotlib as mpl

    draw = DRAWN.get(type(value), _anything)
    with mpl.rc_context(STYLE):
        return draw(value)


def beside(series: Sequence[PictureSeries]) -> Picture:
    """Pictures of the same lights side by side: a row a series, a column a light."""
    import matplotlib as mpl

    with mpl.rc_context(STYLE):
        lights = series[0].light_mm
        figure = Figure(figsize=(1.75 * len(lights), 1.95 * len(series) + 0.25), layout="constrained")
        axes = np.atleast_2d(figure.subplots(len(series), len(lights), squeeze=False))
        for index, (row, one) in enumerate(zip(axes, series, strict=True)):
            for ax, rgb, light in zip(row, one.rgb, lights, strict=True):
                ax.imshow(encode_srgb(reduced(rgb)[0]), interpolation="nearest")
                ax.set(xticks=[], yticks=[])
                for spine in ax.spines.values():
                    spine.set_visible(False)
                if index == 0:
                    ax.set_title(direction(light))
            row[0].set_ylabel(one.caption.split()[0].rstrip(":,"))
        rows = "; ".join(f"row {i + 1}: {one.caption[:1].lower()}{one.caption[1:]}" for i, one in enumerate(series))
        return Picture(
            _png(figure),
            f"The sheet under a light at each of {len(lights)} places, named by azimuth (anticlockwise from +x) and "
            f"elevation; {rows}. sRGB, one exposure a row.",
            wide=True,
        )


def direction(light_mm: NDArray[np.floating]) -> str:
    """Azimuth and elevation of a light in words."""
    x, y, z = (float(c) for c in light_mm)
    return f"{np.rad2deg(np.arctan2(y, x)):.0f}°, {np.rad2deg(np.arctan2(z, np.hypot(x, y))):.0f}° up"


def _orientation_map(value: OrientationMap) -> list[Picture]:
    known = "absolute" if value.absolute else "known up to one offset, the same everywhere"
    figure, (left, right) = _pair()
    least = float(np.percentile(value.correlation[value.mask], 1)) if value.mask.any() else 0.0
    _map(left, value.correlation, value.pixel_mm, "correlation", cmap="viridis", low=least, high=1.0)
    right.hist(value.correlation[value.mask], bins=80, color="#3b6ea5")
    right.set(xlabel="correlation of the fit", ylabel="pixels", yscale="log")
    return [
        Picture(
            _orientation_png(value.orientation_rad, value.pixel_mm),
            f"Orientation of the grating's tangent, {known}. Hue by the wheel, in degrees anticlockwise from +x; "
            f"masked pixels grey ({100 * (1 - value.mask.mean()):.1f} percent). {_size(value.mask)}",
        ),
        Picture(
            _png(figure),
            f"Correlation of the fit with the photographs: map and histogram over the {int(value.mask.sum())} pixels "
            f"of the mask, mean {_mean(value.correlation):.4f}.",
        ),
    ]


def _period_map(value: PeriodMap) -> list[Picture]:
    figure, (left, right) = _pair()
    _map(left, value.period_um, value.pixel_mm, "period (µm)", cmap="cividis")
    right.hist(value.period_um[np.isfinite(value.period_um)], bins=120, color="#3b6ea5")
    right.set(xlabel="period (µm)", ylabel="pixels")
    kind = "relative to the longest, which was given" if value.relative else "absolute"
    return [Picture(_png(figure), f"Grating period, {kind}: map and histogram. {_size(value.mask)}")]


def _sample(value: GratingSample) -> list[Picture]:
    figure = Figure(figsize=(4.6, 3.6), layout="constrained")
    _map(figure.subplots(), value.period_um, value.pixel_mm, "period (µm)", cmap="cividis")
    given = (
        f"R = {value.amplitude_ratio:g} exp(i {np.rad2deg(value.phase_rad):g}°), film "
        f"{np.rad2deg(value.retardation_rad):g}°, depth {value.depth_um:g} µm"
    )
    return [
        Picture(
            _orientation_png(value.orientation_rad, value.pixel_mm),
            f"The truth, as drawn: orientation of the grating's tangent in the {value.name}; ground grey. "
            f"{_size(value.orientation_rad)}",
        ),
        Picture(_png(figure), f"The truth, as drawn: grating period. {given}."),
    ]


def _photos(value: PolarizerSequence) -> list[Picture]:
    count = len(value.images)
    columns = min(count, 6)
    rows = -(-count // columns)
    figure = Figure(figsize=(1.6 * columns, 1.8 * rows), layout="constrained")
    level = float(np.nanpercentile(value.images[:, ::7, ::7], 99.7)) or 1.0
    axes = np.atleast_1d(figure.subplots(rows, columns, squeeze=False)).ravel()
    for ax in axes:
        ax.axis("off")
    for ax, image, angle in zip(axes, value.images, value.polarizer_rad, strict=False):
        ax.imshow(encode_srgb(reduced(image)[0] / level), cmap="gray", vmin=0, vmax=1, interpolation="nearest")
        ax.set_title(f"{np.rad2deg(angle):.4g}°")
    curve = Figure(figsize=(4.6, 2.4), layout="constrained")
    ax = curve.subplots()
    means = [float(np.mean(image, where=value.valid)) for image in value.images] if value.valid.any() else [0.0] * count
    ax.plot(np.rad2deg(value.polarizer_rad), means, "o-", color="#3b6ea5", lw=1, ms=4)
    ax.set(xlabel="polariser (°)", ylabel="mean brightness (full scale 1)", ylim=(0, None))
    left_out = 100 * (1 - value.valid.mean())
    light = f" at {value.wavelength_nm:g} nm" if value.wavelength_nm else ""
    return [
        Picture(
            _png(figure),
            f"The {count} photographs{light}, by the angle of the polariser; white is {level:.3g} of full scale. "
            f"{_size(value.valid)}",
            wide=True,
        ),
        Picture(
            _png(curve),
            f"Mean brightness of each photograph. {left_out:.2f} percent of the pixels are left out: saturated, no "
            "number, outside the mask, or moved in from outside.",
        ),
    ]


def _error(value: OrientationError) -> list[Picture]:
    error = np.rad2deg(value.error_rad)
    known = np.abs(error[np.isfinite(error)])
    limit = max(float(np.percentile(known, 98)), 0.1) if known.size else 1.0
    figure, (left, right) = _pair()
    _map(left, error, None, "error (°)", cmap="RdBu_r", low=-limit, high=limit)
    right.hist(np.clip(error[np.isfinite(error)], -limit, limit), bins=101, color="#3b6ea5")
    right.set(xlabel="error (°)", ylabel="pixels", yscale="log")
    return [
        Picture(
            _png(figure),
            f"Estimate minus truth, after one offset of {np.rad2deg(value.offset_rad):.2f}° was removed from every "
            f"pixel; colours end at the 98th percentile, ±{limit:.2g}°. Axes in pixels.",
        )
    ]


def _pictures(value: PictureSeries) -> list[Picture]:
    return [beside([value])]


def _metrics(_: Metrics) -> list[Picture]:
    return []


def _anything(value: Any) -> list[Picture]:
    """Two-dimensional arrays of a type that is not known here, as plain maps."""
    found = []
    for f in fields(value):
        array = getattr(value, f.name)
        if isinstance(array, np.ndarray) and array.ndim == 2 and array.dtype.kind in "fiub":
            figure = Figure(figsize=(4.6, 3.6), layout="constrained")
            _map(figure.subplots(), array.astype(np.float32), None, f.name, cmap="viridis")
            found.append(Picture(_png(figure), f"{f.name}. {_size(array)}"))
    return found


DRAWN: dict[type, Callable[[Any], list[Picture]]] = {
    GratingSample: _sample,
    PolarizerSequence: _photos,
    OrientationMap: _orientation_map,
    PeriodMap: _period_map,
    OrientationError: _error,
    PictureSeries: _pictures,
    Metrics: _metrics,
}


def _orientation_png(orientation_rad: NDArray[np.floating], pixel_mm: float | None) -> bytes:
    figure = Figure(figsize=(5.6, 4.0), layout="constrained")
    ax, side = figure.subplots(1, 2, width_ratios=[3.6, 1])
    small, factor = reduced(orientation_rad, axial=True)
    ax.imshow(orientation_colours(small), interpolation="nearest", extent=_extent(small.shape, pixel_mm, factor))
    _axes_in_mm(ax, pixel_mm)
    side.imshow(wheel_colours(220), extent=(-1, 1, -1, 1))
    side.set(xlim=(-1.6, 1.6), ylim=(-1.6, 1.6))
    side.axis("off")
    for angle in range(0, 360, 45):
        x, y = 1.32 * np.cos(np.deg2rad(angle)), 1.32 * np.sin(np.deg2rad(angle))
        side.text(x, y, f"{angle % 180}°", ha="center", va="center", fontsize=7.5)
    return _png(figure)


def _pair() -> tuple[Figure, Any]:
    figure = Figure(figsize=(7.6, 3.4), layout="constrained")
    return figure, figure.subplots(1, 2, width_ratios=[1.25, 1])


def _map(
    ax: Any,
    values: NDArray[np.floating],
    pixel_mm: float | None,
    label: str,
    *,
    cmap: str,
    low: float | None = None,
    high: float | None = None,
) -> None:
    import matplotlib as mpl

    small, factor = reduced(values)
    colours = mpl.colormaps[cmap].with_extremes(bad="0.12")
    extent = _extent(small.shape, pixel_mm, factor)
    image = ax.imshow(small, cmap=colours, vmin=low, vmax=high, interpolation="nearest", extent=extent)
    _axes_in_mm(ax, pixel_mm)
    ax.figure.colorbar(image, ax=ax, label=label, shrink=0.85)


def _extent(shape: tuple[int, ...], pixel_mm: float | None, factor: int) -> tuple[float, float, float, float]:
    rows, columns = shape[0] * factor, shape[1] * factor
    if pixel_mm is None:
        return (0, columns, rows, 0)
    return (-columns / 2 * pixel_mm, columns / 2 * pixel_mm, -rows / 2 * pixel_mm, rows / 2 * pixel_mm)


def _axes_in_mm(ax: Any, pixel_mm: float | None) -> None:
    ax.set(xlabel="x (mm)" if pixel_mm else "column (px)", ylabel="y (mm)" if pixel_mm else "row (px)")


def _size(array: NDArray[Any]) -> str:
    factor = int(reduced(np.zeros(array.shape, np.float32))[1]) if max(array.shape) else 1
    shown = f", shown averaged over {factor} x {factor}" if factor > 1 else ""
    return f"{array.shape[0]} x {array.shape[1]} pixels{shown}."


def _mean(values: NDArray[np.floating]) -> float:
    return float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")


def _png(figure: Figure) -> bytes:
    FigureCanvasAgg(figure)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, pil_kwargs={"compress_level": 6})
    return buffer.getvalue()
