"""A surface under directed light: its response, on as many cores as are free, and what may be wrong with it."""

from __future__ import annotations

import logging
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.data.height_fields import HeightField, Periodicity
from pipeline.errors import InputError
from pipeline.limits import above_zero, at_least, refuse, within
from pipeline.optics.colour import FIRST_NM
from pipeline.optics.diffraction.directions import Directions
from pipeline.optics.diffraction.evaluators import (
    NEEDS_LATTICE,
    Evaluator,
    Recipe,
    prepared,
    terms_and_error,
    wavelength_step_nm,
)
from pipeline.optics.diffraction.patch import Patch, window_over
from pipeline.parallel import over_rows, threads

_log = logging.getLogger(__name__)

_TILE = 64
_ROUNDED = 1.0001
_STEP_ERROR = 1e-2
_FINEST_NM, _COARSEST_NM = 0.25, 10.0
_MOST_TERMS = 1000
"""Reliefs of some hundred micrometres: mistaken units, which would be computed for hours."""
_MOST_TABLE_GIB = 4.0
_SEAM = 2.0
"""Times the largest step inside by which a tile that does not fit itself jumps at its border."""


def recipe_of(
    evaluator: Evaluator, coherence_um: float, tolerance: float, terms: int | None, periods: Periodicity | None
) -> Recipe:
    """How to evaluate; those that need a lattice take it from the surface's periods.

    Raises
    ------
    InputError
        The evaluator needs periods and there are none, or finufft, and it is not installed.
    """
    lattice = None
    if evaluator in NEEDS_LATTICE:
        if periods is None or not len(periods.period_um):
            raise InputError(
                f"{evaluator} looks for light where the surface's periods send it, and none is known",
                expected="periods: fit, the node of fit.periodicity, of a surface that has some",
            )
        towards = np.stack([np.cos(periods.direction_rad), np.sin(periods.direction_rad)], axis=1)
        lattice = np.asarray(towards / periods.period_um[:, None], np.float64)
    if evaluator == "nufft":
        try:
            import finufft  # noqa: F401
        except ImportError:
            raise InputError(
                "the non-uniform FFT is not installed", expected="pip install 'optibench[reference]'"
            ) from None
    return Recipe(evaluator, coherence_um, tolerance, terms, lattice, threads())


def check_recipe(*, coherence_um: float, tolerance: float, terms: int | None) -> None:
    """Refuse settings that no evaluator takes, before anything runs."""
    refuse(
        above_zero(coherence_um=coherence_um),
        within(1e-9, 0.1, tolerance=tolerance),
        [] if terms is None else at_least(1, "a response has one term or more", terms=terms),
    )


def unreflecting(refractive_index: float) -> list[InputError]:
    """Problems of a refractive index that no light is reflected by, to be refused before anything runs."""
    if refractive_index == 1:
        what = "refractive_index is 1, of which no light is reflected"
        return [InputError(what, where="refractive_index", expected="another number above 0")]
    return above_zero(refractive_index=refractive_index)


def automatic_step_nm(surface: HeightField, directions: Directions, coherence_um: float) -> float:
    """Widest step of visible wavelengths that shows every order, within reason; logs a warning where that is too wide.

    Raises
    ------
    InputError
        Heights are missing.
    """
    step = wavelength_step_nm(directions, coherence_um, _patch_of(surface).relief_um, _STEP_ERROR, FIRST_NM)
    if step < _FINEST_NM:
        _log.warning(
            "Orders of this coherence window and relief ask for wavelength steps of %.2g nm, and %g nm are taken: "
            "colours may be off. wavelength_step sets others.",
            step,
            _FINEST_NM,
        )
    return float(np.clip(step, _FINEST_NM, _COARSEST_NM))


@dataclass(frozen=True, eq=False)
class Response:
    """Relative response to many directions.

    Attributes
    ----------
    sums : ndarray of shape (C, M, N), float32
        1 for a mirror in its direction, where weights sum to 1.
    terms : int or None
        Terms of the evaluator, where it has any.
    amplitude_error : float or None
        What they leave of the amplitude at worst, relative to a mirror's.
    """

    sums: NDArray[np.float32]
    terms: int | None
    amplitude_error: float | None


def responses(
    surface: HeightField,
    recipe: Recipe,
    directions: Directions,
    wavelength_nm: NDArray[np.float64],
    weights: NDArray[np.float64],
    *,
    tell: bool = True,
) -> Response:
    """Relative response to many directions, added up over wavelengths.

    Parameters
    ----------
    surface : HeightField
        Without gaps; taken to repeat.
    recipe : Recipe
        How.
    directions : Directions
        Of light and viewer, shape (M, N).
    wavelength_nm : ndarray of shape (L,)
        Wavelengths.
    weights : ndarray of shape (L, C)
        What each wavelength contributes to C sums.
    tell : bool
        Whether to log what was chosen and what may be wrong.

    Raises
    ------
    InputError
        Heights are missing, or the relief is too deep or the surface too wide to be computed.
    """
    patch = _patch_of(surface)
    if tell:
        _warn(surface, patch, recipe, directions, wavelength_nm)
    wavelength_um = np.asarray(wavelength_nm, np.float64) / 1000
    terms, error = terms_and_error(recipe, patch, directions, wavelength_um) or (None, None)
    if terms is not None:
        _refuse_endless(patch, recipe, directions, wavelength_um, terms)
    if tell and error is not None:
        _tell_of_terms(recipe, terms, error, patch.relief_um)
    response = prepared(recipe, patch, directions, wavelength_um)
    rows, columns = directions.uvw[2].shape
    out = np.empty((weights.shape[1], rows, columns), np.float32)
    kernel = response.rows(directions.uvw, wavelength_um, np.asarray(weights, np.float64), out)
    over_rows(kernel, rows, tile=rows if recipe.evaluator == "nufft" else _TILE)
    return Response(out, terms, error)


def _patch_of(surface: HeightField) -> Patch:
    missing = int(np.count_nonzero(~np.isfinite(surface.height_um)))
    if missing:
        raise InputError(
            f"{missing} heights of the surface are not known",
            expected="none missing",
            hint="align.filled fills gaps: graph.filled.stage=align.filled graph.filled.surface=surface "
            "graph.level.surface=filled",
        )
    return Patch(np.asarray(surface.height_um, np.float64), surface.pitch_um)


def _tell_of_terms(recipe: Recipe, terms: int | None, error: float, relief_um: float) -> None:
    if error <= recipe.tolerance * _ROUNDED:
        _log.info("%s: %d terms leave an amplitude error of at most %g.", recipe.evaluator, terms, recipe.tolerance)
    else:
        _log.warning(
            "%s: %d terms leave an amplitude error of up to %.2g on a relief of %.3g um; asked for are %g.",
            recipe.evaluator,
            terms,
            min(error, 1e9),
            relief_um,
            recipe.tolerance,
        )


def _refuse_endless(
    patch: Patch, recipe: Recipe, directions: Directions, wavelength_um: NDArray[np.float64], terms: int
) -> None:
    if terms > _MOST_TERMS:
        raise InputError(
            f"a relief of {patch.relief_um:.4g} um asks {recipe.evaluator} for {terms} terms",
            expected=f"at most {_MOST_TERMS}",
            hint="are the heights in um, and laid level (align.level)?",
        )
    window = window_over(
        patch, directions.uvw, wavelength_um, coherence_um=recipe.coherence_um, tolerance=recipe.tolerance
    )
    across, along = (last - first for first, last in (window.across, window.along))
    if (gib := terms * across * along * 8 / 2**30) > _MOST_TABLE_GIB:
        rows, columns = patch.height_um.shape
        raise InputError(
            f"a surface of {columns * patch.pitch_um:.4g} x {rows * patch.pitch_um:.4g} um has {across} x {along} "
            f"spectral lines, which take {gib:.3g} GiB with {terms} terms",
            expected=f"at most {_MOST_TABLE_GIB:g} GiB",
            hint=f"is a pitch of {patch.pitch_um:g} um right? extract.cropped keeps a part of the surface",
        )


def _warn(
    surface: HeightField,
    patch: Patch,
    recipe: Recipe,
    directions: Directions,
    wavelength_nm: NDArray[np.float64],
) -> None:
    u, v, _ = directions.uvw
    finest = float(max(np.nanmax(np.abs(u)), np.nanmax(np.abs(v)))) / float(wavelength_nm.min()) * 1000
    if finest > 0.5 / patch.pitch_um:
        _log.warning(
            "Samples %g um apart hold orders up to %.2f per um, and directions ask for %.2f: what lies beyond is a "
            "mirror image. A pitch of %.3g um would do.",
            patch.pitch_um,
            0.5 / patch.pitch_um,
            finest,
            0.5 / finest,
        )
    narrow = min(n * patch.pitch_um for n in patch.height_um.shape)
    if narrow < 0.99 * recipe.coherence_um:
        _log.info(
            "The tile is %.3g um wide, narrower than the coherence window of %g um: it is taken to repeat within it.",
            narrow,
            recipe.coherence_um,
        )
    if not surface.periodic:
        jump = _seam(patch.height_um)
        if jump > _SEAM:
            _log.warning(
                "The surface does not repeat, and the tile jumps at its border by %.1f times its largest step inside: "
                "that diffracts along the axes. extract.seamless takes the seam away.",
                jump,
            )


def _seam(height_um: NDArray[np.float64]) -> float:
    """Root mean square step across the border over the largest such step inside, the larger of both axes."""
    ratios = []
    for axis in (0, 1):
        step = np.diff(height_um, axis=axis, append=np.take(height_um, [0], axis=axis))
        rms = np.sqrt((step**2).mean(axis=1 - axis))
        ratios.append(float(rms[-1] / max(rms[:-1].max(initial=0.0), 1e-12)))
    return max(ratios)
