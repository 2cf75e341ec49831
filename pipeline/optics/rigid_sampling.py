"""Images read where a rigid motion leads, by one interpolation."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from pipeline.optics.compiled import njit
from pipeline.optics.rigid import RigidMotion
from pipeline.optics.spline import quintic_taps
from pipeline.optics.translation import sample_translated

Float32Array = NDArray[np.float32]


def resampled(
    image: NDArray[np.floating], motion: RigidMotion, shape: tuple[int, ...], *, order: int = 3, outside: float = np.nan
) -> Float32Array:
    """The other picture's image read at the pixels of the one, of ``shape``; ``outside`` beyond its borders."""
    offset = motion.offset_px(shape, image.shape)
    return np.asarray(
        ndimage.affine_transform(
            image.astype(np.float32), motion.matrix, offset, shape, order=order, mode="constant", cval=outside
        )
    )


def sample_rigid(coefficients: Float32Array, motion: RigidMotion) -> Float32Array:
    """The quintic spline read, for every pixel, where the motion leads; the border is mirrored.

    Parameters
    ----------
    coefficients : ndarray of shape (M, N), float32
        From :func:`pipeline.optics.spline.quintic_coefficients`.
    motion : RigidMotion
        From a picture of the same shape into this one.

    Returns
    -------
    ndarray of shape (M, N), float32
    """
    if motion.turn_rad == 0 and motion.scale == 1:
        return sample_translated(coefficients, motion.shift_px)
    result = np.empty_like(coefficients)
    _sample(coefficients, motion.matrix, motion.offset_px(coefficients.shape, coefficients.shape), result)
    return result


@njit(inline="always", error_model="numpy")
def _mirrored(index, size):  # type: ignore[no-untyped-def]
    index = abs(index)
    if index >= size:
        index = 2 * (size - 1) - index
    return min(max(index, 0), size - 1)


@njit(nogil=True, cache=True, error_model="numpy", fastmath={"contract", "nsz", "reassoc"})
def _sample(coefficients, matrix, offset, result):  # type: ignore[no-untyped-def]
    height, width = coefficients.shape
    for i in range(height):
        for j in range(width):
            row = offset[0] + matrix[0, 0] * i + matrix[0, 1] * j
            column = offset[1] + matrix[1, 0] * i + matrix[1, 1] * j
            first_row, first_column = int(np.floor(row)), int(np.floor(column))
            a0, a1, a2, a3, a4, a5 = quintic_taps(row - first_row)
            b0, b1, b2, b3, b4, b5 = quintic_taps(column - first_column)
            total = np.float32(0)
            inside = 2 <= first_row < height - 3 and 2 <= first_column < width - 3
            for k in range(6):
                r = first_row + k - 2
                weight = a0 if k == 0 else a1 if k == 1 else a2 if k == 2 else a3 if k == 3 else a4 if k == 4 else a5
                if inside:
                    c = coefficients[r, first_column - 2 : first_column + 4]
                    line = b0 * c[0] + b1 * c[1] + b2 * c[2] + b3 * c[3] + b4 * c[4] + b5 * c[5]
                else:
                    c = coefficients[_mirrored(r, height)]
                    line = (
                        b0 * c[_mirrored(first_column - 2, width)]
                        + b1 * c[_mirrored(first_column - 1, width)]
                        + b2 * c[_mirrored(first_column, width)]
                        + b3 * c[_mirrored(first_column + 1, width)]
                        + b4 * c[_mirrored(first_column + 2, width)]
                        + b5 * c[_mirrored(first_column + 3, width)]
                    )
                total += np.float32(weight * line)
            result[i, j] = total
