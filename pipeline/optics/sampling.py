"""Fine maps read at the pixels of a coarser camera."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def at_pixel_centres(fine: NDArray[np.floating], shape: tuple[int, ...]) -> NDArray[np.floating] | None:
    """Values of ``fine`` at the centres of ``shape`` pixels that cover the same area.

    None where ``fine`` is not an odd whole number of times finer, so that no sample lies at the centres.
    """
    ratio, rest = divmod(fine.shape[0], shape[0])
    if rest or ratio % 2 == 0 or fine.shape[:2] != (ratio * shape[0], ratio * shape[1]):
        return None
    return fine[ratio // 2 :: ratio, ratio // 2 :: ratio]
