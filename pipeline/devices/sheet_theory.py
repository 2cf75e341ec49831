"""Warnings where a sheet's gratings are beyond what its renderers' theory holds for."""

from __future__ import annotations

import logging

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import Spectrum
from pipeline.optics.gratings import Form
from pipeline.optics.sheet.validity import evanescent_share, expansion_error

_TOLERATED_EVANESCENT = 0.1

_log = logging.getLogger(__name__)


def warn_of_theory(
    period_um: NDArray[np.floating], *, depth_um: float, orders: Form, illuminant: Spectrum, tolerance: float
) -> None:
    """Say so where scalar diffraction, or the paper's expansion of it, does not hold.

    Parameters
    ----------
    period_um : ndarray
        Of the gratings; NaN where there is none.
    depth_um, orders, illuminant
        Of the rendering.
    tolerance : float
        Error of an order's share, as a part of all light, that the expansion may make.
    """
    if not np.isfinite(period_um).any():
        return
    if orders == "second order" and (error := expansion_error(depth_um, illuminant)) > tolerance:
        _log.warning(
            "Orders expanded to the second power of a depth of %g um err by %.2g percent of the light; orders=exact "
            "does not.",
            depth_um,
            100 * error,
        )
    shortest = float(np.nanmin(period_um))
    if (lost := evanescent_share(shortest, depth_um, illuminant)) > _TOLERATED_EVANESCENT:
        _log.warning(
            "Scalar diffraction sends %.2g percent of the light of gratings of %.3g um into orders that cannot leave: "
            "colours there are not to be trusted.",
            100 * lost,
            shortest,
        )
