"""How each kind of value is written: EXR with named channels, PNG for the eye, CSV of columns."""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.diffraction import BrdfMap, DiffractionPeaks, SlitPatterns
from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.data.flash_maps import GratingDistribution
from pipeline.data.gratings import PARAMETER, GratingSample, OrientationError, OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.data.inspection import Defects, Inspection
from pipeline.data.light_probes import LightProbe
from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import Pictures, PictureSeries
from pipeline.data.polarization import LineDeviation, PolarizerResponse
from pipeline.data.printing import PrintLayout
from pipeline.optics.colour import encode_srgb
from pipeline.report.brdf_maps import exposed
from pipeline.report.diffraction_peaks import grating_angles
from pipeline.report.encoded import animated_webp, png, write_mp4
from pipeline.report.exr import write_exr
from pipeline.report.flash import shown_pattern, tile_columns
from pipeline.report.flash_maps import shown_distribution
from pipeline.report.inspections import csv_of
from pipeline.report.labelled_pictures import exposed_pictures
from pipeline.report.light_probes import exposed_probe
from pipeline.report.maps import Scale, spread
from pipeline.report.print_layouts import dots_csv, tiff
from pipeline.report.responses import shown_rows
from pipeline.report.shades import colours, orientation_colours, reduced
from pipeline.report.slit_patterns import strips
from pipeline.storage.files import write_bytes, write_text

SHEET_PIXELS = 400

Written = Iterator[Path]


def _orientation(stem: Path, value: OrientationMap) -> Written:
    channels = {
        "orientation_rad": value.orientation_rad,
        "correlation": value.correlation,
        "intensity": value.intensity,
        "mask": value.mask,
    }
    if value.standard_error_rad is not None:
        channels["standard_error_rad"] = value.standard_error_rad
    parameters = {f"{PARAMETER}{name}": number for name, number in value.parameters.items()}
    yield _exr(stem, channels, pixel_mm=value.pixel_mm, absolute=value.absolute, **parameters)
    yield _png(stem, orientation_colours(value.orientation_rad))


def _period(stem: Path, value: PeriodMap) -> Written:
    channels = {"period_um": value.period_um, "mask": value.mask}
    yield _exr(stem, channels, pixel_mm=value.pixel_mm, relative=value.relative)
    yield _png(stem, _coloured(value.period_um, spread(value.period_um, "period (µm)")))


def _sample(stem: Path, value: GratingSample) -> Written:
    every = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    channels = {name: member for name, member in every.items() if isinstance(member, np.ndarray)}
    numbers = {name: member for name, member in every.items() if isinstance(member, float)}
    yield _exr(stem, channels, **numbers, absolute=True, relative=False)


def _print_layout(stem: Path, value: PrintLayout) -> Written:
    """As a table, as pictures, and with the channels of maps."""
    angle, density = value.orientation_deg, value.lines_per_mm
    channels = {"orientation_rad": np.deg2rad(angle), "period_um": 1000 / density}
    yield _exr(stem, channels, pixel_mm=value.dot_mm, absolute=True, relative=False)
    path = stem.with_name(f"{stem.name}.csv")
    write_text(path, dots_csv(value))
    yield path
    for name, values in {"orientation_deg": angle, "lines_per_mm": density}.items():
        path = stem.with_name(f"{stem.name}_{name}.tif")
        write_bytes(path, tiff(values, value.dot_mm))
        yield path


def _error(stem: Path, value: OrientationError) -> Written:
    yield _exr(stem, {"error_rad": value.error_rad}, offset_rad=value.offset_rad)
    known = np.abs(value.error_rad[np.isfinite(value.error_rad)])
    limit = max(float(np.percentile(known, 99)), 1e-4) if known.size else 1.0
    yield _png(stem, _coloured(value.error_rad, Scale("error (rad)", -limit, limit, "diverging")))


def _pictures(stem: Path, value: PictureSeries) -> Written:
    if value.frames_per_second is not None:
        yield from _film(stem, value.rgb, value.frames_per_second)
        return
    for index, rgb in enumerate(value.rgb):
        one = stem.with_name(f"{stem.name}_{index}")
        yield _exr(one, {name: rgb[..., i] for i, name in enumerate("RGB")}, pixel_mm=value.pixel_mm)
        yield _png(one, encode_srgb(rgb))


def _film(stem: Path, rgb: NDArray[np.float32], frames_per_second: float) -> Written:
    frames = [encode_srgb(picture) for picture in rgb]
    write_bytes(stem.with_suffix(".webp"), animated_webp(frames, frames_per_second))
    yield stem.with_suffix(".webp")
    write_mp4(stem.with_suffix(".mp4"), frames, frames_per_second)
    yield stem.with_suffix(".mp4")


def _photos(stem: Path, value: PolarizerSequence) -> Written:
    """A contact sheet with the polariser's angle in each photograph; the photographs themselves can be exported."""
    known = value.images[:, ::5, ::5]
    known = known[np.isfinite(known)]
    white = (float(np.percentile(known, 99.8)) if known.size else 0.0) or 1.0
    cells = []
    for image, angle in zip(value.images, np.rad2deg(value.polarizer_rad), strict=True):
        shown = np.nan_to_num(encode_srgb(reduced(image, most=SHEET_PIXELS) / white))
        cell = cv2.copyMakeBorder(np.uint8(255 * shown), 26, 4, 4, 4, cv2.BORDER_CONSTANT, value=255)
        cv2.putText(cell, f"{angle:.4g} deg", (8, 19), cv2.FONT_HERSHEY_SIMPLEX, 0.5, (0,), 1, cv2.LINE_AA)
        cells.append(cell / np.float32(255))
    columns = min(len(cells), 4)
    cells += [np.ones_like(cells[0])] * (-len(cells) % columns)
    yield _png(stem, np.vstack([np.hstack(cells[i : i + columns]) for i in range(0, len(cells), columns)]))


def _flash(stem: Path, value: FlashPhotographs) -> Written:
    """Radiance of the rectified sheet under each place of the flash, and the photograph under room light."""
    if value.pixel_mm is None:
        return
    pictures = {f"{index}": radiance for index, radiance in enumerate(value.radiance)}
    if value.room is not None:
        pictures["room"] = value.room
    for name, linear in pictures.items():
        one = stem.with_name(f"{stem.name}_{name}")
        yield _exr(one, {channel: linear[..., i] for i, channel in enumerate("RGB")}, pixel_mm=value.pixel_mm)
        white = float(np.percentile(linear[::3, ::3].max(axis=-1), 99)) or 1.0
        yield _png(one, encode_srgb(linear / white))


def _distribution(stem: Path, value: GratingDistribution) -> Written:
    """A row an orientation and period."""
    angle, period = np.meshgrid(np.rad2deg(value.orientation_rad), value.period_um, indexing="ij")
    columns = {"orientation_deg": angle, "period_um": period, "share": value.share}
    yield _csv(stem, {name: column.ravel() for name, column in columns.items()})
    yield _png(stem, shown_distribution(value))


def _tiles(stem: Path, value: Tiles) -> Written:
    """A row for each tile: where the centres of its corner pixels lie, and how well it is aligned."""
    yield _csv(stem, tile_columns(value))
    if value.pattern is not None:
        yield _png(stem, shown_pattern(value.pattern))


def _response(stem: Path, value: PolarizerResponse) -> Written:
    """Orientations go up, as in the report."""
    yield _exr(stem, {"intensity": value.intensity[::-1]})
    yield _png(stem, _coloured(shown_rows(value), Scale("I norm", -1, 1)))


def _deviation(stem: Path, value: LineDeviation) -> Written:
    columns = {
        "orientation_deg": value.orientation_rad,
        "deviation_deg": value.deviation_rad,
        "prenormalized_deviation_deg": value.prenormalized_rad,
    }
    yield _csv(stem, {name: np.rad2deg(column) for name, column in columns.items()})


def _defects(stem: Path, value: Defects) -> Written:
    path = stem.with_name(f"{stem.name}.csv")
    write_text(path, csv_of(value))
    yield path


def _inspection(stem: Path, value: Inspection) -> Written:
    yield from _defects(stem, value.defects)
    channels = {"significance": value.significance, "defect": value.defects.labels.astype(np.float32)}
    yield _exr(stem, channels, pixel_mm=value.defects.pixel_mm)


def _brdf(stem: Path, value: BrdfMap) -> Written:
    shown, _ = exposed(value.rgb)
    for k, (light, linear, picture) in enumerate(zip(value.light.tolist(), value.rgb, shown, strict=True)):
        place = stem.with_name(f"{stem.name}_{k}")
        channels = {name: linear[..., i] for i, name in enumerate("RGB")}
        yield _exr(place, channels, **{f"light_{axis}": part for axis, part in zip("xyz", light, strict=True)})
        yield _png(place, picture)


def _labelled(stem: Path, value: Pictures) -> Written:
    shown, _ = exposed_pictures(value)
    for k, (linear, picture, label) in enumerate(zip(value.rgb, shown, value.labels, strict=True)):
        place = stem.with_name(f"{stem.name}_{k}")
        yield _exr(place, {name: linear[..., i] for i, name in enumerate("RGB")}, label=label)
        yield _png(place, picture)


def _probe(stem: Path, value: LightProbe) -> Written:
    yield _exr(stem, {name: value.rgb[..., i] for i, name in enumerate("RGB")})
    yield _png(stem, exposed_probe(value)[0])


def _heights(stem: Path, value: HeightField) -> Written:
    yield _exr(stem, {"height_um": value.height_um}, pitch_um=value.pitch_um, periodic=value.periodic)
    yield _png(stem, _coloured(value.height_um, spread(value.height_um, "height (µm)")))


def _periods(stem: Path, value: Periodicity) -> Written:
    yield _exr(
        stem, {"power_um2": value.power_um2}, step_x_per_um=value.step_per_um[0], step_y_per_um=value.step_per_um[1]
    )
    columns = {
        "period_um": value.period_um,
        "period_error_um": value.period_error_um,
        "direction_deg": np.rad2deg(value.direction_rad),
        "direction_error_deg": np.rad2deg(value.direction_error_rad),
        "rms_um": value.rms_um,
        "spread": value.spread,
        "contrast": value.contrast,
    }
    yield _csv(stem, columns)


def _diffraction_peaks(stem: Path, value: DiffractionPeaks) -> Written:
    view_deg = np.rad2deg(value.view_rad)
    yield _exr(
        stem,
        {"response": value.response},
        first_wavelength_nm=float(value.wavelength_nm[0]),
        last_wavelength_nm=float(value.wavelength_nm[-1]),
        first_view_deg=float(view_deg[0]),
        last_view_deg=float(view_deg[-1]),
        light_deg=float(np.rad2deg(value.light_rad)),
        azimuth_deg=float(np.rad2deg(value.azimuth_rad)),
    )
    columns = {
        "wavelength_nm": value.wavelength_nm,
        "peak_deg": np.rad2deg(value.peak_rad),
        "period_um": value.period_um,
        "grating_deg": np.rad2deg(grating_angles(value)),
    }
    yield _csv(stem, columns)


def _slits(stem: Path, value: SlitPatterns) -> Written:
    named = zip(value.slits.tolist(), value.intensity, strict=True)
    yield _csv(stem, {"position_mm": value.position_mm, **{f"intensity_{count}": line for count, line in named}})
    yield _exr(
        stem,
        {name: value.white_rgb[..., i] for i, name in enumerate("RGB")},
        first_position_mm=float(value.position_mm[0]),
        last_position_mm=float(value.position_mm[-1]),
        slits_of_rows=" ".join(map(str, value.slits.tolist())),
    )
    yield _png(stem, strips(value))


def _exr(stem: Path, channels: dict[str, NDArray[Any]], **attributes: float | str | None) -> Path:
    path = stem.with_name(f"{stem.name}.exr")
    write_exr(path, channels, attributes)
    return path


def _csv(stem: Path, columns: dict[str, NDArray[Any]]) -> Path:
    path = stem.with_name(f"{stem.name}.csv")
    table = io.StringIO()
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(columns)
    rows.writerows(np.stack(list(columns.values()), axis=1).tolist())
    write_text(path, table.getvalue())
    return path


def _png(stem: Path, rgb: NDArray[np.floating]) -> Path:
    path = stem.with_name(f"{stem.name}.png")
    write_bytes(path, png(rgb))
    return path


def _coloured(values: NDArray[np.floating], scale: Scale) -> NDArray[np.float32]:
    return colours(values, scale.low, scale.high, scale.shades)


WRITERS: dict[str, Callable[[Path, Any], Written]] = {
    PolarizerSequence.__name__: _photos,
    FlashPhotographs.__name__: _flash,
    Tiles.__name__: _tiles,
    GratingDistribution.__name__: _distribution,
    BrdfMap.__name__: _brdf,
    Pictures.__name__: _labelled,
    LightProbe.__name__: _probe,
    OrientationMap.__name__: _orientation,
    PeriodMap.__name__: _period,
    PrintLayout.__name__: _print_layout,
    GratingSample.__name__: _sample,
    OrientationError.__name__: _error,
    PictureSeries.__name__: _pictures,
    PolarizerResponse.__name__: _response,
    LineDeviation.__name__: _deviation,
    Defects.__name__: _defects,
    Inspection.__name__: _inspection,
    HeightField.__name__: _heights,
    Periodicity.__name__: _periods,
    DiffractionPeaks.__name__: _diffraction_peaks,
    SlitPatterns.__name__: _slits,
}
