"""How a surface shines in all directions, as a disc of colours for each direction of light."""

from __future__ import annotations

import logging
from typing import Literal

import numpy as np

from pipeline.data.diffraction import BrdfMap
from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.devices.virtual_surface import automatic_step_nm, check_recipe, recipe_of, responses, unreflecting
from pipeline.errors import InputError
from pipeline.limits import at_least, refuse, within
from pipeline.optics.colour import FIRST_NM, LAST_NM, white_balanced_weights
from pipeline.optics.diffraction.directions import disc_of_views, relative_gain, unit_vector

_log = logging.getLogger(__name__)

# Sums are float32, and processors add their terms in different orders.
_tolerance_brdf_map = {"rgb": 1e-5, "metrics": 1e-4}
_NONSENSE = 1e9


def brdf_map(
    surface: HeightField,
    periods: Periodicity | None = None,
    *,
    evaluator: Literal["chebyshev", "flss", "nmm", "pq", "pq_sinc", "gem", "nufft", "direct"] = "chebyshev",
    light_deg: list[float] = [0.0, 10.0, 20.0],  # noqa: B006 - read from the syntax tree, never modified
    light_azimuth_deg: float = 0.0,
    size_px: int = 400,
    wavelength_step: float | None = None,
    illuminant: Literal["D65", "A", "inverse A", "E"] = "D65",
    coherence_um: float = 65.0,
    tolerance: float = 1e-3,
    terms: int | None = None,
    refractive_index: float = 1.5,
    shadowed: bool = True,
) -> BrdfMap:
    """Draw what a surface sends to all directions of view, relative to a mirror at normal incidence.

    The surface repeats without end, and light is coherent over a Gaussian window. At each direction and wavelength the
    response is ``|P|^2``, with ``P`` the windowed transform of ``exp(2 pi i w h / lambda)`` at ``(u, v) / lambda`` and
    ``(u, v, w) = -light - view``; it is summed over wavelengths to a colour, and multiplied with what geometry, Fresnel
    reflection and V-shaped grooves make of it. That is the BRDF times the cosine of the light's angle.

    Parameters
    ----------
    surface : HeightField
        Without gaps.
    periods : Periodicity, optional
        Needed by ``nmm`` and ``gem``.
    evaluator : str
        ``chebyshev``, polynomials in ``w / lambda``, the fastest by far; ``flss``, Taylor terms at all wavelengths, the
        source's algorithm 2.3; ``nmm``, the same where an order of the surface's periods may be; ``pq`` and
        ``pq_sinc``, one tile times a row of them, between spectral lines by a straight line or a sinc; ``gem``,
        distances only; ``nufft``, the reference; ``direct``, the defining sum point by point, for a few pixels.
    light_deg : list of float
        Angles of incidence from the normal, one picture each.
    light_azimuth_deg : float
        Where the light stands, anticlockwise from +x.
    size_px : int
        Pixels across the disc, whose edge is at grazing view.
    wavelength_step : float, optional
        In nm; by default the widest that shows every order, from the coherence window and the relief.
    illuminant : {"D65", "A", "inverse A", "E"}
        Spectrum of the light; a mirror under it is white.
    coherence_um : float
        Width 4 sigma_s of the coherence window; 65 um for sunlight.
    tolerance : float
        Error of the amplitude that terms and window each may make, relative to a mirror's.
    terms : int, optional
        Chebyshev or Taylor terms; by default the least that hold the tolerance.
    refractive_index : float
        Of the surface, for Fresnel reflection; 1.5 for snakes' skin.
    shadowed : bool
        Whether V-shaped grooves shadow grazing directions.

    Returns
    -------
    BrdfMap
        Linear sRGB of shape (lights, size, size, 3), with the figures ``brdf_largest``, ``wavelength_step_nm``,
        ``terms`` and ``amplitude_error_bound``, what the terms leave of the amplitude at worst.

    Raises
    ------
    InputError
        Heights are missing or differ too much, or the evaluator needs what is not there.

    References
    ----------
    Single, Diffraction Shader (2014), equations 1.34 and 1.57; Stam 1999; Dhillon et al. 2014.
    """
    recipe = recipe_of(evaluator, coherence_um, tolerance, terms, periods)
    lights = unit_vector(np.deg2rad(light_deg), np.deg2rad(light_azimuth_deg))
    rgb = np.zeros((len(lights), size_px, size_px, 3), np.float32)
    steps, metrics = list[float](), dict[str, float]()
    for picture, light in zip(rgb, lights, strict=True):
        directions = disc_of_views(light, size_px)
        step = wavelength_step or automatic_step_nm(surface, directions, coherence_um)
        first = not steps
        steps.append(step)
        wavelength_nm, weights = white_balanced_weights(illuminant, step)
        response = responses(surface, recipe, directions, wavelength_nm, weights, tell=first)
        if response.terms is not None and response.amplitude_error is not None:
            metrics["terms"] = max(metrics.get("terms", 0.0), response.terms)
            bound = max(metrics.get("amplitude_error_bound", 0.0), response.amplitude_error)
            metrics["amplitude_error_bound"] = min(bound, _NONSENSE)
        gain = relative_gain(directions, refractive_index=refractive_index, shadowed=shadowed)
        picture[:] = np.nan_to_num(np.moveaxis(response.sums, 0, -1) * gain[..., None].astype(np.float32))
    if wavelength_step is None:
        _log.info("Wavelength steps are %s nm.", ", ".join(f"{step:.2g}" for step in steps))
    metrics["brdf_largest"] = float(rgb.max())
    metrics["wavelength_step_nm"] = min(steps)
    return BrdfMap(rgb, lights, evaluator, surface.caption, metrics)


def _check_brdf_map(
    *,
    light_deg: list[float],
    size_px: int,
    wavelength_step: float | None,
    coherence_um: float,
    tolerance: float,
    terms: int | None,
    refractive_index: float,
    **_: object,
) -> None:
    """Refuse impossible directions and sizes before anything runs."""
    refuse(
        [] if light_deg else [InputError("light_deg is empty", where="light_deg", expected="an angle or more")],
        [problem for angle in light_deg for problem in within(0, 89, light_deg=angle)],
        at_least(2, "a disc of one pixel has no directions", size_px=size_px),
        [] if wavelength_step is None else within(0.1, (LAST_NM - FIRST_NM) / 2, wavelength_step=wavelength_step),
        unreflecting(refractive_index),
    )
    check_recipe(coherence_um=coherence_um, tolerance=tolerance, terms=terms)
