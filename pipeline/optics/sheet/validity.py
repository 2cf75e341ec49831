"""Where scalar diffraction by gratings, and the paper's form of it, stop holding."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import LUMINANCE, Spectrum, white_balanced_weights
from pipeline.optics.gratings import efficiencies, order_efficiency

_STEP_NM = 1.0
_GRAZING = 1e-3


def expansion_error(depth_um: float, light: Spectrum) -> float:
    """Largest difference between the exact and the second-order share of any order, as a part of all light.

    At normal incidence and view, where the phase between crest and trough is deepest; seen as the eye weighs
    wavelengths of the light.

    Parameters
    ----------
    depth_um : float
        From crest to trough.
    light : str
        Spectrum.
    """
    wavelength_um, weights = _seen(light)
    phase = 4 * np.pi * depth_um / wavelength_um
    order = np.arange(3)[:, None]
    difference = efficiencies("second order", order, phase) - efficiencies("exact", order, phase)
    return float(np.abs(difference @ weights).max())


def evanescent_share(period_um: float, depth_um: float, light: Spectrum) -> float:
    """Part of the light that scalar theory sends into orders which cannot leave the surface, at normal incidence.

    Orders with ``|m| lambda > a`` do not propagate; a real grating gives their light to others, and by polarisation.
    So this is how much of the picture the theory leaves open.

    Parameters
    ----------
    period_um, depth_um : float
        Of the grating, from crest to trough.
    light : str
        Spectrum.
    """
    wavelength_um, weights = _seen(light)
    highest = np.floor(period_um / wavelength_um)
    order = np.arange(int(highest.max()) + 1)[:, None]
    share = order_efficiency(order, 4 * np.pi * depth_um / wavelength_um) * np.where(order == 0, 1, 2)
    return float(1 - np.where(order <= highest, share, 0).sum(axis=0) @ weights)


def leaving_share(period_um: float, depth_um: float, light: Spectrum) -> float:
    """Part of normally incident light that scalar theory sends on in orders which leave; 1 would be all of it.

    An order at an angle ``t`` carries ``J_m(k w h0 / 2)^2 / cos t`` with ``w = 1 + cos t``: the BRDF's factor
    ``(1 + i.r)^2 / (cos_i cos_r w^2)`` under normal light, which grows without bound as the order grazes the surface.

    Parameters
    ----------
    period_um, depth_um : float
        Of the grating, from crest to trough.
    light : str
        Spectrum.
    """
    wavelength_um, weights = _seen(light)
    order = np.arange(int(np.floor(period_um / wavelength_um[0])) + 1)[:, None]
    sine = order * wavelength_um / period_um
    cosine = np.sqrt(np.clip(1 - sine**2, 0, None))
    share = order_efficiency(order, 2 * np.pi / wavelength_um * (1 + cosine) * depth_um) * np.where(order == 0, 1, 2)
    carried = np.divide(share, cosine, out=np.zeros_like(share), where=cosine > _GRAZING)
    return float(carried.sum(axis=0) @ weights)


def _seen(light: Spectrum) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    wavelength_nm, weights = white_balanced_weights(light, _STEP_NM)
    return wavelength_nm / 1000, weights @ np.asarray(LUMINANCE)
