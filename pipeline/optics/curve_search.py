"""Which response curve a cloud of measured Stokes parameters lies on.

Brightness and orientation are every pixel's own, so all that a pixel says about the sample is how far its point lies
from the curve: a few unknowns from thousands of distances. The distances have false minima, of clearly higher cost, so
the search starts from a grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from pipeline.optics.angles import axial_difference
from pipeline.optics.response_curve import FilmedGrating, ResponseCurve, StokesNoise, relative_stokes, response_curve

Float64Array = NDArray[np.float64]

NAMES = ("amplitude_ratio", "phase_rad", "retardation_rad", "film_axis_rad")
_LOW = np.array([np.log(0.5), 0.0, -np.pi / 2, -np.inf])
_HIGH = np.array([np.log(2.0), np.pi, np.pi / 2, np.inf])
_EXPECTED = np.array([0.0, np.pi / 2, 0.0, 0.0])
_PRIOR = np.array([0.3, np.pi / 2, np.pi / 4, np.pi / 2])
"""Standard deviations about ``_EXPECTED`` of what is usual: they decide what the points leave open, no more."""
_RATIOS = (0.85, 0.95, 1.0, 1.05, 1.2)
_PHASES_DEG = np.arange(5.0, 180.0, 10.0)
_RETARDATIONS_DEG = (0.0, 2.0, 5.0, 8.0, 12.0, 16.0, 20.0, 25.0, 30.0, 37.0, 45.0, 60.0, 75.0)
_AXES_DEG = np.arange(0.0, 180.0, 15.0)
_COARSE_POINTS, _COARSE_STEPS = 250, 120
_STARTS, _MIDDLE_POINTS, _FINAL = 24, 400, 4
_STEPS = 720
_ROBUST = 2.0
_BLUNT = np.array([0.08, np.deg2rad(15), np.deg2rad(6), np.deg2rad(20)])
_SHARP = _BLUNT / 2
"""Starts are farther apart than this, in some unknown."""
_WEIGHED_CELLS, _WEIGHED_STEPS, _STRIDE, _ROUNDS = 1_000_000, (200, 4000), 0.7, 60
_APART = np.array([0.03, 0.03, 0.02, 0.05])
"""Minima nearer to each other than this, in all unknowns, are one."""
_STRAY = 0.02
"""Density of points that mix two orientations, anywhere in the unit disc, relative to that of the others."""


@dataclass(frozen=True)
class CurveFit:
    """The curve that points lie on, and how well they tell.

    Attributes
    ----------
    grating : FilmedGrating
        What the sample has in common.
    deviation : FilmedGrating
        Standard deviations of its parts; what was given has none.
    covariance : ndarray of shape (U, U)
        Of the U unknowns, in the order of ``unknowns``; the ratio by its logarithm.
    unknowns : tuple of int
        Which of ratio, phase, retardation and axis were searched for.
    misfit : float
        Robust root mean square distance of the points from the curve, relative to their noise; 1 for a perfect model.
    rivals : tuple of FilmedGrating
        Other minima that the points cannot tell from this one.
    """

    grating: FilmedGrating
    deviation: FilmedGrating
    covariance: Float64Array
    unknowns: tuple[int, ...]
    misfit: float
    rivals: tuple[FilmedGrating, ...]


@dataclass(frozen=True)
class Points:
    """Measured Stokes parameters of some pixels.

    Attributes
    ----------
    stokes : ndarray of shape (P, 2)
        ``(s1, s2)``.
    scale : ndarray of shape (P,)
        Root of noise over brightness: the noise of a point is this times that of a pixel of one electron.
    polarizer_rad, photo_weights : ndarray of shape (K,)
        How they were found.
    """

    stokes: Float64Array
    scale: Float64Array
    polarizer_rad: Float64Array
    photo_weights: Float64Array

    def take(self, count: int) -> Points:
        """About ``count`` of them, evenly spread."""
        step = max(1, len(self.stokes) // count)
        return Points(self.stokes[::step], self.scale[::step], self.polarizer_rad, self.photo_weights)


def find_curve(points: Points, known: dict[str, float]) -> CurveFit:
    """Search the curve from a grid of starts; ``known`` gives what need not be searched, by its name in ``NAMES``."""
    given = np.array([known.get(name, np.nan) for name in NAMES])
    given[0] = np.log(given[0])
    unknowns = tuple(int(i) for i in np.flatnonzero(np.isnan(given)))
    if not unknowns:
        problem = _Problem(points, given, unknowns)
        return _described(problem, np.zeros(0), [])
    starts = _starts(points, given, unknowns)
    rough = _Problem(points.take(_MIDDLE_POINTS), given, unknowns)
    fine = _Problem(points, given, unknowns)
    refined = fine.ranked([rough.descend(start) for start in starts])
    final = fine.ranked([fine.descend(x, times=2) for _, x in refined[:_FINAL]])
    return _described(fine, final[0][1], [x for cost, x in final[1:] if cost - final[0][0] < _UNDECIDED])


_UNDECIDED = 12.0
"""Difference of two log likelihoods below which the points do not decide between two curves."""


class _Problem:
    """Distances of points from the curve of given unknowns, in units of their noise."""

    def __init__(self, points: Points, given: Float64Array, unknowns: tuple[int, ...]) -> None:
        self.points, self.given, self.unknowns = points, given, unknowns
        self.noise = StokesNoise(points.polarizer_rad, points.photo_weights)
        self.scale = 1.0

    def grating(self, x: Float64Array) -> FilmedGrating:
        whole = self.given.copy()
        whole[list(self.unknowns)] = x
        return FilmedGrating(float(np.exp(whole[0])), *(float(v) for v in whole[1:]))

    def curve(self, x: Float64Array) -> ResponseCurve:
        return response_curve(self.grating(x), _STEPS)

    def distances(self, x: Float64Array) -> tuple[Float64Array, NDArray[np.int_], Float64Array]:
        """Signed distance of every point, its nearest place on the curve, and the direction it is measured along."""
        curve = self.curve(x)
        nearest = cKDTree(curve.stokes).query(self.points.stokes)[1]
        normal = np.stack([-curve.slope[:, 1], curve.slope[:, 0]], axis=1)
        noise = self.noise.covariance(curve.stokes)
        width = np.sqrt((normal[:, None, :] @ noise @ normal[:, :, None])[:, 0, 0])
        along = (normal / np.maximum(width, 1e-12)[:, None])[nearest] / self.points.scale[:, None]
        return ((self.points.stokes - curve.stokes[nearest]) * along).sum(axis=1), nearest, along

    def residuals(self, x: Float64Array) -> Float64Array:
        unlikely = (x - _EXPECTED[list(self.unknowns)]) / _PRIOR[list(self.unknowns)]
        return np.concatenate([self.distances(x)[0] / self.scale, unlikely])

    def jacobian(self, x: Float64Array) -> Float64Array:
        """Of the residuals; where on the curve the nearest place lies does not change a distance to first order."""
        _, nearest, along = self.distances(x)
        columns = [-(self.change(x, k)[nearest] * along).sum(axis=1) / self.scale for k in range(len(x))]
        return np.concatenate([np.stack(columns, axis=1), np.diag(1 / _PRIOR[list(self.unknowns)])])

    def change(self, x: Float64Array, k: int) -> Float64Array:
        """Derivative of the curve's points with respect to an unknown."""
        step = np.zeros_like(x)
        step[k] = 1e-5
        return (self.curve(x + step).stokes - self.curve(x - step).stokes) / 2e-5

    def descend(self, start: Float64Array, times: int = 1) -> Float64Array:
        """The minimum below a start; the scale of the residuals is what they turn out to be."""
        low, high = _LOW[list(self.unknowns)], _HIGH[list(self.unknowns)]
        x = np.clip(start, low + 1e-9, high - 1e-9)
        for _ in range(times):
            self.scale = max(1.0, _robust_rms(self.distances(x)[0]))
            found = least_squares(
                self.residuals, x, self.jacobian, bounds=(low, high), loss="cauchy", f_scale=_ROBUST, max_nfev=40
            )
            x = found.x
        return x

    def ranked(self, places: list[Float64Array]) -> list[tuple[float, Float64Array]]:
        """Places, each once, by how unlikely they make the points, the least first.

        Distances alone would prefer a curve that winds through the whole cloud and so comes near to every point. How
        common each orientation is is unknown, and is found by expectation maximisation.
        """
        kept: list[Float64Array] = []
        for x in places:
            if all((np.abs(x - other) > _APART[list(self.unknowns)]).any() for other in kept):
                kept.append(x)
        scale = max(1.0, min(_robust_rms(self.distances(x)[0]) for x in kept))
        return sorted(((self.unlikelihood(x, scale), x) for x in kept), key=lambda pair: pair[0])

    def unlikelihood(self, x: Float64Array, scale: float) -> float:
        """Negative logarithm of the points' likelihood, the shares of all orientations being those that fit best.

        The curve is sampled evenly in units of the noise: steps wider than it would favour curves that are slow where
        the points are, or whose samples hit the facets.
        """
        curve = self.curve(x)
        typical = scale * float(np.median(self.points.scale))
        towards = np.linalg.solve(self.noise.covariance(curve.stokes), curve.slope[:, :, None])[:, :, 0]
        speed = np.sqrt((towards * curve.slope).sum(axis=1)) / typical
        length = np.concatenate([[0.0], np.cumsum(speed) * np.pi / _STEPS])
        count = int(np.clip(length[-1] / _STRIDE, *_WEIGHED_STEPS))
        theta = np.interp(np.arange(count) * (length[-1] / count), length, np.linspace(0, np.pi, _STEPS + 1))
        points = self.points.take(_WEIGHED_CELLS // count)
        places = np.stack(relative_stokes(theta, self.grating(x))[1:], axis=1)
        blunter = max(1.0, length[-1] / count / _STRIDE)
        covariance = (blunter * typical) ** 2 * self.noise.covariance(places)
        height = 1 / np.sqrt(np.linalg.det(covariance))
        density = _densities(points.stokes, places, np.linalg.inv(covariance), height)
        return float(_unlikelihood(density, _STRAY, _ROUNDS)) * len(self.points.stokes) / len(points.stokes)


@njit(cache=True, error_model="numpy")
def _densities(points: Any, places: Any, inverse: Any, height: Any) -> Any:
    """Gaussian density of every point (P) around every place of a curve (T)."""
    density = np.empty((len(points), len(places)), np.float32)
    for p in range(len(points)):
        for t in range(len(places)):
            x, y = points[p, 0] - places[t, 0], points[p, 1] - places[t, 1]
            square = inverse[t, 0, 0] * x * x + 2 * inverse[t, 0, 1] * x * y + inverse[t, 1, 1] * y * y
            density[p, t] = height[t] * np.exp(-0.5 * square) / (2 * np.pi) if square < 60 else 0.0
    return density


@njit(cache=True, error_model="numpy", fastmath=True)
def _unlikelihood(density: Any, stray: float, rounds: int) -> float:
    """Negative logarithm of the likelihood of a mixture of T places, after so many rounds for their shares."""
    count, places = density.shape
    share = np.full(places, np.float32(1 / places))
    votes = np.empty(places, np.float32)
    total = 0.0
    for r in range(rounds + 1):
        votes[:] = 0
        total = 0.0
        for p in range(count):
            whole = np.float32(stray)
            for t in range(places):
                whole += density[p, t] * share[t]
            total -= np.log(np.float64(whole))
            weight = np.float32(1) / whole
            for t in range(places):
                votes[t] += density[p, t] * weight
        if r < rounds:
            share *= votes
            share /= share.sum()
    return total


def _robust_rms(values: Float64Array) -> float:
    return float(1.4826 * np.median(np.abs(values)))


def _starts(points: Points, given: Float64Array, unknowns: tuple[int, ...]) -> list[Float64Array]:
    """The places of a grid whose curves lie nearest to the points, no two of them neighbours."""
    axes: list[Any] = [np.log(_RATIOS), np.deg2rad(_PHASES_DEG), np.deg2rad(_RETARDATIONS_DEG), np.deg2rad(_AXES_DEG)]
    if 3 not in unknowns:  # with a known axis the film may delay either of its directions
        axes[2] = np.concatenate([axes[2], -axes[2][1:]])
    for i in range(4):
        if i not in unknowns:
            axes[i] = given[i : i + 1]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)
    few = points.take(_COARSE_POINTS)
    theta = np.arange(_COARSE_STEPS) * np.pi / _COARSE_STEPS
    gratings = np.concatenate([np.exp(grid[:, :1]), grid[:, 1:]], axis=1)
    _, s1, s2 = relative_stokes(theta, gratings[:, None, :])
    spread = float(np.sqrt(few.stokes.var(axis=0).sum()))
    noise = float(np.median(few.scale))
    chosen: list[Float64Array] = []
    # A blunt cost leads to wide valleys, a sharp one to narrow ones, as of curves with cusps.
    for softness, apart in ((max(3 * noise, 0.05 * spread), _BLUNT), (max(noise, 0.01 * spread), _SHARP)):
        costs = _coarse_costs(s1, s2, few.stokes, 1 / softness**2)
        goal = len(chosen) + _STARTS // 2
        for place in grid[np.argsort(costs)]:
            if all((np.abs(place - other) > apart).any() for other in chosen):
                chosen.append(place)
            if len(chosen) == goal:
                break
    return [place[list(unknowns)] for place in chosen]


@njit(cache=True, error_model="numpy")
def _coarse_costs(s1: Any, s2: Any, points: Any, sharpness: float) -> Any:
    costs = np.empty(len(s1))
    for g in range(len(s1)):
        cost = 0.0
        for p in range(len(points)):
            x, y = points[p, 0], points[p, 1]
            least = 1e9
            for t in range(s1.shape[1]):
                u, v = s1[g, t] - x, s2[g, t] - y
                least = min(least, u * u + v * v)
            cost += np.log1p(least * sharpness)
        costs[g] = cost
    return costs


def _described(problem: _Problem, x: Float64Array, others: list[Float64Array]) -> CurveFit:
    distances = problem.distances(x)[0]
    misfit = _robust_rms(distances)
    problem.scale = max(1.0, misfit)
    covariance = np.zeros((len(x), len(x)))
    if len(x):
        jacobian = problem.jacobian(x)
        weights = np.ones(len(jacobian))
        weights[: len(distances)] = 1 / (1 + (distances / problem.scale / _ROBUST) ** 2)
        covariance[:] = np.linalg.inv(jacobian.T @ (jacobian * weights[:, None]))
    deviation = np.zeros(4)
    deviation[list(problem.unknowns)] = np.sqrt(np.diag(covariance))
    grating = problem.grating(x)
    deviation[0] *= grating.amplitude_ratio
    return CurveFit(
        grating,
        FilmedGrating(*(float(v) for v in deviation)),
        covariance,
        problem.unknowns,
        misfit,
        tuple(problem.grating(other) for other in others),
    )


def turn_by_unknowns(fit: CurveFit, curve: ResponseCurve, metric: Float64Array) -> Float64Array:
    """How orientations read off the curve change with each unknown: derivative of shape (T, U).

    ``metric`` (T, 2) gives the change of the orientation with that of a point, as :func:`reading` does. A point stays
    where it was measured while the curve moves below it.
    """
    given = np.array([np.log(fit.grating.amplitude_ratio), *(getattr(fit.grating, name) for name in NAMES[1:])])
    columns = []
    for i in fit.unknowns:
        changed = []
        for step in (1e-5, -1e-5):
            x = given.copy()
            x[i] += step
            changed.append(
                response_curve(FilmedGrating(float(np.exp(x[0])), *(float(v) for v in x[1:])), len(curve.stokes)).stokes
            )
        columns.append(-((changed[0] - changed[1]) / 2e-5 * metric).sum(axis=1))
    return np.stack(columns, axis=1) if columns else np.zeros((len(curve.stokes), 0))


def rival_turn(fit: CurveFit, rival: FilmedGrating, stokes: Float64Array) -> Float64Array:
    """Signed turn from the orientation that the curve gives to each of some points to that of a rival, in radians."""
    angles = []
    for grating in (rival, fit.grating):
        curve = response_curve(grating, _STEPS)
        angles.append(curve.orientation_rad[cKDTree(curve.stokes).query(stokes)[1]])
    return axial_difference(*angles)
