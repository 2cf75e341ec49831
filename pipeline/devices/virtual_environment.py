"""A sheet of gratings in a light probe: one evaluator for each way of summing its light."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pipeline.devices.virtual_light import Image
from pipeline.devices.virtual_sheet import Sheet, offsets, shown, shown_slopes
from pipeline.optics.environment import delta, ordered, window
from pipeline.optics.environment.area_map import AreaMap, area_map
from pipeline.optics.environment.ordered import LookUps
from pipeline.optics.environment.probe import Probe
from pipeline.optics.gratings import Form
from pipeline.optics.sheet.maps import Tiled, prepared_gratings
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
_TILE = 8

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
    paint = _chosen(sheet, view, probe, gratings, evaluator, wavelength_step_nm, tolerance)
    planes = sheet.laid(prepared_gratings(sheet.orientation_rad, sheet.period_um))
    for done, offset in enumerate(offsets(samples)):
        _painted(rgb, paint, planes, sheet, view.moved(*offset))
        advance(done + 1, samples**2)
    rgb /= np.float32(samples**2)
    return rgb


def _painted(rgb: Image, paint: Paint, planes: Tiled, sheet: Sheet, view: View) -> None:
    gratings, slopes = shown(planes, view), shown_slopes(sheet, view)
    over_rows(lambda first, last: paint(rgb, (first, last), gratings, view, slopes), view.rows, tile=_TILE)


def _chosen(
    sheet: Sheet,
    view: View,
    probe: Probe,
    gratings: Gratings,
    evaluator: Evaluator,
    wavelength_step_nm: float | None,
    tolerance: float,
) -> Paint:
    """What paints rows, by the evaluator that is asked for, or that pays."""
    if evaluator == "auto":
        evaluator = "reference" if view.rows * view.columns < _WORTH_CHOOSING else "ordered"
        _log.info("%s pixels: evaluator %s.", view.rows * view.columns, evaluator)
    if evaluator == "ordered":
        return _ordered(sheet, view, probe, gratings, wavelength_step_nm, tolerance)
    orders = _orders(sheet, gratings, wavelength_step_nm or FINE_NM)
    if evaluator == "brute":
        return _brute(sheet, probe, gratings, orders)
    return _reference(probe, orders)


def _reference(probe: Probe, orders: delta.Orders) -> Paint:
    def paint(rgb: Image, span: Span, shown_: Image, view: View, slopes: Image | None) -> None:
        delta.shade_rows(rgb, span, shown_, view=view, probe=probe, orders=orders, slopes=slopes)

    return paint


def _brute(sheet: Sheet, probe: Probe, gratings: Gratings, orders: delta.Orders) -> Paint:
    lights = window.lights_of(
        probe, gratings.coherence_um, float(orders.wavelength_um[0]), all_around=sheet.bumps is not None
    )
    _log.info("The probe is summed as %d distant lights.", len(lights.rgb))

    def paint(rgb: Image, span: Span, shown_: Image, view: View, slopes: Image | None) -> None:
        window.shade_rows(
            rgb,
            span,
            shown_,
            view=view,
            lights=lights,
            orders=orders,
            coherence_um=gratings.coherence_um,
            slopes=slopes,
        )

    return paint


def _looking_up(probe: Probe, area: AreaMap, look_ups: LookUps) -> Paint:
    def paint(rgb: Image, span: Span, shown_: Image, view: View, slopes: Image | None) -> None:
        ordered.shade_rows(rgb, span, shown_, view=view, probe=probe, map_=area, look_ups=look_ups, slopes=slopes)

    return paint


def _ordered(
    sheet: Sheet, view: View, probe: Probe, gratings: Gratings, wavelength_step_nm: float | None, tolerance: float
) -> Paint:
    """The coarsest wavelengths and the fewest look-ups that keep the tolerance on some of the pixels."""
    few = view.thinned(max(1, -(-max(view.rows, view.columns) // _CHECKED)))
    planes = sheet.laid(prepared_gratings(sheet.orientation_rad, sheet.period_um))

    def tried(paint: Paint) -> Image:
        rgb = np.zeros((few.rows, few.columns, 3), np.float32)
        _painted(rgb, paint, planes, sheet, few)
        return rgb

    exact = tried(_reference(probe, _orders(sheet, gratings, FINE_NM)))
    area = area_map(probe, all_around=sheet.bumps is not None)
    period = float(np.nanmedian(sheet.period_um))
    steps = STEPS_NM if wavelength_step_nm is None else (wavelength_step_nm,)
    for step in steps:
        every = ordered.all_look_ups(_orders(sheet, gratings, step), area, period)
        error = _error(tried(_looking_up(probe, area, every)), exact)
        if error <= 0.7 * tolerance:
            break
    each = np.array(
        [
            np.abs(tried(_looking_up(probe, area, every.picked(np.array([k])).without_zeroth()))).max(axis=-1)
            for k in range(len(every))
        ]
    )
    by_importance = np.argsort(-each.max(axis=(1, 2)), kind="stable")
    left_out = np.cumsum(each[by_importance][::-1], axis=0)[::-1].max(axis=(1, 2)) / max(float(exact.max()), 1e-30)
    count = int(np.count_nonzero(left_out > 0.3 * tolerance))
    look_ups = every.picked(np.sort(by_importance[:count]))
    error = _error(tried(_looking_up(probe, area, look_ups)), exact)
    told = (
        f"{count} of {len(every)} look-ups every {step:g} nm, the most important first; "
        f"they differ from the reference by up to {100 * error:.2g} percent of the largest value "
        f"on all but a thousandth of some pixels"
    )
    (_log.info if error <= tolerance else _log.warning)("%s.", told)
    return _looking_up(probe, area, look_ups)


def _orders(sheet: Sheet, gratings: Gratings, step_nm: float) -> delta.Orders:
    return delta.tabulated_orders(
        wavelength_step_nm=step_nm,
        depth_um=gratings.depth_um,
        longest_period_um=float(np.nanmax(sheet.period_um)),
        form=gratings.form,
        normal_reflectance=gratings.normal_reflectance,
    )


def _error(found: Image, exact: Image) -> float:
    """What a thousandth of the pixels exceeds, relative to the largest value."""
    lit = exact.any(axis=-1)
    if not lit.any():
        return 0.0
    return float(np.percentile(np.abs(found - exact)[lit].max(axis=-1), 99.9) / exact.max())
