"""A sample drawn by a designer as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample
from pipeline.devices.drawn_sample import drawn_sample, foreseen, undrawable
from pipeline.devices.map_files import grey_picture, read_mask
from pipeline.devices.photo_files import read_photo
from pipeline.errors import InputError
from pipeline.limits import above_zero, refuse, within, zero_or_more
from pipeline.optics.drawing import BoolArray, Drawing, Map

Float64Array = NDArray[np.float64]

FLATTEST = 1e-6
"""Slope a pixel, as a share of full scale, below which there is nothing but rounding: a step of 16 bits is 1.5e-5."""


def picture_design(
    *,
    file: Path,
    reading: Literal["grey", "gradient", "hue"] = "grey",
    range_deg: tuple[float, ...] = (0.0, 180.0),
    blur_px: float = 2.0,
    least_gradient: float = 0.02,
    least_saturation: float = 0.25,
    mask: Path | None = None,
    pixel_mm: float = 0.05,
    period_um: float = 1.4,
    period_file: Path | None = None,
    periods_um: tuple[float, ...] = (1.0, 2.0),
    depth_um: float = 0.12,
    amplitude_ratio: float = 1.1,
    phase_deg: float = 45.0,
    retardation_deg: float = 3.0,
    film_axis_deg: float = 0.0,
    ground_reflectance: float = 0.03,
) -> GratingSample:
    """Draw gratings from a picture: grey, the direction in which it grows lighter, or hue is their orientation.

    Parameters
    ----------
    file : Path
        The picture, grey unless it is read by hue; each of its pixels is one of the map.
    reading : {"grey", "gradient", "hue"}
        ``grey``: black to white are the ends of ``range_deg``. ``gradient``: the orientation is the direction of the
        steepest slope of grey, anticlockwise from +x, y up, so that grating lines follow lines of equal grey. ``hue``:
        it is half the hue, as in the PNG files that runs write of orientations.
    range_deg : [float, float]
        Orientations of black and of white.
    blur_px : float
        Of ``gradient``: standard deviation of the blur before.
    least_gradient : float
        Of ``gradient``: slopes below this share of the steepest are ground.
    least_saturation : float
        Of ``hue``: colours of less saturation (of HSV), as grey and white, are ground.
    mask : Path, optional
        A grey picture of the same size, black where there is ground.
    pixel_mm : float
        Pitch of the pixels on the sample.
    period_um : float
        Of all gratings, unless there is a ``period_file``.
    period_file : Path, optional
        A grey picture of the same size that tells periods.
    periods_um : [float, float]
        Periods of its black and of its white.
    depth_um, amplitude_ratio, phase_deg, retardation_deg, film_axis_deg, ground_reflectance : float
        Profile, zeroth order, film and ground, as in ``simulate.logo``.

    Returns
    -------
    GratingSample
        Of the picture's shape.

    Raises
    ------
    InputError, InputErrors
        A picture is missing, in colour that is to be read as grey, or of another size, a range has not two ends, or
        there is no slope or colour at all.
    """
    _check_settings(
        range_deg=range_deg,
        blur_px=blur_px,
        least_gradient=least_gradient,
        least_saturation=least_saturation,
        pixel_mm=pixel_mm,
        period_um=period_um,
        periods_um=periods_um,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    if reading == "hue":
        orientation, diffracts = _hues(file, least_saturation)
    else:
        grey = grey_picture(file).values.astype(np.float64)
        diffracts = np.isfinite(grey)
        if reading == "grey":
            orientation = np.deg2rad(_between(range_deg, grey))
        else:
            orientation, slope = _slopes(grey, blur_px)
            diffracts &= slope >= max(least_gradient * slope[diffracts].max(initial=0.0), FLATTEST)
    diffracts &= read_mask(mask, diffracts.shape)
    if not diffracts.any():
        raise InputError("nothing diffracts: the picture has no slope or colour, or all is masked", where=str(file))
    rows, columns = diffracts.shape
    drawing = Drawing(columns, pixel_mm, rows)
    x, y = drawing.x_mm, drawing.y_mm
    everywhere = drawing.window(x[0], y[-1], x[-1], y[0])
    period = (
        period_um
        if period_file is None
        else _given(_between(periods_um, _periods(period_file, diffracts.shape))[diffracts])
    )
    drawing.paint(everywhere, diffracts, _given(orientation[diffracts]), period)
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


def _given(values: Float64Array) -> Map:
    """The pixels that are painted, one by one."""
    return lambda _x, _y: values


def _between(ends: tuple[float, ...], share: Float64Array) -> Float64Array:
    return ends[0] + (ends[1] - ends[0]) * share


def _hues(file: Path, least_saturation: float) -> tuple[Float64Array, BoolArray]:
    """Orientations as half the hues of a picture, and where it has a colour."""
    picture = np.clip(read_photo(file, linear=True).image, 0, 1)
    if picture.ndim == 2:
        raise InputError(
            "a grey picture has no hues", where=str(file), expected="a picture in colour, or reading: grey"
        )
    hue, saturation, _ = np.moveaxis(cv2.cvtColor(picture, cv2.COLOR_RGB2HSV).astype(np.float64), -1, 0)
    return np.deg2rad(hue / 2), (saturation >= least_saturation) & (saturation > 0)


def _slopes(grey: Float64Array, blur_px: float) -> tuple[Float64Array, Float64Array]:
    """Direction and size of the steepest slope, from differences of neighbours after a blur."""
    smooth = cv2.GaussianBlur(grey, (0, 0), blur_px, borderType=cv2.BORDER_REPLICATE) if blur_px > 0 else grey
    down, right = np.gradient(smooth)
    return np.arctan2(-down, right), np.hypot(down, right)


def _periods(file: Path, shape: tuple[int, ...]) -> Float64Array:
    grey = grey_picture(file).values.astype(np.float64)
    if grey.shape != shape:
        sizes = f"{grey.shape[1]} x {grey.shape[0]} pixels, the orientations {shape[1]} x {shape[0]}"
        raise InputError(f"the periods have {sizes}", where="period_file", expected="a picture of the same size")
    return grey


_foresee_picture_design = foreseen


def _check_settings(
    *,
    range_deg: tuple[float, ...],
    blur_px: float,
    least_gradient: float,
    least_saturation: float,
    pixel_mm: float,
    period_um: float,
    periods_um: tuple[float, ...],
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
) -> None:
    problems = [
        InputError(f"{name} is {list(ends)}", where=name, expected="two numbers: of black and of white")
        for name, ends in {"range_deg": range_deg, "periods_um": periods_um}.items()
        if len(ends) != 2
    ]
    if len(periods_um) == 2 and min(periods_um) <= 0:
        problems.append(InputError(f"periods_um is {list(periods_um)}", where="periods_um", expected="above 0"))
    refuse(
        problems,
        zero_or_more(blur_px=blur_px),
        within(0, 1, least_gradient=least_gradient, least_saturation=least_saturation),
        above_zero(period_um=period_um, pixel_mm=pixel_mm),
        undrawable(
            width_mm=1.0,
            margin_mm=0.0,
            pixel_mm=1.0,  # as many points as the picture has pixels
            depth_um=depth_um,
            amplitude_ratio=amplitude_ratio,
            ground_reflectance=ground_reflectance,
        ),
    )


def _check_picture_design(
    *,
    file: Path,
    reading: str,
    mask: Path | None,
    period_file: Path | None,
    range_deg: tuple[float, ...],
    blur_px: float,
    least_gradient: float,
    least_saturation: float,
    pixel_mm: float,
    period_um: float,
    periods_um: tuple[float, ...],
    depth_um: float,
    amplitude_ratio: float,
    ground_reflectance: float,
    **_: object,
) -> None:
    """Read the pictures before anything runs."""
    _check_settings(
        range_deg=range_deg,
        blur_px=blur_px,
        least_gradient=least_gradient,
        least_saturation=least_saturation,
        pixel_mm=pixel_mm,
        period_um=period_um,
        periods_um=periods_um,
        depth_um=depth_um,
        amplitude_ratio=amplitude_ratio,
        ground_reflectance=ground_reflectance,
    )
    if file.suffix.lower() == ".svg":
        raise InputError(
            f"{file.name} is made of shapes, not of pixels",
            where="file",
            expected="a picture",
            hint="maps=vector, or simulate.vector_design, draws shapes",
        )
    shape = read_photo(file, linear=True).image.shape[:2] if reading == "hue" else grey_picture(file).values.shape
    read_mask(mask, shape)
    if period_file is not None:
        _periods(period_file, shape)
