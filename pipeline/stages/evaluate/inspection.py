"""An item compared with a reference item of the same product: where its gratings are not what they should be."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.data.inspection import Defects, Inspection
from pipeline.errors import InputError
from pipeline.limits import above_zero, above_zero_up_to, refuse, within, zero_or_more
from pipeline.optics.deviation import deviation, expected_extreme
from pipeline.optics.flaws import Flaw, flaws
from pipeline.optics.grating_pair import GratingPair, Gratings, compared
from pipeline.optics.regions import described, grown
from pipeline.optics.superposition import channels_of, superpose

_log = logging.getLogger(__name__)

_LEAST_AGREEMENT = 0.6

# Resampling and sums in float32 on top of the fits' rounding.
_tolerance_inspection = {"significance": 0.01, "suspect": 1e-4, "defects": 1e-3, "metrics": 1e-3}


def inspection(
    reference: OrientationMap,
    suspect: OrientationMap,
    reference_period: PeriodMap | None = None,
    suspect_period: PeriodMap | None = None,
    *,
    largest_turn_deg: float = 30.0,
    least_turn_deg: float = 0.5,
    least_period_percent: float = 1.0,
    least_pixels: int = 3,
    border_px: float = 2.0,
    false_alarms: float = 0.01,
) -> Inspection:
    """Compare an item with a reference item of the same product, and list its defects.

    The item lies shifted and turned, as a hand laid it down, and its orientations are turned with it; both maps may
    have an offset of their own. So the item is first laid on the reference, turned back and freed of the offset. Then

    - gratings are **missing** where the reference diffracts and the item does not, **extra** where it is the other way
      round, both more than ``border_px`` from the outline of the reference;
    - elsewhere the difference of orientation and the logarithm of the ratio of periods are averaged over windows of
      several sizes, each mean divided by its standard deviation. The noise of a pixel is known up to a factor from the
      correlation of both fits (from the brightness, where there is none) and that factor from the scatter of the
      difference. The error that a tenth of a pixel of misplacement would make is added, and pixels across which the
      reference jumps are not judged at all, so that edges of facets do not count;
    - what is more significant than noise is expected to be once in ``1 / false_alarms`` items, and larger than the
      tolerances ``least_turn_deg`` or ``least_period_percent``, is a defect: **turned**, or of wrong **period**;
    - a region narrower than five pixels that is too dark counts as missing (a dot smaller than the lens resolves only
      dims its pixels), and a long and narrow missing one that is not a facet of its own as a **scratch**.

    Parameters
    ----------
    reference, suspect : OrientationMap
        Of shape (M, N) and (P, Q), unsmoothed, of a known pixel pitch.
    reference_period, suspect_period : PeriodMap, optional
        Of the same shapes. Without both, relative periods follow from the mean intensities (the zeroth order falls as
        the square of the period). One common factor is removed unless both are absolute.
    largest_turn_deg : float
        The item is not looked for beyond this turn.
    least_turn_deg, least_period_percent : float
        Tolerance of the product: smaller differences are no defects, however significant.
    least_pixels : int
        Of the reference; smaller regions are taken for flaws of the sensor.
    border_px : float
        So close to the outline nothing is judged.
    false_alarms : float
        Expected number on an item without defects, for Gaussian noise.

    Returns
    -------
    Inspection
        Its figures count the ``defects``, by kind too, and say how the item lies (``lies_x_mm``, ``lies_y_mm``,
        ``lies_turn_deg``), how far its orientations are ahead (``offset_deg``), the share of the reference that was
        judged (``judged_percent``), and the noise of one pixel (``noise_turn_deg``, ``noise_period_percent``).

    Raises
    ------
    InputError, InputErrors
        The pixel pitch of the reference is unknown, shapes differ, or the two maps do not show the same product.

    References
    ----------
    Toisoul, Dhillon and Ghosh, Acquiring spatially varying appearance of printed holographic surfaces (2018), section
    9, proposes the use. Equations 11 and following give the period.
    """
    _check_inspection(
        largest_turn_deg=largest_turn_deg,
        least_turn_deg=least_turn_deg,
        least_period_percent=least_period_percent,
        least_pixels=least_pixels,
        border_px=border_px,
        false_alarms=false_alarms,
    )
    pixel_mm = _pitch(reference, suspect, reference_period, suspect_period)
    lies = superpose(
        channels_of(reference.intensity, reference.orientation_rad),
        channels_of(suspect.intensity, suspect.orientation_rad),
        scale=pixel_mm / (suspect.pixel_mm or pixel_mm),
        largest_turn_rad=float(np.deg2rad(largest_turn_deg)),
    )
    if lies.agreement < _LEAST_AGREEMENT:
        raise InputError(
            f"the two maps agree to {lies.agreement:.2f} where they lie on each other best",
            expected=f"maps of the same product, which agree to {_LEAST_AGREEMENT} or more",
            hint="a larger largest_turn_deg, where the item lies turned further",
        )
    relative = not (reference_period and suspect_period) or reference_period.relative or suspect_period.relative
    periods = (None, None) if reference_period is None or suspect_period is None else (reference_period, suspect_period)
    try:
        pair = compared(
            _gratings(reference, periods[0]),
            _gratings(suspect, periods[1]),
            lies.motion,
            deviation_px=lies.deviation_px,
            border_px=border_px,
            least_pixels=least_pixels,
            relative=relative,
        )
    except ValueError as error:
        raise InputError(str(error), expected="facets wider than the border and their edges") from None
    limit = expected_extreme(2 * int(np.count_nonzero(pair.judged)), false_alarms)
    found = flaws(
        pair,
        threshold=limit,
        least_turn_rad=float(np.deg2rad(least_turn_deg)),
        least_log_ratio=float(np.log1p(least_period_percent / 100)),
        least_pixels=least_pixels,
    )
    defects = _listed(found, reference.mask.shape, pixel_mm)
    up_right = np.array([lies.motion.shift_px[1], -lies.motion.shift_px[0]]) * (suspect.pixel_mm or pixel_mm)
    _log.info(
        "The item lies turned by %.3f deg and shifted by (%.4f, %.4f) mm; the maps agree to %.3f; a place at the edge "
        "is known to %.3f px. Noise does not reach %.1f standard deviations.",
        np.rad2deg(lies.motion.turn_rad),
        *up_right,
        lies.agreement,
        lies.deviation_px,
        limit,
    )
    metrics = {"defects": float(len(found))}
    metrics |= {f"defects_{kind}": float(defects.kind.count(kind)) for kind in sorted(set(defects.kind))}
    metrics |= {
        "judged_percent": 100.0 * int(np.count_nonzero(pair.judged)) / int(np.count_nonzero(reference.mask)),
        "lies_x_mm": float(up_right[0]),
        "lies_y_mm": float(up_right[1]),
        "lies_turn_deg": float(np.rad2deg(lies.motion.turn_rad)),
        "offset_deg": float(np.rad2deg(pair.offset_rad)),
        "noise_turn_deg": float(np.rad2deg(np.median(pair.turn.noise[pair.judged]))),
        "noise_period_percent": 100 * float(np.median(pair.ratio.noise[pair.judged])),
    }
    return Inspection(
        defects=defects,
        suspect=replace(
            reference,
            orientation_rad=pair.item.orientation_rad,
            correlation=pair.item.correlation,
            intensity=pair.item.intensity,
            mask=pair.item.mask,
            standard_error_rad=None,
        ),
        significance=_significance(pair, found),
        threshold=limit,
        shift_mm=up_right,
        turn_rad=lies.motion.turn_rad,
        offset_rad=pair.offset_rad,
        metrics=metrics,
    )


def _check_inspection(
    *,
    largest_turn_deg: float,
    least_turn_deg: float,
    least_period_percent: float,
    least_pixels: int,
    border_px: float,
    false_alarms: float,
) -> None:
    """Refuse impossible tolerances before anything runs."""
    refuse(
        within(0, 180, largest_turn_deg=largest_turn_deg),
        zero_or_more(least_turn_deg=least_turn_deg, least_period_percent=least_period_percent, border_px=border_px),
        above_zero(least_pixels=least_pixels),
        above_zero_up_to(1, false_alarms=false_alarms),
    )


def _pitch(
    reference: OrientationMap,
    suspect: OrientationMap,
    reference_period: PeriodMap | None,
    suspect_period: PeriodMap | None,
) -> float:
    """Pixel pitch of the reference, after a look at whether all maps fit each other."""
    pairs = ((reference, reference_period, "reference"), (suspect, suspect_period, "suspect"))
    for orientation, period, name in pairs:
        if period is not None and period.mask.shape != orientation.mask.shape:
            raise InputError(
                f"the {name}'s maps are of {orientation.mask.shape} and {period.mask.shape}",
                where=f"{name}_period",
                expected="maps from the same photographs",
            )
        if not (orientation.mask & np.isfinite(orientation.orientation_rad)).any():
            raise InputError(f"nothing diffracts in the {name}", where=name, expected="a map with pixels in its mask")
    if not reference.pixel_mm:
        raise InputError(
            "the pixel pitch of the reference is not known",
            where="reference",
            expected="pixel_mm in capture.yaml, or in the settings of the rig",
        )
    return float(reference.pixel_mm)


def _gratings(orientation: OrientationMap, period: PeriodMap | None) -> Gratings:
    """The map's arrays; without a period map the period follows from the zeroth order, which falls as its square."""
    if period is None:
        level = np.log(np.maximum(orientation.intensity, 1e-6)) / 2
    else:
        level = np.log(np.where(period.mask & (period.period_um > 0), period.period_um, np.nan))
    return Gratings(
        orientation.orientation_rad, orientation.correlation, orientation.intensity, orientation.mask, level
    )


def _listed(found: list[Flaw], shape: tuple[int, ...], pixel_mm: float) -> Defects:
    """The flaws, none of which share a pixel, as a value."""
    labels = np.zeros(shape, np.int32)
    for index, flaw in enumerate(found):
        labels[flaw.area] = index + 1
    regions = described(labels, len(found), pixel_mm)
    return Defects(
        kind=tuple(flaw.kind for flaw in found),
        centre_mm=regions.centre_mm,
        area_mm2=regions.area_mm2,
        width_mm=regions.width_mm,
        turn_rad=np.array([flaw.turn_rad for flaw in found], np.float64),
        period_ratio=np.array([flaw.period_ratio for flaw in found], np.float64),
        significance=np.array([flaw.significance for flaw in found], np.float64),
        labels=labels,
        pixel_mm=pixel_mm,
    )


def _significance(pair: GratingPair, found: list[Flaw]) -> NDArray[np.float32]:
    """How significant each pixel is: in a flaw by itself, elsewhere with its neighbours that are in none."""
    area = np.any([flaw.area for flaw in found], axis=0) if found else np.zeros_like(pair.judged)
    near = grown(area, pair.reach_px)
    significance = np.full(area.shape, np.nan, np.float32)
    for channel in (pair.turn, pair.ratio):
        alone = np.where(channel.judged & near, np.abs(channel.means[0] / channel.deviations[0]), np.float32(np.nan))
        rest = deviation(channel.means[0], channel.noise, channel.judged & ~near)
        significance = np.fmax(significance, np.fmax(alone, np.abs(rest.significance)))
    for flaw in found:
        if flaw.kind in {"missing", "scratch", "extra"}:
            brightness = pair.brightness.means[0][flaw.area] / pair.brightness.deviations[0][flaw.area]
            significance[flaw.area] = np.fmax(significance[flaw.area], np.abs(brightness))
    return significance
