"""Errors that all pixels of a photograph share: a misread polariser angle, an exposure that differs or has failed.

Photon noise is every pixel's own and averages out; these do not. What the three numbers of a pixel leave of its
photographs shows most of them: over many pixels, what is left of photograph ``k`` follows ``m (1 + s1 cos 2 psi_k + s2
sin 2 psi_k)`` where its exposure is off, and the derivative of that with respect to ``psi_k`` where its angle is.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.response_curve import StokesNoise, harmonic_design

Float64Array = NDArray[np.float64]

_USUAL_TURN, _USUAL_EXPOSURE = np.deg2rad(2.0), 0.03
"""Standard deviations expected before looking, so that what the photographs cannot show counts as none."""
_BLIND = 0.05
_LEAST_CONSISTENT = 4
_MOST_TRIED = 24
_FLAT = 1e-3
_ODD, _ODD_BESIDE = 0.2, 5.0
"""Odd is a photograph whose brightness is off by this share of the mean, and by so many times what others are."""


@dataclass(frozen=True)
class PhotographErrors:
    """What photographs share, as far as they show it.

    Attributes
    ----------
    turn_rad : ndarray of shape (K,)
        By how much each polariser angle seems to be more than was written down.
    exposure : ndarray of shape (K,)
        By which share each photograph seems to be brighter than the others lead to expect.
    systematic : float
        Root mean square error that they make in ``(s1, s2)``, in units of a pixel's noise, what cannot be seen of them
        taken to be as large as what can; None if nothing can be seen, as with three photographs.
    """

    turn_rad: Float64Array
    exposure: Float64Array
    systematic: float | None


def photograph_errors(
    values: Float64Array, polarizer_rad: Float64Array, photo_weights: Float64Array, gain: float
) -> PhotographErrors:
    """Find them by regularised least squares over all pixels at once.

    Parameters
    ----------
    values : ndarray of shape (K, P)
        Photographs of P pixels.
    polarizer_rad, photo_weights : ndarray of shape (K,)
        Angles, and the weights of squares, about one over the photographs' noise.
    gain : float
        Noise variance over brightness.
    """
    count = len(polarizer_rad)
    design = harmonic_design(polarizer_rad)
    root = np.sqrt(photo_weights)[:, None]
    inverse = np.linalg.pinv(design * root) * root.T
    leaves = np.diag(photo_weights) @ (np.eye(count) - design @ inverse)  # weighted, what a pixel's fit leaves
    mean, cosine, sine = inverse @ values
    numbers = np.stack([np.ones_like(mean), cosine / mean, sine / mean])
    turning = 2 * np.stack([np.zeros(count), -design[:, 2], design[:, 1]], axis=1)
    changes = np.stack([turning @ numbers, design @ numbers])  # by turn and by exposure, relative to the mean
    strength = mean / gain
    normal = np.einsum("akp,blp,kl->akbl", changes * strength, changes, leaves, optimize=True)
    usual = np.repeat([_USUAL_TURN, _USUAL_EXPOSURE], count)
    scaled = normal.reshape(2 * count, -1) * usual * usual[:, None]
    told = np.einsum("akp,kp->ak", changes, leaves @ values / gain).reshape(-1) * usual
    found = (usual * np.linalg.solve(scaled + np.eye(2 * count), told)).reshape(2, count)
    seen = float(np.trace(np.linalg.solve(scaled + np.eye(2 * count), scaled))) / (2 * count)

    shift = inverse @ np.einsum("ak,akp->kp", found, changes)
    moved = shift[1:] - numbers[1:] * shift[0]
    precision = np.linalg.inv(StokesNoise(polarizer_rad, photo_weights).covariance(numbers[1:].T))
    square = np.einsum("ip,pij,jp->p", moved, precision, moved) / 2 * strength
    return PhotographErrors(found[0], found[1], float(np.sqrt(np.median(square) / seen)) if seen > _BLIND else None)


def odd_photographs(level: Float64Array, polarizer_rad: Float64Array) -> list[int]:
    """Photographs whose mean brightness the others make unlikely, since it too follows a cosine over the angles.

    Of all cosines through three photographs that one counts which comes near to three quarters of them, and of the
    rest those are odd that lie far from it: a quarter at most.

    Parameters
    ----------
    level : ndarray of shape (K,)
        Mean brightness of the same pixels in every photograph.
    polarizer_rad : ndarray of shape (K,)
        Polariser angles.
    """
    count = len(level)
    consistent = max(_LEAST_CONSISTENT, int(np.ceil(0.75 * count)))
    design = harmonic_design(polarizer_rad)
    threes = np.array(list(combinations(range(0, count, -(-count // _MOST_TRIED)), 3)))
    threes = threes[np.abs(np.linalg.det(design[threes])) > _FLAT]
    if consistent >= count or not len(threes):
        return []
    through = np.linalg.solve(design[threes], level[threes][:, :, None])[:, :, 0]
    away = np.abs(through @ design.T - level)
    best = np.argsort(away[np.argmin(np.sort(away, axis=1)[:, consistent - 1])])[:consistent]
    found, _, rank, _ = np.linalg.lstsq(design[best], level[best], rcond=None)
    apart = np.abs(design @ found - level)
    limit = max(_ODD * level.mean(), _ODD_BESIDE * apart[best].max())
    return [k for k in range(count) if k not in best and apart[k] > limit] if rank == 3 else []
