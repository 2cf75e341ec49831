"""Which response curve a cloud of measured Stokes parameters lies on.

Brightness and orientation are every pixel's own, so all that a pixel says about the sample is how far its point lies
from the curve: a few unknowns from thousands of distances. The distances have false minima, of clearly higher cost, so
the search starts from a grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial import cKDTree

from pipeline.optics.angles import axial_difference
from pipeline.optics.curve_likelihood import unlikelihood
from pipeline.optics.curve_starts import starts
from pipeline.optics.response_curve import FilmedGrating, ResponseCurve, StokesNoise, relative_stokes, response_curve

Float64Array = NDArray[np.float64]

NAMES = ("amplitude_ratio", "phase_rad", "retardation_rad", "film_axis_rad")
_LOW = np.array([np.log(0.5), 0.0, -np.pi / 2, -np.inf])
_HIGH = np.array([np.log(2.0), np.pi, np.pi / 2, np.inf])
_EXPECTED = np.array([0.0, np.pi / 2, 0.0, 0.0])
_PRIOR = np.array([0.3, np.pi / 2, np.pi / 4, np.pi / 2])
"""Standard deviations about ``_EXPECTED`` of what is usual: they decide what the points leave open, no more."""
_STARTS, _MIDDLE_POINTS, _FINE_POINTS, _FINAL = 24, 400, 4000, 4
_AXIS_AS_GIVEN = np.deg2rad(1.0)
_ASIDE = np.deg2rad(4.0)
"""A film on either side of a curve: one without a film does not feel where it lies."""
_STEPS = 720
_FURTHEST = 20
_ROBUST = 2.0
_UNDECIDED = 12.0
"""Difference of two log likelihoods below which points do not decide between two curves, whatever their number."""
_APART = np.array([0.03, 0.03, 0.02, 0.05])
"""Minima nearer to each other than this, in all unknowns, are one."""


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
    other_axis_rad : float or None
        Where the film's axis was given but another one fits decidedly better: that one.
    """

    grating: FilmedGrating
    deviation: FilmedGrating
    covariance: Float64Array
    unknowns: tuple[int, ...]
    misfit: float
    rivals: tuple[FilmedGrating, ...]
    other_axis_rad: float | None = None


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
    systematic : float
        Error that all of them may share, in units of their noise, as from misread angles: numbers do not average it
        out.
    """

    stokes: Float64Array
    scale: Float64Array
    polarizer_rad: Float64Array
    photo_weights: Float64Array
    systematic: float

    @property
    def undecided(self) -> float:
        """Difference of two log likelihoods below which they do not decide between two curves."""
        return _UNDECIDED + len(self.stokes) * self.systematic**2 / 2

    def take(self, count: int) -> Points:
        """About ``count`` of them, evenly spread."""
        step = max(1, len(self.stokes) // count)
        return replace(self, stokes=self.stokes[::step], scale=self.scale[::step])


def find_curve(points: Points, known: dict[str, float]) -> CurveFit:
    """Search the curve from a grid of starts; ``known`` gives what need not be searched, by its name in ``NAMES``."""
    given = np.array([known.get(name, np.nan) for name in NAMES])
    given[0] = np.log(given[0])
    unknowns = tuple(int(i) for i in np.flatnonzero(np.isnan(given)))
    if not unknowns:
        problem = _Problem(points, given, unknowns)
        return _described(problem, np.zeros(0), [])
    begin = starts(points.stokes, float(np.median(points.scale)), given, _STARTS)
    rough = _Problem(points.take(_MIDDLE_POINTS), given, unknowns)
    fine = _Problem(points.take(_FINE_POINTS), given, unknowns)
    refined = fine.ranked([rough.descend(start[list(unknowns)], tolerance=1e-4) for start in begin])
    best = [x for _, x in refined[:_FINAL]]
    if 2 in unknowns:
        aside = _ASIDE * np.eye(4)[2, list(unknowns)]
        away = [rough.descend(x + side, tolerance=1e-4) for x in best[:2] for side in (aside, -aside)]
        refined = fine.ranked([*best, *away])
    final = fine.ranked([fine.descend(x, times=2) for _, x in refined[:_FINAL]], evident=True)
    whole = _Problem(points, given, unknowns)
    close = [whole.descend(x, times=2) for x in fine.undecided(final)]
    if len(close) > 1:  # more points may tell
        close = whole.undecided(whole.ranked(close, evident=True))
    found = _described(whole, close[0], close[1:])
    return found if 3 in unknowns else replace(found, other_axis_rad=_other_axis(fine, close[0]))


def _other_axis(problem: _Problem, x: Float64Array) -> float | None:
    """The axis of the film that fits decidedly better than the one given, if any does."""
    given, unknowns = problem.given.copy(), (*problem.unknowns, 3)
    given[3] = np.nan
    freed = _Problem(problem.points, given, unknowns)
    best = freed.descend(np.append(x, problem.given[3]), times=2)
    whole = freed.grating(best)
    axis_turn = axial_difference(whole.film_axis_rad, problem.given[3])
    if abs(axis_turn) < _AXIS_AS_GIVEN:
        return None
    scale = max(1.0, _robust_rms(freed.distances(best)[0]))
    better = problem.unlikelihood(x, scale) - freed.unlikelihood(best, scale)
    return float(whole.film_axis_rad) if better > problem.points.undecided else None


class _Problem:
    """Distances of points from the curve of given unknowns, in units of their noise."""

    def __init__(self, points: Points, given: Float64Array, unknowns: tuple[int, ...]) -> None:
        self.points, self.given, self.unknowns = points, given, unknowns
        self.noise = StokesNoise(points.polarizer_rad, points.photo_weights)
        self.scale = 1.0
        self._width: Float64Array | None = None
        self._measured: tuple[Float64Array, tuple[Float64Array, NDArray[np.int_], Float64Array]] | None = None

    def grating(self, x: Float64Array) -> FilmedGrating:
        whole = self.given.copy()
        whole[list(self.unknowns)] = x
        return FilmedGrating(float(np.exp(whole[0])), *(float(v) for v in whole[1:]))

    def curve(self, x: Float64Array) -> ResponseCurve:
        return response_curve(self.grating(x), _STEPS)

    def distances(
        self, x: Float64Array, width: Float64Array | None = None
    ) -> tuple[Float64Array, NDArray[np.int_], Float64Array]:
        """Signed distance of every point, its most likely place on the curve, and the direction it is measured along.

        That place is the nearest in units of the noise. Where the noise is wider in one direction it lies aside of the
        nearest as it is drawn, where errors along and across the curve would go together and turn the fit. What noise
        along a bend adds to the distances is taken off, or small curves would come out too wide.

        ``width`` (P,) is the noise of every point across the curve; None for that of its nearest place.
        """
        curve = self.curve(x)
        normal, across, aside, outside = _crosswise(curve, self.noise)
        nearest = cKDTree(curve.stokes).query(self.points.stokes)[1]
        away = ((self.points.stokes - curve.stokes[nearest]) * normal[nearest]).sum(axis=1)
        nearest = (nearest + np.rint(np.clip(away * aside[nearest], -_FURTHEST, _FURTHEST)).astype(np.int_)) % _STEPS
        if width is None:
            width = np.maximum(across[nearest] * self.points.scale, 1e-12)
        along = normal[nearest] / width[:, None]
        distance = ((self.points.stokes - curve.stokes[nearest]) * along).sum(axis=1)
        return distance - np.clip(outside[nearest] * self.points.scale, -1, 1), nearest, along

    def freeze(self, x: Float64Array) -> None:
        """Take every point's noise, and the scale of the residuals, from the curve of ``x``."""
        distances, _, along = self.distances(x)
        self.scale = max(1.0, _robust_rms(distances))
        self._width, self._measured = 1 / np.hypot(along[:, 0], along[:, 1]), None

    def measured(self, x: Float64Array) -> tuple[Float64Array, NDArray[np.int_], Float64Array]:
        """Distances in units of the frozen noise; a solver asks for residuals and Jacobian in turn."""
        if self._measured is None or not np.array_equal(self._measured[0], x):
            self._measured = x.copy(), self.distances(x, self._width)
        return self._measured[1]

    def residuals(self, x: Float64Array) -> Float64Array:
        unlikely = (x - _EXPECTED[list(self.unknowns)]) / _PRIOR[list(self.unknowns)]
        return np.concatenate([self.measured(x)[0] / self.scale, unlikely])

    def jacobian(self, x: Float64Array) -> Float64Array:
        """Of the residuals; where on the curve the nearest place lies does not change a distance to first order."""
        _, nearest, along = self.measured(x)
        changes = self.changes(x)
        columns = -(changes[:, nearest, 0] * along[:, 0] + changes[:, nearest, 1] * along[:, 1]).T / self.scale
        return np.concatenate([columns, np.diag(1 / _PRIOR[list(self.unknowns)])])

    def changes(self, x: Float64Array) -> Float64Array:
        """Derivatives of the curve's points with respect to the unknowns, shape (U, T, 2)."""
        whole = self.given.copy()
        whole[list(self.unknowns)] = x
        steps = 1e-5 * np.eye(4)[list(self.unknowns)]
        places = np.concatenate([whole + steps, whole - steps])
        places[:, 0] = np.exp(places[:, 0])
        theta = np.arange(_STEPS) * (np.pi / _STEPS)
        ahead, behind = np.split(np.stack(relative_stokes(theta, places[:, None, :])[1:], axis=-1), 2)
        return (ahead - behind) / 2e-5

    def descend(self, start: Float64Array, times: int = 1, tolerance: float = 1e-8) -> Float64Array:
        """The minimum below a start; the scale of the residuals is what they turn out to be.

        A descent takes every point's noise from the curve that it starts from: one that took it from where it goes
        would seek places of much noise.
        """
        low, high = _LOW[list(self.unknowns)], _HIGH[list(self.unknowns)]
        x = np.clip(start, low + 1e-9, high - 1e-9)
        for _ in range(times):
            self.freeze(x)
            found = least_squares(
                self.residuals,
                x,
                self.jacobian,
                bounds=(low, high),
                loss="cauchy",
                f_scale=_ROBUST,
                ftol=tolerance,
                xtol=tolerance,
                max_nfev=40,
            )
            x = found.x
        if self.unknowns[-2:] == (2, 3) and x[-2] < 0:  # the same film, named by its other axis
            x[-2:] = -x[-2], x[-1] + np.pi / 2
        if 3 in self.unknowns:
            x[-1] %= np.pi
        return x

    def ranked(self, places: list[Float64Array], *, evident: bool = False) -> list[tuple[float, Float64Array]]:
        """Places, each once, by how unlikely they make the points, the least first.

        Distances alone would prefer a curve that winds through the whole cloud and so comes near to every point. How
        common each orientation is is unknown, and is found by expectation maximisation. With ``evident``, places count
        for as much as is found around them (Laplace's approximation of the evidence): a curve that fits only if its
        unknowns have very special values is less believable than one that fits for many.
        """
        kept: list[Float64Array] = []
        for x in places:
            if all((np.abs(x - other) > _APART[list(self.unknowns)]).any() for other in kept):
                kept.append(x)
        scale = max(1.0, min(_robust_rms(self.distances(x)[0]) for x in kept))
        costs = [self.unlikelihood(x, scale) + (self.surprise(x) if evident else 0.0) for x in kept]
        return sorted(zip(costs, kept, strict=True), key=lambda pair: pair[0])

    def undecided(self, ranked: list[tuple[float, Float64Array]]) -> list[Float64Array]:
        """The best place, and those that the points do not tell from it."""
        return [x for cost, x in ranked if cost - ranked[0][0] < self.points.undecided]

    def surprise(self, x: Float64Array) -> float:
        """Negative logarithm of the share of what is usual that lies around a minimum."""
        usual = _PRIOR[list(self.unknowns)]
        away = (x - _EXPECTED[list(self.unknowns)]) / usual
        spread = self.covariance(x) / usual / usual[:, None]
        return float((away**2).sum() - np.linalg.slogdet(spread)[1]) / 2

    def covariance(self, x: Float64Array) -> Float64Array:
        """Of the unknowns at a minimum, the points weighed as its robust cost does."""
        self.freeze(x)
        jacobian = self.jacobian(x)
        weights = np.ones(len(jacobian))
        distances = self.measured(x)[0]
        weights[: len(distances)] = 1 / (1 + (distances / self.scale / _ROBUST) ** 2)
        return np.asarray(np.linalg.inv(jacobian.T @ (jacobian * weights[:, None])), np.float64)

    def unlikelihood(self, x: Float64Array, scale: float) -> float:
        """Negative logarithm of the points' likelihood, their noise ``scale`` times what photons make."""
        return unlikelihood(self.points.stokes, scale * self.points.scale, self.grating(x), self.noise)


def _crosswise(
    curve: ResponseCurve, noise: StokesNoise
) -> tuple[Float64Array, Float64Array, Float64Array, Float64Array]:
    """What distances from a curve of T samples are made of, for a pixel of one electron.

    Gives unit normals, shape (T, 2); the noise along them, (T,); how many samples further the most likely place of a
    point lies than the nearest one, per distance to its left; and the mean distance of points, in units of their noise:
    noise along a bend takes them to its outside by half its square over the radius.
    """
    speed = np.maximum(np.hypot(curve.slope[:, 0], curve.slope[:, 1]), 1e-12)
    d1, d2 = curve.slope[:, 0] / speed, curve.slope[:, 1] / speed
    covariance = noise.covariance(curve.stokes)
    c00, c01, c11 = covariance[:, 0, 0], covariance[:, 0, 1], covariance[:, 1, 1]
    across = np.maximum(c11 * d1**2 - 2 * c01 * d1 * d2 + c00 * d2**2, 1e-24)
    both = (c11 - c00) * d1 * d2 + c01 * (d1**2 - d2**2)
    step = np.pi / len(speed)
    turn = np.roll(curve.slope, -1, axis=0) - np.roll(curve.slope, 1, axis=0)
    bend = (d1 * turn[:, 1] - d2 * turn[:, 0]) / (2 * step * speed**2)
    along = np.maximum(c00 * c11 - c01**2, 0.0) / across  # variance along the curve of points at one distance from it
    aside = -both / across / (speed * step)
    return np.stack([-d2, d1], axis=1), np.sqrt(across), aside, -bend * along / (2 * np.sqrt(across))


def _robust_rms(values: Float64Array) -> float:
    return float(1.4826 * np.median(np.abs(values)))


def _described(problem: _Problem, x: Float64Array, others: list[Float64Array]) -> CurveFit:
    covariance = problem.covariance(x) if len(x) else np.zeros((0, 0))
    deviation = np.zeros(4)
    deviation[list(problem.unknowns)] = np.sqrt(np.diag(covariance))
    grating = problem.grating(x)
    deviation[0] *= grating.amplitude_ratio
    return CurveFit(
        grating,
        FilmedGrating(*(float(v) for v in deviation)),
        covariance,
        problem.unknowns,
        _robust_rms(problem.distances(x)[0]),
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
