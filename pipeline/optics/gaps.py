"""Gaps of a map, filled by the surface that a stretched membrane would make across them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import spsolve

Float64Array = NDArray[np.float64]


def membrane(height: NDArray[np.floating], *, periodic: bool = False) -> Float64Array:
    """Each unknown height is the mean of its neighbours: Laplace's equation with the gap's rim as boundary.

    Parameters
    ----------
    height : ndarray of shape (M, N)
        NaN where it is not known; some heights are known.
    periodic : bool
        Whether neighbours are across the border too. Otherwise a gap that reaches the border ends level there.

    Returns
    -------
    ndarray of shape (M, N), float64
        Known heights as they were.
    """
    out = np.array(height, np.float64)
    unknown = ~np.isfinite(out)
    number = np.full(out.shape, -1)
    number[unknown] = np.arange(np.count_nonzero(unknown))
    gap = np.argwhere(unknown)
    neighbours, known_sum = np.zeros(len(gap)), np.zeros(len(gap))
    rows, columns = [], []
    for step in ((0, 1), (0, -1), (1, 0), (-1, 0)):
        beside = gap + step
        inside = (beside >= 0).all(axis=1) & (beside < out.shape).all(axis=1) | periodic
        here = np.flatnonzero(inside)
        row, column = (beside[here] % out.shape).T
        neighbours[here] += 1
        joined = unknown[row, column]
        rows.append(here[joined])
        columns.append(number[row, column][joined])
        known_sum[here[~joined]] += out[row, column][~joined]
    at = np.concatenate(rows), np.concatenate(columns)
    matrix = sparse.diags_array(neighbours) - sparse.coo_array((np.ones(len(at[0])), at), (len(gap), len(gap)))
    if len(gap):
        out[unknown] = spsolve(matrix.tocsc(), known_sum)
    return out
