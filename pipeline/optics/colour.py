"""From spectra to linear sRGB, with the CIE's data from colour-science."""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

Float64Array = NDArray[np.float64]
Spectrum = Literal["D65", "A", "inverse A", "E"]

FIRST_NM, LAST_NM = 380.0, 780.0
LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Of linear sRGB (IEC 61966-2-1)."""


@lru_cache(maxsize=8)
def white_balanced_weights(light: Spectrum, step_nm: float) -> tuple[Float64Array, Float64Array]:
    """Wavelengths, and what each contributes to linear sRGB.

    Parameters
    ----------
    light : {"D65", "A", "inverse A", "E"}
        Spectrum of the light; "inverse A" is the reciprocal of CIE illuminant A, the paper's phone flash.
    step_nm : float
        Distance of the wavelengths between 380 and 780 nm.

    Returns
    -------
    wavelength_nm : ndarray of shape (W,)
        Wavelengths.
    weights : ndarray of shape (W, 3)
        Such that ``reflectance @ weights`` is the colour, and a white reflector gives (1, 1, 1).
    """
    wavelength = np.arange(FIRST_NM, LAST_NM + step_nm / 2, step_nm)
    xyz = _colour_matching(wavelength) * _power(light, wavelength)[:, None]
    weights = xyz @ _xyz_to_srgb().T
    weights = weights / weights.sum(axis=0)
    weights.setflags(write=False)
    wavelength.setflags(write=False)
    return wavelength, weights


@lru_cache(maxsize=8)
def filtered_weights(
    light: Spectrum, step_nm: float, centre_nm: float, width_nm: float
) -> tuple[Float64Array, Float64Array]:
    """As :func:`white_balanced_weights`, behind a filter of Gaussian transmission, 1 in its centre.

    Parameters
    ----------
    light, step_nm
        As there; steps are at most a fifth of the filter's width.
    centre_nm, width_nm : float
        Of the filter; full width at half maximum. Beyond 1.5 widths it counts as opaque.
    """
    count = int(np.ceil(3 * width_nm / min(step_nm, width_nm / 5))) + 1
    wavelength = np.linspace(centre_nm - 1.5 * width_nm, centre_nm + 1.5 * width_nm, count)
    every, _ = white_balanced_weights(light, step_nm)
    white = (_colour_matching(every) * _power(light, every)[:, None] @ _xyz_to_srgb().T).sum(axis=0) * step_nm
    transmitted = np.exp(-4 * np.log(2) * ((wavelength - centre_nm) / width_nm) ** 2)
    xyz = _colour_matching(wavelength) * (_power(light, wavelength) * transmitted)[:, None]
    weights = xyz @ _xyz_to_srgb().T * (wavelength[1] - wavelength[0]) / white
    weights.setflags(write=False)
    wavelength.setflags(write=False)
    return wavelength, weights


def spectral_colour(wavelength_nm: float) -> Float64Array:
    """Linear sRGB of light of one wavelength, shape (3,), its largest part 1; what no display can show is clipped."""
    rgb = np.clip(_colour_matching(np.array([wavelength_nm]))[0] @ _xyz_to_srgb().T, 0.0, None)
    return np.asarray(rgb / rgb.max())


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.float32]:
    """Encode linear sRGB for a display (IEC 61966-2-1); what a display cannot show is clipped."""
    clipped = np.clip(linear, 0.0, 1.0).astype(np.float32)
    return np.where(clipped <= 0.0031308, 12.92 * clipped, 1.055 * clipped ** (1 / 2.4) - 0.055).astype(np.float32)


def _colour_matching(wavelength_nm: Float64Array) -> Float64Array:
    functions = _library().MSDS_CMFS["CIE 1931 2 Degree Standard Observer"]
    return np.stack(
        [np.interp(wavelength_nm, functions.wavelengths, functions.values[:, i]) for i in range(3)], axis=-1
    )


def _power(light: Spectrum, wavelength_nm: Float64Array) -> Float64Array:
    if light == "E":
        return np.ones_like(wavelength_nm)
    spectrum = _library().SDS_ILLUMINANTS["A" if light == "inverse A" else light]
    power = np.interp(wavelength_nm, spectrum.wavelengths, spectrum.values)
    return 1 / power if light == "inverse A" else power


def _xyz_to_srgb() -> Float64Array:
    return np.asarray(_library().models.RGB_COLOURSPACE_sRGB.matrix_XYZ_to_RGB, dtype=np.float64)


def _library() -> Any:
    """colour-science, which is slow to import and complains where matplotlib is missing, which nothing here needs."""
    import warnings

    warnings.filterwarnings("ignore", message='"Matplotlib" related API features are not available')
    import colour

    return colour
