"""Numbers as they are reported with what is known of them."""

from __future__ import annotations

from math import isfinite


def measured(value: float, deviation: float) -> str:
    """A value and its standard deviation to two significant digits of the latter: ``40.0000 +- 0.0012``.

    A value without deviation was given: ``0 (given)``.
    """
    if not deviation:
        return f"{value:.6g} (given)"
    if not isfinite(deviation):
        return f"{value:.3g} +- {deviation}"
    decimals = max(0, 1 - int(f"{deviation:.1e}".partition("e")[2]))
    return f"{value:.{decimals}f} +- {deviation:.{decimals}f}"
