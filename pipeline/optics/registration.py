"""Motions between photographs whose contrasts change while their edges stay.

Turning a polariser brightens one facet and darkens its neighbour, so the photographs of a sequence differ by more than
noise and a motion, and may be each other's negatives; where the orientation of the gratings changes continuously, the
picture even seems to turn with the polariser. What stays is where the edges are. Small patches around them
(:mod:`pipeline.optics.edge_patches`) each say along which direction every photograph is off; the motions are those
that all patches agree on. A patch that does not follow the model of one pattern (corners of three facets, moving
fringes) betrays itself by its residual and loses weight.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.edge_patches import SIZE, PatchTerms, edge_patches, patch_terms
from pipeline.optics.rigid import RigidMotion, corner_px

Float32Array = NDArray[np.float32]
Float64Array = NDArray[np.float64]

LEAST_MARGIN_PX = 4
"""Pixels along the border that patches keep clear of, however little the photographs moved."""

DRIFTING_PX = 0.2
"""Edges of scenes with outlines drift by 0.15 px at most, the most where pixels are coarse; fringes alone by 0.4."""

_PATCHES = 1500
_ENOUGH_PATCHES = 12
_SETTLED_PX = 5e-4
_BLOCKS = 8  # a side: what neighbouring patches get wrong, they get wrong together


@dataclass(frozen=True)
class Motions:
    """Where the content of each of K photographs lies, relative to the first.

    Attributes
    ----------
    shift_px : ndarray of shape (K, 2), float64
        Of the picture's centre, rows downwards and columns to the right; the first is (0, 0).
    turn_rad : ndarray of shape (K,), float64
        About the picture's centre, anticlockwise as seen; the first is 0.
    covariance : ndarray of shape (K, 3, 3), float64
        Of shift down, shift to the right and turn, from the scatter between the parts of the picture; infinite where
        the photographs do not tell. What sampling does to all edges alike, some thousandths of a pixel, is not in it.
    last_step_px : float
        By how much the last step of the iteration changed a motion, at most.
    settled : bool
        Whether that was a thousandth of a pixel, or a tenth of the motion's own standard deviation.
    misfit : float
        Mean logarithm of the energy that the patches leave unexplained.
    drift_px, turn_drift_px : float
        By how much the edges that tell shifts, and those that tell turns, seem to move by themselves, in ways that no
        motion of the photographs explains: fringes do, where the orientation of the gratings changes continuously. That
        of turns is measured at the picture's corners.
    turn_deviation_px : float
        Standard deviation of the worst known turn at the picture's corners.
    """

    shift_px: Float64Array
    turn_rad: Float64Array
    covariance: Float64Array
    last_step_px: float = 0.0
    settled: bool = True
    misfit: float = 0.0
    drift_px: float = 0.0
    turn_drift_px: float = 0.0
    turn_deviation_px: float = 0.0

    @property
    def tells_turns(self) -> bool:
        """Whether turns can be believed: the steps came to an end, and enough edges that keep still tell them."""
        return self.settled and max(self.turn_drift_px, self.turn_deviation_px) < DRIFTING_PX

    def of(self, photo: int) -> RigidMotion:
        """Where the points of the first photograph lie in this one."""
        down, right = self.shift_px[photo]
        return RigidMotion(float(self.turn_rad[photo]), (float(down), float(right)))

    def among(self, photos: Sequence[int], count: int) -> Motions:
        """Those of ``count`` photographs: these are of ``photos``, and of the others nothing is known."""
        chosen, whole = list(photos), still(count)
        for name in ("shift_px", "turn_rad", "covariance"):
            getattr(whole, name)[chosen] = getattr(self, name)
        return replace(self, shift_px=whole.shift_px, turn_rad=whole.turn_rad, covariance=whole.covariance)

    def reach_px(self, shape: tuple[int, ...]) -> float:
        """By how much the farthest moved photograph's corners may have moved."""
        return float(np.max(np.hypot(*self.shift_px.T) + np.abs(self.turn_rad) * corner_px(shape)))

    @property
    def deviation_px(self) -> Float64Array:
        """Standard deviation of each shift along its worse known axis, shape (K,)."""
        shifts = self.covariance[:, :2, :2]
        known = np.isfinite(shifts[:, 0, 0])
        worse = np.linalg.eigvalsh(np.where(np.isfinite(shifts), shifts, 0.0))[:, -1]
        return np.where(known, np.sqrt(np.maximum(worse, 0)), np.inf)

    @property
    def deviation_rad(self) -> Float64Array:
        """Standard deviation of each turn, shape (K,)."""
        return np.sqrt(self.covariance[:, 2, 2])


def too_small(shape: tuple[int, int]) -> bool:
    """Whether pictures of this shape do not hold as many patches as motions are found from."""
    down, across = (max(0, side - 2 * LEAST_MARGIN_PX) // SIZE for side in shape)
    return down * across < _ENOUGH_PATCHES


def still(count: int) -> Motions:
    """No motion, of which nothing is known."""
    return unknown([RigidMotion()] * count)


def unknown(motions: list[RigidMotion]) -> Motions:
    """Motions of which nothing is known."""
    return Motions(
        np.array([motion.shift_px for motion in motions]),
        np.array([motion.turn_rad for motion in motions]),
        np.full((len(motions), 3, 3), np.inf),
        misfit=np.inf,
    )


def fine_motions(
    coefficients: Float32Array,
    start: Motions,
    valid: NDArray[np.bool_],
    *,
    rigid: bool,
    steps: int = 20,
    margin: int | None = None,
) -> Motions:
    """Refine motions by the model of one pattern per patch and one contrast per patch and photograph.

    Gauss-Newton on the motions of all photographs at once, with pattern and contrasts eliminated: a photograph is part
    of the pattern that it is compared with, so that steps of one photograph after the other would fall short.

    Parameters
    ----------
    coefficients : ndarray of shape (K, M, N), float32
        From :func:`pipeline.optics.edge_patches.edge_coefficients`.
    start : Motions
        Right to about one pixel in most places.
    valid : ndarray of shape (M, N), bool
        Patches that touch other pixels are not used.
    rigid : bool
        Whether photographs may have turned; if not, turns are zero.
    steps : int
        At most; the loop ends when no step moves a corner by half a thousandth of a pixel.
    margin : int or None
        Pixels left out along the border; None for as many as the start moves a corner by, and four more.

    Notes
    -----
    With the rank-one model ``Y = v e^T`` of a patch's photographs, the residual ``(I - v v^T) dY (I - e e^T)`` changes
    with the motions as ``b_k b_l (delta_kl - v_k v_l) M``, where ``b = |b| v`` are the contrasts and ``M`` the products
    of the pattern's slopes: variable projection as in Kaufman, BIT 15 (1975). The covariance is the sandwich estimate,
    clustered by blocks of the picture (Liang and Zeger, Biometrika 73, 1986).
    """
    shape = valid.shape
    lever = corner_px(shape)
    turn = start.turn_rad - start.turn_rad[0] if rigid else np.zeros(len(coefficients))
    motion = np.column_stack([start.shift_px - start.shift_px[0], turn * lever])
    if margin is None:
        margin = int(np.ceil(start.reach_px(shape))) + LEAST_MARGIN_PX
    centres = edge_patches(coefficients, valid, margin=margin, count=_PATCHES)
    if len(centres) < _ENOUGH_PATCHES:
        return still(len(coefficients))
    blocks = np.unique((centres * _BLOCKS // np.max(shape)).astype(int) @ np.array([_BLOCKS, 1]), return_inverse=True)[
        1
    ]
    free = 3 if rigid else 2
    length, misfit, covariance = np.zeros(len(coefficients)), np.inf, np.full((len(coefficients), 3, 3), np.inf)
    before, stretched = np.zeros_like(motion), True
    for _ in range(steps):
        terms = patch_terms(coefficients, centres, motion[:, :2], motion[:, 2] / lever)
        misfit = float(np.mean(np.log(np.maximum(terms.unexplained, 1e-12))))
        step, covariance = _step(terms, blocks, free)
        length = np.linalg.norm(step, axis=1)
        if length.max() < _SETTLED_PX:
            motion = motion + step
            break
        # Patches of two patterns make steps fall short by a constant ratio, which two steps tell (Aitken).
        ratio = 0.0 if stretched else np.clip(np.sum(step * before) / np.sum(before**2), 0, 0.9)
        stretched, before = ratio > 0.2, step
        step = step / (1 - ratio) if stretched else step
        motion = motion + step * np.minimum(1, 1 / np.maximum(np.linalg.norm(step, axis=1), 1e-12))[:, None]
    unit = np.array([1, 1, 1 / lever])
    scaled = covariance * unit[:, None] * unit
    deviation = np.sqrt(np.trace(covariance, axis1=1, axis2=2))
    settled = bool((length < np.maximum(2 * _SETTLED_PX, 0.1 * deviation)).all())
    return Motions(
        shift_px=motion[:, :2],
        turn_rad=motion[:, 2] / lever,
        covariance=scaled,
        last_step_px=float(length.max()),
        settled=settled,
        misfit=misfit,
        drift_px=_drift_px(terms, slice(0, 2)),
        turn_drift_px=_drift_px(terms, slice(2, 3)),
        turn_deviation_px=float(
            np.sqrt(np.max(covariance[:, 2, 2], where=np.isfinite(covariance[:, 2, 2]), initial=0))
        ),
    )


def _step(terms: PatchTerms, blocks: NDArray[np.int_], free: int) -> tuple[Float64Array, Float64Array]:
    """One Gauss-Newton step (K, 3) for all photographs, and the covariance (K, 3, 3) of each against the first."""
    count = terms.contrast.shape[1]
    weight = _weights(terms)
    own, coupled = _normal(terms, terms.metric[:, :free, :free], weight)
    pull = -terms.pull[..., :free] * (terms.contrast * weight[:, None])[..., None]
    step, covariance = np.zeros((count, 3)), np.full((count, 3, 3), np.inf)
    known = np.array([np.linalg.cond(block) < 1e8 for block in own])
    moving = np.flatnonzero(known[1:]) + 1
    size = len(moving) * free
    normal = coupled[moving][:, :, moving].reshape(size, size)
    if not known[0] or not size or np.linalg.cond(normal) > 1e12:
        return step, covariance
    pulls = pull[:, moving].reshape(-1, size)
    step[moving, :free] = np.linalg.solve(normal, pulls.sum(axis=0)).reshape(-1, free)
    _, told = _normal(terms, (terms.metric - terms.noise_metric)[:, :free, :free], weight)
    value, axes = np.linalg.eigh(told[moving][:, :, moving].reshape(size, size))
    inverse = axes / np.maximum(value, 1e-6 * value[-1]) @ axes.T
    covariance[0] = 0
    covariance[moving] = 0
    covariance[moving, :free, :free] = _clustered(inverse, pulls, blocks, free)
    return step, covariance


def _normal(terms: PatchTerms, metric: Float64Array, weight: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Normal matrix of each photograph alone, (K, D, D), and of all together, (K, D, K, D)."""
    power = terms.contrast**2
    total = np.maximum(power.sum(axis=1), 1e-20)
    own = np.einsum("p,pk,pde->kde", weight, power, metric)
    coupled = -np.einsum("pk,pl,pde->kdle", (weight / total)[:, None] * power, power, metric, optimize=True)
    coupled[np.arange(len(own)), :, np.arange(len(own))] += own
    return own, coupled


def _weights(terms: PatchTerms) -> Float64Array:
    return terms.certainty / (terms.disturbance + 1e-3 * np.median(terms.disturbance) + 1e-20)


def _drift_px(terms: PatchTerms, axes: slice) -> float:
    """Drift of the patterns that tell these components of the motions, as their weighted median."""
    told = np.diagonal(terms.metric - terms.noise_metric, axis1=1, axis2=2)[:, axes].mean(axis=1)
    steepness = np.maximum(told, 0)
    drift = np.sqrt(terms.second / np.maximum(steepness, 1e-20))
    order = np.argsort(drift)
    share = np.cumsum((_weights(terms) * steepness)[order])
    return float(drift[order][min(np.searchsorted(share, share[-1] / 2), len(order) - 1)])


def _clustered(inverse: Float64Array, pulls: Float64Array, blocks: NDArray[np.int_], free: int) -> Float64Array:
    """Covariance of each photograph: from blocks of patches, or from single patches where that is more."""
    by_block = np.zeros((blocks.max() + 1, pulls.shape[1]))
    np.add.at(by_block, blocks, pulls)
    found = []
    for parts in (by_block, pulls):
        spread = inverse @ (parts.T @ parts) @ inverse * (len(parts) / max(len(parts) - 1, 1))
        photos = spread.reshape(len(inverse) // free, free, -1, free)
        found.append(np.einsum("kdke->kde", photos))
    more = np.trace(found[0], axis1=1, axis2=2) > np.trace(found[1], axis1=1, axis2=2)
    return np.where(more[:, None, None], *found)
