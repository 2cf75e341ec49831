"""A sheet of gratings in a light probe: one evaluator for each way of summing its light."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from pipeline.devices.virtual_light import Image
from pipeline.devices.virtual_sheet import Sheet, offsets, shown, shown_slopes
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
_SPENT_ON_STEPS = 0.7
"""Share of the tolerance that coarse wavelengths may use up; the rest is for look-ups that are left out."""
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
    samples: int = 1,
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
    samples : int
        Points along each side of a pixel.
    tolerance : float
        Error relative to the largest value that fast evaluators may make.
    """
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    if not np.isfinite(sheet.period_um).any():
        return rgb
    paint = _chosen(_Scene(sheet, view, probe, gratings, samples, tolerance), evaluator, wavelength_step_nm)
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
    samples: int
    tolerance: float

    @property
    def periods_um(self) -> tuple[float, float]:
        """The shortest and the longest."""
        return float(np.nanmin(self.sheet.period_um)), float(np.nanmax(self.sheet.period_um))

    @property
    def points(self) -> int:
        """For which radiance is needed."""
        return self.view.rows * self.view.columns * self.samples**2

    def orders(self, step_nm: float) -> delta.Orders:
        """Of the sheet's gratings."""
        return delta.tabulated_orders(
            wavelength_step_nm=step_nm,
            depth_um=self.gratings.depth_um,
            longest_period_um=self.periods_um[1],
            form=self.gratings.form,
            normal_reflectance=self.gratings.normal_reflectance,
        )

    def some(self, side: int) -> _Part:
        """What some of its pixels show, at most ``side`` of them along a side."""
        every = max(1, -(-max(self.view.rows, self.view.columns) // side))
        row, column = np.nonzero(shown(self.sheet.gratings, self.view)[2] > 0)
        # From the first pixels between which most have gratings: fine patterns may leave the others dark.
        down, across = divmod(int(np.bincount(row % every * every + column % every, minlength=1).argmax()), every)
        few = self.view.moved(across, down).thinned(every)
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


def _chosen(scene: _Scene, evaluator: Evaluator, wavelength_step_nm: float | None) -> Paint:
    """What paints rows, by the evaluator that is asked for, or that pays."""
    insists = evaluator != "auto"
    if not insists:
        evaluator = "reference" if scene.points < _WORTH_CHOOSING else "low_rank" if _many(scene) else "ordered"
        _log.info("Evaluator %s, for %d points of the sheet.", evaluator, scene.points)
    if evaluator == "brute":
        return _brute(scene, wavelength_step_nm or FINE_NM)
    if evaluator == "reference":
        return _reference(scene, wavelength_step_nm or FINE_NM)
    area = area_map(scene.probe, all_around=scene.sheet.bumps is not None)
    look_ups = _most_important(scene, area, wavelength_step_nm)
    if evaluator == "ordered":
        return _looking_up(scene, area, look_ups)
    if scene.sheet.bumps is not None:
        _log.warning("A sheet with bumps has no low rank: its look-ups are ordered.")
        return _looking_up(scene, area, look_ups)
    return _separated(scene, area, look_ups, insists)


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


def _looking_up(scene: _Scene, area: AreaMap, look_ups: LookUps) -> Paint:
    def paint(rgb: Image, span: Span, gratings: Image, view: View, slopes: Image | None) -> None:
        ordered.shade_rows(
            rgb, span, gratings, view=view, probe=scene.probe, map_=area, look_ups=look_ups, slopes=slopes
        )

    return paint


def _most_important(scene: _Scene, area: AreaMap, wavelength_step_nm: float | None) -> LookUps:
    """The coarsest wavelengths and the fewest look-ups that keep the tolerance on some of the pixels."""
    checked, tolerance = scene.some(_CHECKED), scene.tolerance
    exact = checked.painted(_reference(scene, FINE_NM))
    period = float(np.nanmedian(scene.sheet.period_um))
    for step in STEPS_NM if wavelength_step_nm is None else (wavelength_step_nm,):
        every = ordered.all_look_ups(scene.orders(step), area, period)
        if _error(checked.painted(_looking_up(scene, area, every)), exact) <= _SPENT_ON_STEPS * tolerance:
            break
    ranked = scene.some(_RANKED)
    each = np.zeros((len(every), ranked.view.rows, ranked.view.columns, 3), np.float32)
    for k, rgb in enumerate(each):
        one = _looking_up(scene, area, every.picked(np.array([k])).without_zeroth())
        one(rgb, (0, len(rgb)), ranked.gratings, ranked.view, ranked.slopes)
    by_importance = np.argsort(-each.max(axis=(1, 2, 3)), kind="stable")
    left_out = np.cumsum(each[by_importance[::-1]], axis=0)[::-1].max(axis=(1, 2, 3))
    needed = left_out > (1 - _SPENT_ON_STEPS) * tolerance * float(exact.max())
    look_ups = every.picked(np.sort(by_importance[: int(np.count_nonzero(needed))]))
    _tell(
        f"{len(look_ups)} of {len(every)} look-ups, every {step:g} nm, the most important first,",
        _error(checked.painted(_looking_up(scene, area, look_ups)), exact),
        tolerance,
    )
    return look_ups


def _nodes(scene: _Scene) -> separated.Nodes:
    apart = _APART_TEXELS * scene.tolerance * scene.probe.texel_rad
    return separated.nodes_of(scene.view, scene.periods_um, apart)


def _many(scene: _Scene) -> bool:
    return scene.sheet.bumps is None and len(_nodes(scene)) < _WORTH_NODES * scene.points


def _separated(scene: _Scene, area: AreaMap, look_ups: LookUps, insists: bool) -> Paint:
    nodes = _nodes(scene)
    if len(nodes) > min(scene.points, _MOST_NODES):
        _log.warning("%s would be more work than all %d points: look-ups are ordered.", nodes, scene.points)
        return _looking_up(scene, area, look_ups)
    diffracted = _looking_up(scene, area, look_ups.without_zeroth())
    mirrored = _looking_up(scene, area, look_ups.picked(np.array([], np.int64)))

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
        return _looking_up(scene, area, look_ups)
    _tell(f"{nodes}, and what lies between them,", error, scene.tolerance)
    return paint


def _tell(what: str, error: float, tolerance: float) -> None:
    _log.log(
        logging.INFO if error <= tolerance else logging.WARNING,
        "%s differ from the reference by up to %.2g percent of the largest value on all but a thousandth of pixels.",
        what,
        100 * error,
    )


def _error(found: Image, exact: Image) -> float:
    """What a thousandth of the pixels exceeds, relative to the largest value."""
    lit = exact.any(axis=-1)
    if not lit.any():
        return 0.0
    return float(np.percentile(np.abs(found - exact)[lit].max(axis=-1), 99.9) / exact.max())
