"""BRDF of a sinusoidal grating under light that is coherent over a Gaussian window (Stam 1999; Toisoul et al. 2018).

Height ``h(x) = h0/2 (1 + cos(2 pi x / a))`` along the tangent, anticlockwise from +x by the orientation; z is the
sheet's normal. With ``(u, v, w)`` the half vector in the grating's frame, ``k = 2 pi / lambda`` and ``sigma_s`` a
quarter of the coherence width,

    f = F (1 + i . r)^2 / (cos_i cos_r w^2)  4 pi sigma_s^2 / lambda^2
        sum over m of share_m(k w h0) exp(-sigma_s^2 k^2 ((u - m lambda / a)^2 + v^2)).

Orders do not overlap where the window is several periods wide, so that their fields' products are left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pipeline.optics.diffraction.directions import Directions, relative_gain, schlick
from pipeline.optics.gratings import Form, efficiencies, highest_order, window_spread

Float64Array = NDArray[np.float64]


def half_vector(directions: Directions, orientation_rad: ArrayLike) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Light plus view in the frame of gratings: along the tangent, across it, along the normal."""
    x, y, z = (-part for part in directions.uvw)
    cosine, sine = np.cos(orientation_rad), np.sin(orientation_rad)
    return x * cosine + y * sine, y * cosine - x * sine, z


def grating_response(
    directions: Directions,
    *,
    orientation_rad: ArrayLike,
    period_um: ArrayLike,
    depth_um: ArrayLike,
    wavelength_um: ArrayLike,
    coherence_um: float = 65.0,
    form: Form = "exact",
) -> Float64Array:
    """All orders that reach the viewer, relative to a mirror in its direction; everything is broadcast.

    Parameters
    ----------
    directions : Directions
        Of light and viewer.
    orientation_rad : array_like
        Of the tangent, anticlockwise from +x.
    period_um, depth_um : array_like
        Of the gratings; the depth is from crest to trough.
    wavelength_um : array_like
        Of the light.
    coherence_um : float
        Width ``4 sigma_s`` of the window; 65 um for sunlight.
    form : {"exact", "second order"}
        Share of an order by Bessel functions, or expanded to second order as in the paper.
    """
    u, v, w = half_vector(directions, orientation_rad)
    period, wavelength = np.asarray(period_um, np.float64), np.asarray(wavelength_um, np.float64)
    spread = window_spread(wavelength, coherence_um)
    phase = 2 * np.pi / wavelength * w * np.asarray(depth_um)
    last = highest_order(float(period.max()), float(wavelength.min()), float(np.nanmax(np.abs(u))))
    total = np.zeros(np.broadcast_shapes(phase.shape, u.shape, period.shape))
    for order in range(-last, last + 1):
        away = u - order * wavelength / period
        total += efficiencies(form, abs(order), phase) * np.exp(-(away**2 + v**2) / (2 * spread**2))
    return total


def grating_brdf(
    directions: Directions,
    *,
    orientation_rad: ArrayLike,
    period_um: ArrayLike,
    depth_um: ArrayLike,
    wavelength_um: ArrayLike,
    coherence_um: float = 65.0,
    form: Form = "exact",
    refractive_index: float | None = None,
) -> Float64Array:
    """BRDF in 1/sr; parameters as of :func:`grating_response`.

    Parameters
    ----------
    refractive_index : float, optional
        For Schlick's reflectance; by default all light is reflected, as nearly so by a metal.

    Notes
    -----
    Integrated over an order's directions it gives ``F share_m (1 + i . r)^2 / (cos_i cos_r w^2)``, the last factor 1
    for a mirror: scalar theory does not balance energy where an order leaves at a grazing angle.
    """
    response = grating_response(
        directions,
        orientation_rad=orientation_rad,
        period_um=period_um,
        depth_um=depth_um,
        wavelength_um=wavelength_um,
        coherence_um=coherence_um,
        form=form,
    )
    cos_light, cos_view = directions.light[..., 2], directions.view[..., 2]
    between = (directions.light * directions.view).sum(axis=-1)
    geometry = (1 + between) ** 2 / (cos_light * cos_view * (cos_light + cos_view) ** 2)
    reflectance = 1.0 if refractive_index is None else schlick(directions, refractive_index)
    mirror = 4 * np.pi * (coherence_um / 4) ** 2 / np.asarray(wavelength_um, np.float64) ** 2
    return np.asarray(reflectance * geometry * mirror * response)


def relative_grating_brdf(
    directions: Directions,
    *,
    orientation_rad: ArrayLike,
    period_um: ArrayLike,
    depth_um: ArrayLike,
    wavelength_um: ArrayLike,
    coherence_um: float = 65.0,
    form: Form = "exact",
    refractive_index: float = 1.5,
    shadowed: bool = False,
) -> Float64Array:
    """The same relative to a mirror at normal incidence, by Single's equation 1.34, as ``render.brdf_map`` draws it.

    Parameters
    ----------
    refractive_index : float
        For Schlick's reflectance.
    shadowed : bool
        Whether V-shaped grooves shadow grazing directions.
    """
    response = grating_response(
        directions,
        orientation_rad=orientation_rad,
        period_um=period_um,
        depth_um=depth_um,
        wavelength_um=wavelength_um,
        coherence_um=coherence_um,
        form=form,
    )
    return response * relative_gain(directions, refractive_index=refractive_index, shadowed=shadowed)
