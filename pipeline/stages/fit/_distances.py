"""Whether flash and camera stood as far from the sheet as they are said to have stood."""

from __future__ import annotations

from collections.abc import Callable

_STEP = 1.1
_FARTHEST = 6
_WORTH = 0.9
"""Residual, relative to that of the stated distances, from which others are said to be better."""


def better_distances(residual: float, rescaled: Callable[[float], float]) -> tuple[float, float] | None:
    """Factor on both distances that leaves less unexplained, and how much; None where none is worth telling.

    Parameters
    ----------
    residual : float
        What lobes leave unexplained with the distances as stated.
    rescaled : callable
        The same with both distances multiplied by its argument. Factors go in steps of a tenth.
    """
    factor = min((1 / _STEP, _STEP), key=rescaled)
    best, least = 1.0, residual
    for power in range(1, _FARTHEST + 1):
        left = rescaled(factor**power)
        if left >= least:
            break
        best, least = factor**power, left
    return (best, least) if least < _WORTH * residual else None
