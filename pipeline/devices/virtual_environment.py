"""A sheet of gratings in a light probe: one evaluator for each way of summing its light."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.virtual_light import Image
from pipeline.devices.virtual_sheet import Sheet, enough_samples, most_samples, offsets, shown, shown_slopes
from pipeline.errors import InputError
from pipeline.optics.environment import delta, ordered, separated, window
from pipeline.optics.environment.area_map import AreaMap, area_map
from pipeline.optics.environment.ordered import LookUps
from pipeline.optics.environment.probe import Probe
from pipeline.optics.gratings import Form
from pipeline.optics.sheet.view import View
from pipeline.parallel import over_rows
from pipeline.progress import advance

Evaluator = Literal["auto", "reference", "ordered", "low_rank", "brute"]

FINE_NM = 5.0
STEPS_NM = (40.0, 20.0, 10.0, 5.0)
_WORTH_CHOOSING = 20_000
"""Pixels below which the reference is done before look-ups would be chosen."""
_CHECKED = 96
"""Pixels along a side of the picture on which look-ups are chosen."""
_RANKED = 48
"""Those on which each look-up's importance is measured."""
_TILE = 8
_SPENT_ON_STEPS = 0.85
"""Share of the tolerance that coarse wavelengths may use up."""
_LEFT_OUT = (0.3, 0.15, 0.05)
"""Shares that look-ups may add up to which are left out, the next where the tolerance is not kept."""
_APART_TEXELS = 15.0
"""Between nodes, times the tolerance: at edges of the probe the error grows with the distance."""
_WORTH_NODES = 0.5
_MOST_NODES = 30_000_000

_log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Gratings:
    """What the sheet's gratings do to light.

    Attributes
    ----------
    depth_um : float
        From crest to trough.
    form : {"exact", "second order"}
        Form of the orders' shares.
    refractive_index : float or None
        For Schlick's reflectance relative to that at normal incidence; None for a mirror's, the same at all angles.
    coherence_um : float
        Width of the coherence window, which brute force alone takes into account.
    """

    depth_um: float = 0.12
    form: Form = "exact"
    refractive_index: float | None = None
    coherence_um: float = 65.0

    @property
    def normal_reflectance(self) -> float:
        """At normal incidence."""
        index = self.refractive_index
        return 1.0 if index is None else ((index - 1) / (index + 1)) ** 2


Span = tuple[int, int]
Paint = Callable[[Image, Span, Image, View, Image | None], None]
"""Adds rows to a picture, from the gratings that a view shows and the slopes that it has."""


def render_in_environment(
    sheet: Sheet,
    view: View,
    probe: Probe,
    gratings: Gratings,
    *,
    evaluator: Evaluator = "auto",
    wavelength_step_nm: float | None = None,
    samples: int | None = 1,
    tolerance: float = 0.01,
) -> Image:
    """Radiance of a sheet, linear sRGB in the probe's unit, shape (rows, columns, 3).

    Parameters
    ----------
    sheet, view, probe, gratings : Sheet, View, Probe, Gratings
        What is seen, by whom, and in what light.
    evaluator : str
        See :func:`pipeline.stages.render.environment.environment`.
    wavelength_step_nm : float, optional
        Step of the spectral sum; by default 5 nm, or as coarse as the tolerance allows where look-ups are ordered.
    samples : int, optional
        Points along each side of a pixel; None for as many as change what is shown.
    tolerance : float
        Error relative to the largest value that fast evaluators may make, and share of the light that they may lose.
    """
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    if not np.isfinite(sheet.period_um).any():
        return rgb
    scene = _Scene(sheet, view, probe, gratings, tolerance, wavelength_step_nm)
    samples = samples or _enough_samples(scene)
    paint = _chosen(scene, evaluator, view.rows * view.columns * samples**2)
    for done, offset in enumerate(offsets(samples)):
        moved = view.moved(*offset)
        grid, slopes = shown(sheet.gratings, moved), shown_slopes(sheet, moved)
        over_rows(partial(_rows, paint, rgb, grid, moved, slopes), view.rows, tile=_TILE)
        advance(done + 1, samples**2)
    rgb /= np.float32(samples**2)
    return rgb


def _rows(paint: Paint, rgb: Image, grid: Image, view: View, slopes: Image | None, first: int, last: int) -> None:
    paint(rgb, (first, last), grid, view, slopes)


@dataclass(frozen=True, eq=False)
class _Scene:
    """All that an evaluator is chosen for."""

    sheet: Sheet
    view: View
    probe: Probe
    gratings: Gratings
    tolerance: float
    wavelength_step_nm: float | None = None

    @property
    def periods_um(self) -> tuple[float, float]:
        """The shortest and the longest."""
        return float(np.nanmin(self.sheet.period_um)), float(np.nanmax(self.sheet.period_um))

    @cached_property
    def area(self) -> AreaMap:
        """The probe, for look-ups."""
        return area_map(self.probe, all_around=self.sheet.bumps is not None)

    @cached_property
    def look_ups(self) -> LookUps:
        """Those that the tolerance needs."""
        return _most_important(self)

    def orders(self, step_nm: float) -> delta.Orders:
        """Of the sheet's gratings."""
        return delta.tabulated_orders(
            wavelength_step_nm=step_nm,
            depth_um=self.gratings.depth_um,
            longest_period_um=self.periods_um[1],
            form=self.gratings.form,
            normal_reflectance=self.gratings.normal_reflectance,
        )

    def every(self, side: int) -> int:
        """Every how manieth pixel is one of at most ``side`` along a side."""
        return max(1, -(-max(self.view.rows, self.view.columns) // side))

    def some(self, side: int) -> _Part:
        """What some of its pixels show, at most ``side`` of them along a side."""
        every = self.every(side)
        # From where most have gratings: fine patterns may leave others dark, or the middles of all pixels.
        for offset in ((0.0, 0.0), *offsets(most_samples(self.sheet, self.view))):
            seen = self.view.moved(*offset)
            row, column = np.nonzero(shown(self.sheet.gratings, seen)[2] > 0)
            if row.size:
                break
        down, across = divmod(int(np.bincount(row % every * every + column % every, minlength=1).argmax()), every)
        return self.part(seen.moved(across, down).thinned(every))

    def part(self, few: View) -> _Part:
        """What a view of few pixels shows."""
        return _Part(few, shown(self.sheet.gratings, few), shown_slopes(self.sheet, few))


@dataclass(frozen=True, eq=False)
class _Part:
    """A few pixels, on which evaluators are tried."""

    view: View
    gratings: Image
    slopes: Image | None

    def painted(self, paint: Paint) -> Image:
        """What they show."""
        rgb = np.zeros((self.view.rows, self.view.columns, 3), np.float32)
        over_rows(partial(_rows, paint, rgb, self.gratings, self.view, self.slopes), self.view.rows, tile=_TILE)
        return rgb


def _enough_samples(scene: _Scene) -> int:
    """Points along a side of a pixel, chosen with ordered look-ups on some of the pixels."""
    most = most_samples(scene.sheet, scene.view)
    if most == 1:
        return 1
    paint = _looking_up(scene, scene.look_ups)
    few, every = scene.some(_CHECKED).view, scene.every(_CHECKED)

    def averaged(samples: int) -> Image:
        rgb = np.zeros((few.rows, few.columns, 3), np.float32)
        for across, down in offsets(samples):
            rgb += scene.part(few.moved(across / every, down / every)).painted(paint)
        return rgb / np.float32(samples**2)

    return enough_samples(averaged, most, scene.tolerance)


def _chosen(scene: _Scene, evaluator: Evaluator, points: int) -> Paint:
    """What paints rows, by the evaluator that is asked for, or that pays for so many points of the sheet."""
    insists = evaluator != "auto"
    if not insists:
        many = scene.sheet.bumps is None and len(_nodes(scene)) < _WORTH_NODES * points
        evaluator = "reference" if points < _WORTH_CHOOSING else "low_rank" if many else "ordered"
        _log.info("Evaluator %s, for %d points of the sheet.", evaluator, points)
    if evaluator == "brute":
        return _brute(scene, scene.wavelength_step_nm or FINE_NM)
    if evaluator == "reference":
        return _reference(scene, scene.wavelength_step_nm or FINE_NM)
    if evaluator == "ordered":
        return _looking_up(scene, scene.look_ups)
    if scene.sheet.bumps is not None:
        _log.warning("A sheet with bumps has no low rank: its look-ups are ordered.")
        return _looking_up(scene, scene.look_ups)
    return _separated(scene, points, insists)


def _reference(scene: _Scene, step_nm: float) -> Paint:
    orders = scene.orders(step_nm)

    def paint(rgb: Image, span: Span, gratings: Image, view: View, slopes: Image | None) -> None:
        delta.shade_rows(rgb, span, gratings, view=view, probe=scene.probe, orders=orders, slopes=slopes)

    return paint


def _brute(scene: _Scene, step_nm: float) -> Paint:
    orders, coherence_um = scene.orders(step_nm), scene.gratings.coherence_um
    try:
        lights = window.lights_of(
            scene.probe, coherence_um, float(orders.wavelength_um[0]), all_around=scene.sheet.bumps is not None
        )
    except ValueError as problem:
        raise InputError(str(problem), where="coherence_um", expected="a narrower one, or another evaluator") from None
    _log.info("The probe is summed as %d distant lights.", len(lights.rgb))

    def paint(rgb: Image, span: Span, gratings: Image, view: View, slopes: Image | None) -> None:
        window.shade_rows(
            rgb, span, gratings, view=view, lights=lights, orders=orders, coherence_um=coherence_um, slopes=slopes
        )

    return paint


def _looking_up(scene: _Scene, look_ups: LookUps) -> Paint:
    def paint(rgb: Image, span: Span, gratings: Image, view: View, slopes: Image | None) -> None:
        ordered.shade_rows(
            rgb, span, gratings, view=view, probe=scene.probe, map_=scene.area, look_ups=look_ups, slopes=slopes
        )

    return paint


def _most_important(scene: _Scene) -> LookUps:
    """The coarsest wavelengths and the fewest look-ups that keep the tolerance on some of the pixels."""
    checked, tolerance = scene.some(_CHECKED), scene.tolerance
    exact = checked.painted(_reference(scene, FINE_NM))
    period = float(np.nanmedian(scene.sheet.period_um))
    for step in STEPS_NM if scene.wavelength_step_nm is None else (scene.wavelength_step_nm,):
        every = ordered.all_look_ups(scene.orders(step), scene.area, period)
        if _error(checked.painted(_looking_up(scene, every)), exact) <= _SPENT_ON_STEPS * tolerance:
            break
    importance = _importance(scene, every)
    for left in _LEFT_OUT:
        kept, light = importance.kept(left * tolerance * float(exact.max()), tolerance)
        look_ups = every.picked(kept)
        error = _error(checked.painted(_looking_up(scene, look_ups)), exact)
        if error <= tolerance:
            break
    _tell(
        f"{len(look_ups)} of {len(every)} look-ups, every {step:g} nm, the most important first, "
        f"with {100 * light:.3g} percent of the light,",
        error,
        tolerance,
        "evaluator=reference sums all" if step <= FINE_NM else f"wavelength_step_nm={FINE_NM:g} is finer",
    )
    return look_ups


@dataclass(frozen=True, eq=False)
class _Importance:
    """What each look-up adds to some of the pixels.

    Attributes
    ----------
    each : ndarray of shape (K, rows, columns, 3), float32
        Radiance.
    zeroth : float
        Sum of the zeroth order's.
    """

    each: Image
    zeroth: float

    def kept(self, value: float, share: float) -> tuple[NDArray[np.integer], float]:
        """Indices without those that add up to less than a value everywhere and to a share of all light, and theirs."""
        order = np.argsort(-self.each.max(axis=(1, 2, 3)), kind="stable")
        left_out = np.cumsum(self.each[order[::-1]], axis=0)[::-1].max(axis=(1, 2, 3))
        seen = int(np.count_nonzero(left_out > value))
        # A lamp's image is far brighter than a sky, whose light may come in many look-ups that are small everywhere.
        light = self.each.sum(axis=(1, 2, 3), dtype=np.float64)
        rest = order[seen:][np.argsort(-light[order[seen:]], kind="stable")]
        total = self.zeroth + light.sum()
        dim = int(np.count_nonzero(np.cumsum(light[rest][::-1]) > share * total))
        lost = light[rest[dim:]].sum() / total if total > 0 else 0.0
        return np.sort(np.concatenate([order[:seen], rest[:dim]])), 1 - float(lost)


def _importance(scene: _Scene, every: LookUps) -> _Importance:
    ranked = scene.some(_RANKED)

    def painted(which: list[int]) -> Image:
        return ranked.painted(_looking_up(scene, every.picked(np.array(which, np.int64))))

    zeroth = painted([])
    each = [painted([k]) - zeroth for k in range(len(every))]
    return _Importance(np.array(each, np.float32).reshape(-1, *zeroth.shape), float(zeroth.sum()))


def _nodes(scene: _Scene) -> separated.Nodes:
    apart = _APART_TEXELS * scene.tolerance * scene.probe.texel_rad
    return separated.nodes_of(scene.view, scene.periods_um, apart)


def _separated(scene: _Scene, points: int, insists: bool) -> Paint:
    nodes, look_ups = _nodes(scene), scene.look_ups
    if len(nodes) > min(points, _MOST_NODES):
        _log.warning("%s would be more work than all %d points: look-ups are ordered.", nodes, points)
        return _looking_up(scene, look_ups)
    diffracted = _looking_up(scene, look_ups.without_zeroth())
    mirrored = _looking_up(scene, look_ups.picked(np.array([], np.int64)))

    def at_nodes(rgb: Image, gratings: Image, view: View) -> None:
        over_rows(partial(_rows, diffracted, rgb, gratings, view, None), view.rows, tile=_TILE)

    values = separated.worked_out(nodes, scene.view, at_nodes)
    to_pixels = np.linalg.inv(scene.view.homography)

    def paint(rgb: Image, span: Span, gratings: Image, view: View, slopes: Image | None) -> None:
        mirrored(rgb, span, gratings, view, slopes)
        moved = to_pixels @ view.homography
        every, shift = moved[0, 0] / moved[2, 2], moved[:2, 2] / moved[2, 2]
        separated.interpolate_rows(
            rgb,
            span,
            gratings,
            nodes=nodes,
            values=values,
            shift=(float(shift[0]), float(shift[1])),
            every=float(every),
        )

    checked = scene.some(_CHECKED)
    error = _error(checked.painted(paint), checked.painted(_reference(scene, FINE_NM)))
    if error > scene.tolerance and not insists:
        _log.info("Between %s values would differ by %.2g percent: look-ups are ordered.", nodes, 100 * error)
        return _looking_up(scene, look_ups)
    _tell(f"{nodes}, and what lies between them,", error, scene.tolerance, "evaluator=ordered is nearer")
    return paint


def _tell(what: str, error: float, tolerance: float, advice: str) -> None:
    kept = error <= tolerance
    (_log.info if kept else _log.warning)(
        "%s differ from the reference by up to %.2g percent of the largest value on all but a thousandth of pixels%s.",
        what,
        100 * error,
        "" if kept else f"; {advice}, tolerance={float(f'{1.1 * error:.2g}'):g} allows it",
    )


def _error(found: Image, exact: Image) -> float:
    """What a thousandth of the pixels exceeds, relative to the largest value."""
    lit = exact.any(axis=-1)
    if not lit.any():
        return 0.0
    return float(np.percentile(np.abs(found - exact)[lit].max(axis=-1), 99.9) / exact.max())
