"""The sample photographed under a torch, on a virtual bench."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.data.pictures import PictureSeries
from pipeline.devices.simulated import DEEPEST_BITS, LARGEST_WELL
from pipeline.devices.virtual_light import Lighting, check_lighting, render_supersampled, white_level
from pipeline.devices.virtual_sample import sample_pixels_across
from pipeline.errors import InputError
from pipeline.limits import above_zero_up_to, at_least, refuse, within, zero_or_more
from pipeline.optics.imaging import FINEST_PITCH_MM, area_average, seen_by_lens, sensor_signal

# Libraries round the simulated light differently in its last bits, which moves few pixels by a step of 14 bits.
_tolerance_point_light = {"rgb": 6.2e-5}


def point_light(
    sample: GratingSample,
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float] = [0.0, 0.0, 500.0],  # noqa: B006 - read from the syntax tree, never modified
    pixel_mm: float = 0.02,
    light_sigma_mm: float = 12.0,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "D65",
    coherence_um: float = 65.0,
    wavelength_step_nm: float = 5.0,
    blur_mm: float = 0.012,
    full_well_electrons: float = 25000.0,
    read_noise_electrons: float = 5.0,
    bits: int = 14,
    seed: int = 0,
) -> PictureSeries:
    """Photograph a virtual sample in colour under a light that is carried around it.

    The true sample is rendered on its own fine grid where facets meet, blurred by the lens, collected by the camera's
    pixels, and passed through noise, saturation and quantisation.

    Parameters
    ----------
    sample : GratingSample
        The sample.
    lights_mm : list of [x, y, z]
        Positions of the light: x right, y up, z towards the camera, origin at the centre of the sample.
    camera_mm : [x, y, z]
        Position of the camera.
    pixel_mm : float
        Pixel pitch on the sample; an odd multiple of the sample's own.
    light_sigma_mm : float
        Standard deviation of the light's Gaussian extent.
    illuminant : {"D65", "A", "inverse A", "E"}
        Spectrum of the light; the camera's white balance makes white paper white.
    coherence_um : float
        Width 4 sigma_s of the coherence window.
    wavelength_step_nm : float
        Step of the spectral sum.
    blur_mm : float
        Standard deviation of the lens' point spread function on the sample.
    full_well_electrons, read_noise_electrons, bits : float, float, int
        Sensor.
    seed : int
        Of the noise.

    Returns
    -------
    PictureSeries
        Linear sRGB of shape (lights, M, N, 3); one exposure for all brings the brightest facets to full scale.

    Raises
    ------
    InputError
        The camera's pitch is no odd multiple of the sample's.
    """
    ratio = sample_pixels_across(pixel_mm, sample.pixel_mm)
    lighting = Lighting(
        lights_mm=np.asarray(lights_mm, dtype=np.float64),
        camera_mm=np.asarray(camera_mm, dtype=np.float64),
        light_sigma_mm=light_sigma_mm,
        illuminant=illuminant,
        depth_um=sample.depth_um,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
    )
    rows, columns = (length // ratio * ratio for length in sample.orientation_rad.shape)
    scenes = render_supersampled(
        sample.orientation_rad[:rows, :columns],
        sample.period_um[:rows, :columns],
        lighting,
        pixel_mm=sample.pixel_mm,
        ratio=ratio,
    )
    blur_px = blur_mm / sample.pixel_mm
    rgb = np.stack([area_average(seen_by_lens(scene, blur_px=blur_px), ratio) for scene in scenes])
    rgb /= white_level(rgb, 99.5)
    rng = np.random.default_rng(seed)
    signal, _ = sensor_signal(
        rgb,
        full_well_electrons=full_well_electrons,
        read_noise_electrons=read_noise_electrons,
        shot_noise=True,
        bits=bits,
        rng=rng,
    )
    return PictureSeries(
        rgb=signal,
        light_mm=lighting.lights_mm,
        camera_mm=lighting.camera_mm,
        pixel_mm=pixel_mm,
        caption="Photographed: the simulated sample under the same light",
    )


def _check_point_light(
    *,
    lights_mm: list[list[float]],
    camera_mm: list[float],
    light_sigma_mm: float,
    coherence_um: float,
    wavelength_step_nm: float,
    pixel_mm: float,
    blur_mm: float,
    full_well_electrons: float,
    read_noise_electrons: float,
    bits: int,
    seed: int,
    sample: Mapping[str, Any] | None = None,
    **_: object,
) -> None:
    """Refuse impossible places, sizes and sensors, and a sample whose pitch does not fit, before anything runs."""
    refuse(
        at_least(FINEST_PITCH_MM, "the shortest wavelength of light", pixel_mm=pixel_mm),
        above_zero_up_to(LARGEST_WELL, full_well_electrons=full_well_electrons),
        zero_or_more(blur_mm=blur_mm, read_noise_electrons=read_noise_electrons, seed=seed),
        within(1, DEEPEST_BITS, bits=bits),
    )
    check_lighting(
        lights_mm=lights_mm,
        camera_mm=camera_mm,
        light_sigma_mm=light_sigma_mm,
        coherence_um=coherence_um,
        wavelength_step_nm=wavelength_step_nm,
    )
    if sample and "pixel_mm" in sample:
        try:
            sample_pixels_across(pixel_mm, sample["pixel_mm"])
        except InputError as error:
            raise error.at("pixel_mm, sample.pixel_mm") from None
