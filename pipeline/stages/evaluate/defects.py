"""Defects that an inspection found against those that were drawn."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.data.arrays import BoolArray
from pipeline.data.inspection import Defects, Inspection
from pipeline.data.metrics import Metrics
from pipeline.errors import InputError
from pipeline.limits import refuse, zero_or_more
from pipeline.optics.angles import axial_difference
from pipeline.optics.regions import grown

_log = logging.getLogger(__name__)

# What inspections of maps that are equal within 1e-5 may give.
_tolerance_defects = {"metrics": 1e-2}


def defects(found: Inspection, truth: Defects, *, near_px: float = 2.0) -> Metrics:
    """Say which defects were found and which missed, which findings are false alarms, and how good the others are.

    A drawn defect is found where a region of the inspection lies on it, or no more than ``near_px`` beside it; several
    regions may lie on one defect (a scratch across a gap falls into pieces), of which the largest is compared with it.
    A region that lies on none is a false alarm.

    Parameters
    ----------
    found : Inspection
        On a grid of shape (M, N).
    truth : Defects
        Of shape (q M, q N) with an odd whole number q, drawn in the frame of the inspection's reference.
    near_px : float
        Blur and misplacement that are allowed for, in pixels of the inspection.

    Returns
    -------
    Metrics
        ``defects_drawn``, ``defects_found``, ``defects_missed``, ``false_alarms``; where defects were drawn
        ``found_percent``, ``missed_largest_mm`` (largest width of a missed one; 0 without), and where some were found
        ``found_smallest_mm``, ``kind_right_percent``, ``position_error_mean_mm`` and ``_max_mm``,
        ``area_error_mean_percent``, and of turned ones and of those of wrong period ``turn_error_mean_deg`` and
        ``period_ratio_error_mean_percent``.

    Raises
    ------
    InputError
        The truth is not an odd whole number of times finer than the inspection.
    """
    labels = found.defects.labels
    ratio, rest = divmod(truth.labels.shape[0], labels.shape[0])
    if rest or ratio % 2 == 0 or truth.labels.shape != (ratio * labels.shape[0], ratio * labels.shape[1]):
        raise InputError(
            f"defects drawn on {truth.labels.shape} points do not lie on a map of {labels.shape}",
            expected="defects of the sample that is the reference, an odd whole number of times finer",
        )
    matches, claimed = [], set()
    for index, window in enumerate(ndimage.find_objects(truth.labels, len(truth.kind))):
        # Pixels of the inspection that the defect touches; one that is smaller than a pixel still touches one.
        rows, columns = np.nonzero(truth.labels[window] == index + 1)
        area = np.zeros(labels.shape, np.bool_)
        area[(rows + window[0].start) // ratio, (columns + window[1].start) // ratio] = True
        regions = np.unique(labels[grown(area, near_px)])
        regions = regions[regions > 0] - 1
        claimed |= set(regions.tolist())
        matches.append(int(regions[np.argmax(found.defects.area_mm2[regions])]) if regions.size else -1)
    match = np.array(matches, int)
    hit = match >= 0
    _report(truth, hit)
    metrics = {
        "defects_drawn": float(len(match)),
        "defects_found": float(np.count_nonzero(hit)),
        "defects_missed": float(np.count_nonzero(~hit)),
        "false_alarms": float(len(found.defects.kind) - len(claimed)),
    }
    if len(match):
        metrics["found_percent"] = 100 * float(np.mean(hit))
        metrics["missed_largest_mm"] = float(np.max(truth.width_mm[~hit], initial=0.0))
    if hit.any():
        metrics |= _compared(found.defects, truth, np.flatnonzero(hit), match[hit])
    return Metrics(metrics)


def _check_defects(*, near_px: float) -> None:
    """Refuse a negative distance before anything runs."""
    refuse(zero_or_more(near_px=near_px))


def _compared(found: Defects, truth: Defects, drawn: NDArray[np.int_], seen: NDArray[np.int_]) -> dict[str, float]:
    """How well findings describe the defects on which they lie."""
    distance = np.hypot(*(found.centre_mm[seen] - truth.centre_mm[drawn]).T)
    right = [found.kind[s] == truth.kind[d] for s, d in zip(seen, drawn, strict=True)]
    metrics = {
        "found_smallest_mm": float(np.min(truth.width_mm[drawn])),
        "kind_right_percent": 100 * float(np.mean(right)),
        "position_error_mean_mm": float(np.mean(distance)),
        "position_error_max_mm": float(np.max(distance)),
        "area_error_mean_percent": 100 * float(np.mean(np.abs(found.area_mm2[seen] / truth.area_mm2[drawn] - 1))),
    }
    for kind in ("turned", "period"):
        same = np.array([r and truth.kind[d] == kind for r, d in zip(right, drawn, strict=True)], bool)
        if not same.any():
            continue
        if kind == "turned":
            error = axial_difference(found.turn_rad[seen[same]], truth.turn_rad[drawn[same]])
            metrics["turn_error_mean_deg"] = float(np.mean(np.abs(np.rad2deg(error))))
        else:
            ratio = found.period_ratio[seen[same]] / truth.period_ratio[drawn[same]]
            metrics["period_ratio_error_mean_percent"] = 100 * float(np.mean(np.abs(ratio - 1)))
    return metrics


def _report(truth: Defects, hit: BoolArray) -> None:
    """Name the defects that were missed."""
    missed = [
        f"{truth.kind[i]} at ({x:.2f}, {y:.2f}) mm, {truth.width_mm[i]:.3f} mm wide"
        for i, (x, y) in enumerate(truth.centre_mm)
        if not hit[i]
    ]
    if missed:
        _log.info("Missed: %s.", "; ".join(missed))
