"""A simulated digital camera that takes brackets of exposures, behind a response curve or raw."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from pipeline.data.photographs import Photo
from pipeline.devices.sheet_views import WIDEST_VIEW_DEG, blind_camera, unusable_counts
from pipeline.devices.simulated import LARGEST_WELL
from pipeline.devices.virtual_light import Image
from pipeline.devices.virtual_sheet import MOST_SAMPLES
from pipeline.errors import InputError
from pipeline.limits import above_zero_up_to, refuse, within, zero_or_more
from pipeline.optics.colour import encode_srgb
from pipeline.optics.imaging import seen_by_lens, sensor_signal

Scene = Callable[[], Image]

_FULLEST = 0.8
"""Of full scale, to which the room's light is exposed."""
_RAW_BITS = 14


class FlashCamera:
    """A digital camera on a stand, its sensor not quite parallel to the sheet.

    Parameters
    ----------
    camera_mm, target_mm, up : [x, y, z]
        Where it is, what lies in the middle of its picture, and what points up in it.
    field_of_view_deg : float, optional
        Across the picture's width; by default as wide as shows the whole sheet.
    size_px : [columns, rows]
        Of the picture.
    exposure_s : list of float
        Times of a bracket, shortest first. The one in the middle brings bright gratings to full scale.
    raw : bool
        True for 14 bits proportional to light; false for 8 bits behind a response curve.
    contrast : float
        Of the response curve: 0 for that of sRGB, 1 for a steep one that blends into both ends.
    full_well_electrons, read_noise_electrons : float
        Of the sensor.
    blur_px : float
        Standard deviation of the lens' point spread function.
    samples : int
        Points along each side of a pixel at which the sheet is rendered.
    wavelength_nm, bandwidth_nm : float, optional
        Centre and full width at half maximum of a filter before the lens.
    seed : int
        Of the noise.
    """

    def __init__(
        self,
        *,
        camera_mm: list[float] = [12.0, -18.0, 500.0],  # noqa: B006 - read from the syntax tree, never modified
        target_mm: list[float] = [1.0, 2.0, 0.0],  # noqa: B006
        up: list[float] = [0.02, 1.0, 0.0],  # noqa: B006
        field_of_view_deg: float | None = None,
        size_px: list[int] = [1200, 800],  # noqa: B006
        exposure_s: list[float] = [0.0005, 0.002, 0.008, 0.032, 0.128],  # noqa: B006
        raw: bool = False,
        contrast: float = 0.3,
        full_well_electrons: float = 40000.0,
        read_noise_electrons: float = 5.0,
        blur_px: float = 0.5,
        samples: int = 2,
        wavelength_nm: float | None = None,
        bandwidth_nm: float | None = None,
        seed: int = 0,
    ) -> None:
        self.camera_mm = camera_mm
        self.target_mm = target_mm
        self.up = up
        self.field_of_view_deg = field_of_view_deg
        self.size_px = size_px
        self.exposure_s = exposure_s
        self.raw = raw
        self.contrast = contrast
        self.full_well_electrons = full_well_electrons
        self.read_noise_electrons = read_noise_electrons
        self.blur_px = blur_px
        self.samples = samples
        self.wavelength_nm = wavelength_nm
        self.bandwidth_nm = bandwidth_nm
        self.seed = seed
        self._scene: Scene | None = None
        self._taken = 0

    def check(self) -> None:
        """Refuse settings that no camera can have.

        Raises
        ------
        InputError, InputErrors
            Each setting, and what was expected.
        """
        problems = list(blind_camera(self.camera_mm, self.target_mm, self.up))
        unlike = within(380, 780, wavelength_nm=self.wavelength_nm) + within(0.1, 200, bandwidth_nm=self.bandwidth_nm)
        if not unlike and (self.wavelength_nm is None) != (self.bandwidth_nm is None):
            problems.append(
                InputError(
                    "a filter has both a centre and a width", where="wavelength_nm, bandwidth_nm", expected="both"
                )
            )
        refuse(
            problems,
            above_zero_up_to(WIDEST_VIEW_DEG, field_of_view_deg=self.field_of_view_deg),
            unusable_counts("size_px", self.size_px, "[columns, rows] in pixels, whole numbers from 1"),
            unordered_exposures(self.exposure_s),
            within(0, 1, contrast=self.contrast),
            above_zero_up_to(LARGEST_WELL, full_well_electrons=self.full_well_electrons),
            zero_or_more(read_noise_electrons=self.read_noise_electrons, blur_px=self.blur_px, seed=self.seed),
            within(1, MOST_SAMPLES, samples=self.samples),
            unlike,
        )

    def look_at(self, scene: Scene) -> None:
        """Stand before a scene, whose radiance of shape (M, N, 3) is asked for when a photograph is taken."""
        self._scene, self._taken = scene, 0

    def expose_for(self, exposure_s: float | None) -> Photo:
        """Take one photograph; the middle exposure makes a radiance of 1 full scale.

        Raises
        ------
        InputError
            Nothing stands before the camera.
        """
        if self._scene is None:
            raise InputError("nothing lies before the simulated camera", expected="rig.place(sample) first")
        radiance = self._scene()
        self._taken += 1
        usual = self.exposure_s[len(self.exposure_s) // 2]
        gain = exposure_s / usual if exposure_s is not None else _FULLEST / float(np.percentile(radiance, 99.9))
        signal, full = sensor_signal(
            seen_by_lens(radiance, blur_px=self.blur_px) * np.float32(gain),
            full_well_electrons=self.full_well_electrons,
            read_noise_electrons=self.read_noise_electrons,
            shot_noise=True,
            bits=_RAW_BITS,
            rng=np.random.default_rng([self.seed, self._taken]),
        )
        stored = signal if self.raw else np.rint(255 * self._encoded(signal)) / np.float32(255)
        return Photo(stored, np.asarray(full.any(axis=-1)), exposure_s, {"model": "simulated camera"})

    def _encoded(self, signal: Image) -> Image:
        """sRGB, blended with a curve that is level at both ends, as film's is."""
        level = encode_srgb(signal)
        return np.asarray((1 - self.contrast) * level + self.contrast * level**2 * (3 - 2 * level), np.float32)


def unordered_exposures(exposure_s: Sequence[float]) -> list[InputError]:
    """What is wrong with the times of a bracket."""
    times = list(exposure_s)
    if times and times[0] > 0 and times == sorted(set(times)) and np.isfinite(times).all():
        return []
    return [InputError(f"exposure_s is {times}", where="exposure_s", expected="times above 0 in s, the shortest first")]
