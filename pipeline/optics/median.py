"""Median filter that knows which pixels count."""

from __future__ import annotations

import numpy as np

from pipeline.optics.compiled import njit


@njit(nogil=True, cache=True)
def median_rows(values, mask, reach, start, stop, out):  # type: ignore[no-untyped-def]
    """Median of the masked-in pixels of each window of half width ``reach``; NaN outside the mask.

    Parameters
    ----------
    values, out : ndarray of shape (M, N), float32
        ``out`` is written in rows ``start`` to ``stop``.
    mask : ndarray of shape (M, N), bool
        Pixels that count.
    """
    rows, columns = values.shape
    window = np.empty((2 * reach + 1) ** 2, np.float32)
    for row in range(start, stop):
        for column in range(columns):
            if not mask[row, column]:
                out[row, column] = np.nan
                continue
            count = 0
            for y in range(max(0, row - reach), min(rows, row + reach + 1)):
                for x in range(max(0, column - reach), min(columns, column + reach + 1)):
                    if mask[y, x]:
                        place = count
                        value = values[y, x]
                        while place > 0 and window[place - 1] > value:
                            window[place] = window[place - 1]
                            place -= 1
                        window[place] = value
                        count += 1
            half = count // 2
            out[row, column] = window[half] if count % 2 else np.float32(0.5) * (window[half - 1] + window[half])
