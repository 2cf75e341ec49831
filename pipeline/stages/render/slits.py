"""What a row of slits throws on a screen: fringes of one wavelength, and colours under white light."""

from __future__ import annotations

import numpy as np

from pipeline.data.diffraction import SlitPatterns
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within
from pipeline.optics.colour import FIRST_NM, LAST_NM, white_balanced_weights
from pipeline.optics.diffraction.slits import slit_intensity

_SAMPLES_A_FRINGE = 20
_STEP_NM = 1.0
_MOST_SAMPLES = 100_000
_tolerance_slits = {"intensity": 1e-6, "white_rgb": 1e-5}


def slits(
    *,
    counts: list[int] = [1, 2, 3, 4, 5, 6, 7],  # noqa: B006 - read from the syntax tree, never modified
    slit_um: float = 30.0,
    separation_um: float = 150.0,
    wavelength_nm: float = 500.0,
    distance_m: float = 0.5,
    half_width_mm: float = 10.0,
) -> SlitPatterns:
    """Light rows of slits, and look at the screen behind them.

    The screen is far away (Fraunhofer). White light is D65, and each of its wavelengths is taken relative to the middle
    of the screen, which is therefore white.

    Parameters
    ----------
    counts : list of int
        Numbers of slits, one pattern each.
    slit_um, separation_um : float
        Width of a slit, and distance of the middles of neighbours.
    wavelength_nm : float
        Of the light of one wavelength, between 380 and 780 nm.
    distance_m : float
        From the slits to the screen.
    half_width_mm : float
        Of the screen.

    Returns
    -------
    SlitPatterns
        With the figures ``fringe_mm``, the distance of the first maximum from the middle, and ``one_slit_dark_mm``,
        that of the first minimum of a single slit.

    Raises
    ------
    InputError, InputErrors
        Slits that overlap, or are narrower than a wavelength; an impossible setting.

    References
    ----------
    Single, Diffraction Shader (2014), figures 3.5 and 3.6.
    """
    distance_mm = 1000 * distance_m
    samples = 2 * _half_samples(counts, slit_um, separation_um, distance_m, half_width_mm) + 1
    position = np.linspace(-half_width_mm, half_width_mm, samples)
    sine = position / np.hypot(position, distance_mm)
    shape = {"slit_um": slit_um, "separation_um": separation_um}
    white_nm, weights = white_balanced_weights("D65", _STEP_NM)
    one = [slit_intensity(sine, count, **shape, wavelength_um=wavelength_nm / 1000) for count in counts]
    white = [slit_intensity(sine[:, None], count, **shape, wavelength_um=white_nm / 1000) @ weights for count in counts]
    return SlitPatterns(
        position,
        np.asarray(counts, np.int64),
        np.asarray(one, np.float32),
        np.asarray(white, np.float32),
        wavelength_nm,
        f"Slits {slit_um:g} µm wide and {separation_um:g} µm apart, seen {distance_m:g} m behind them",
        {
            "fringe_mm": _on_screen(wavelength_nm / 1000 / separation_um, distance_mm),
            "one_slit_dark_mm": _on_screen(wavelength_nm / 1000 / slit_um, distance_mm),
        },
    )


def _on_screen(sine: float, distance_mm: float) -> float:
    return float(distance_mm * sine / np.sqrt(1 - sine**2))


def _half_samples(
    counts: list[int], slit_um: float, separation_um: float, distance_m: float, half_width_mm: float
) -> int:
    """Samples on either half of the screen that show the finest fringes of the shortest wavelength."""
    finest_um = max(slit_um, max(counts) * separation_um)
    fringe_mm = distance_m * FIRST_NM / finest_um
    return int(np.ceil(_SAMPLES_A_FRINGE * half_width_mm / fringe_mm)) + 100


def _check_slits(
    *,
    counts: list[int],
    slit_um: float,
    separation_um: float,
    wavelength_nm: float,
    distance_m: float,
    half_width_mm: float,
) -> None:
    """Refuse impossible slits before anything runs."""
    refuse(
        [] if counts else [InputError("counts is empty", where="counts", expected="one number of slits or more")],
        [p for count in counts for p in at_least(1, "without a slit there is no light", counts=count)],
        at_least(LAST_NM / 1000, "a wavelength, below which Fraunhofer's formula fails", slit_um=slit_um),
        at_least(max(slit_um, 0), "as slits must not overlap", separation_um=separation_um),
        within(FIRST_NM, LAST_NM, wavelength_nm=wavelength_nm),
        above_zero(distance_m=distance_m, half_width_mm=half_width_mm),
    )
    if 2 * _half_samples(counts, slit_um, separation_um, distance_m, half_width_mm) > _MOST_SAMPLES:
        raise InputError(
            f"half_width_mm is {half_width_mm:g}, over which fringes are too fine to be drawn",
            where="half_width_mm",
            expected="a narrower screen, fewer slits, or a farther screen",
        )
