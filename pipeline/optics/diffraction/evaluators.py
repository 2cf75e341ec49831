"""Evaluators of the spectral response by name, prepared for a surface, directions and wavelengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.diffraction.bumps import BumpResponse
from pipeline.optics.diffraction.chebyshev import chebyshev_errors, chebyshev_response, degree_for
from pipeline.optics.diffraction.direct import direct_response, nonuniform_response
from pipeline.optics.diffraction.directions import Directions
from pipeline.optics.diffraction.patch import Components, Patch, SpectralResponse, frequency_sigma, quotient_range
from pipeline.optics.diffraction.replicas import replica_response
from pipeline.optics.diffraction.taylor import phase_range, taylor_error, taylor_response, taylor_terms

Float64Array = NDArray[np.float64]
Evaluator = Literal["chebyshev", "flss", "nmm", "pq", "pq_sinc", "gem", "nufft", "direct"]

NEEDS_LATTICE: tuple[Evaluator, ...] = ("nmm", "gem")
_SINC_REACH = 2
_HIGHEST_ORDER = 1000
_REFERENCE = 1e-6
_SINGLE = float(np.finfo(np.float32).eps)


@dataclass(frozen=True)
class Recipe:
    """How a response is found.

    Attributes
    ----------
    evaluator : str
        ``chebyshev``; ``flss``, Taylor terms at all wavelengths; ``nmm``, the same at wavelengths that an order of the
        lattice sends; ``pq`` and ``pq_sinc``, one patch times a row of them; ``gem``, the lattice alone; ``nufft`` and
        ``direct``, the defining sum.
    coherence_um : float
        Four standard deviations of the coherence window.
    tolerance : float
        Error of the amplitude, relative to a mirror's.
    terms : int or None
        Chebyshev or Taylor terms; None for the least that hold the tolerance.
    lattice_per_um : ndarray of shape (P, 2) or None
        Frequencies along x and y of the surface's dominant periods, for those that need it.
    workers : int
        Threads of the transforms.
    """

    evaluator: Evaluator = "chebyshev"
    coherence_um: float = 65.0
    tolerance: float = 1e-3
    terms: int | None = None
    lattice_per_um: Float64Array | None = None
    workers: int = 1


def prepared(recipe: Recipe, patch: Patch, directions: Directions, wavelength_um: Float64Array) -> SpectralResponse:
    """Make the tables that an evaluator needs for these directions and wavelengths.

    Raises
    ------
    ValueError
        The evaluator needs a lattice, and there is none.
    ImportError
        It needs finufft, which is not installed.
    """
    uvw, width, terms, workers = directions.uvw, recipe.coherence_um, recipe.terms, recipe.workers
    name, tolerance, lattice = recipe.evaluator, recipe.tolerance, recipe.lattice_per_um
    if name == "chebyshev":
        return chebyshev_response(
            patch, uvw, wavelength_um, coherence_um=width, tolerance=tolerance, degree=terms, workers=workers
        )
    if name in ("pq", "pq_sinc"):
        return replica_response(
            patch,
            uvw,
            wavelength_um,
            coherence_um=width,
            tolerance=tolerance,
            terms=terms,
            reach=_SINC_REACH if name == "pq_sinc" else 0,
            workers=workers,
        )
    if name == "nufft":
        return nonuniform_response(patch, coherence_um=width, tolerance=min(tolerance, _REFERENCE), workers=workers)
    if name == "direct":
        return direct_response(patch, coherence_um=width)
    if name in NEEDS_LATTICE and (lattice is None or not len(lattice)):
        raise ValueError(f"{name} needs the surface's dominant periods")
    if lattice is not None and name == "gem":
        return BumpResponse(np.asarray(lattice[0], np.float64), width)
    orders = None if lattice is None or name == "flss" else lattice_orders(lattice, uvw, wavelength_um, width)
    return taylor_response(
        patch,
        uvw,
        wavelength_um,
        coherence_um=width,
        tolerance=tolerance,
        terms=terms,
        orders_per_um=orders,
        workers=workers,
    )


def terms_and_error(
    recipe: Recipe, patch: Patch, directions: Directions, wavelength_um: Float64Array
) -> tuple[int, float] | None:
    """Terms that the evaluator takes and a bound of the amplitude's error; None if it has none.

    The bound is the larger of what terms leave and what single precision rounds: the amplitude, and of ``chebyshev``
    the phase too.
    """
    if recipe.evaluator in ("gem", "nufft", "direct"):
        return None
    w = directions.uvw[2]
    if recipe.evaluator == "chebyshev":
        low, high = quotient_range(w, wavelength_um)
        phase = np.pi * (high - low) * patch.relief_um / 2
        terms = recipe.terms or degree_for(phase, recipe.tolerance)
        rounded = _SINGLE * (1 + phase_range(patch, w, wavelength_um) / 2)
        return terms, max(float(chebyshev_errors(phase, terms)[-1]), rounded)
    phase = phase_range(patch, w, wavelength_um)
    terms = recipe.terms or taylor_terms(phase, recipe.tolerance)
    return terms, max(taylor_error(phase, terms), _SINGLE)


def lattice_orders(
    lattice_per_um: Float64Array,
    uvw: Components,
    wavelength_um: Float64Array,
    coherence_um: float,
) -> Float64Array:
    """Orders ``m a + n b`` of one or two frequencies that the directions can reach, shape (O, 2)."""
    reach = [quotient_range(part, wavelength_um) for part in uvw[:2]]
    margin = 6 * frequency_sigma(coherence_um)
    farthest = np.hypot(*(np.abs(ends).max() + margin for ends in reach))
    least = np.linalg.svd(lattice_per_um[:2], compute_uv=False).min()
    highest = min(int(farthest / least) + 1, _HIGHEST_ORDER)
    whole = np.arange(-highest, highest + 1)
    first = whole[:, None] * lattice_per_um[0]
    second = whole[:, None] * lattice_per_um[1] if len(lattice_per_um) > 1 else np.zeros((1, 2))
    orders = (first[:, None] + second[None]).reshape(-1, 2)
    within = [(orders[:, i] > low - margin) & (orders[:, i] < high + margin) for i, (low, high) in enumerate(reach)]
    return np.ascontiguousarray(orders[within[0] & within[1]])


def wavelength_step_nm(
    directions: Directions, coherence_um: float, relief_um: float, tolerance: float, shortest_nm: float
) -> float:
    """Widest step of the trapezoid rule over wavelengths that shows every order, and the fringes within it.

    At a direction ``(u, v, w)`` an order is a Gaussian over the wavelength, of standard deviation ``lambda^2 sigma_f /
    (sqrt 2 |(u, v)|)``. Its sum over equal steps ``s`` errs by ``2 exp(-2 pi^2 sigma^2 / s^2)`` of its area. Light from
    top and bottom of a relief ``h`` interferes in fringes ``lambda^2 / (|w| h)`` apart.
    """
    u, v, w = directions.uvw
    across = np.sqrt(np.log(2 / tolerance)) / (np.pi * frequency_sigma(coherence_um))
    path_um = float(np.nanmax(np.hypot(u, v) * across + np.abs(w) * relief_um))
    return shortest_nm**2 / 1000 / max(path_um, 1e-9)
