"""From a probe's colours to spectra and back: what light of one wavelength contributes to the picture.

A probe states linear sRGB. Its spectral radiance is taken as ``D65(lambda) * (b_r R + b_g G + b_b B)``, with the basis
of Mallett and Yuksel 2019: the smoothest spectra of the three primaries under D65 that add up to 1. The eye turns them
back into just these colours, so that a mirror shows the probe.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import FIRST_NM, LAST_NM, white_balanced_weights

Float64Array = NDArray[np.float64]
_FINE_NM = 1.0


@lru_cache(maxsize=8)
def colour_matrices(step_nm: float) -> tuple[Float64Array, Float64Array]:
    """Wavelengths, and what each makes of a probe's colours.

    Parameters
    ----------
    step_nm : float
        Distance of the wavelengths, at most; 380 and 780 nm are the ends.

    Returns
    -------
    wavelength_nm : ndarray of shape (W,)
        Wavelengths.
    matrices : ndarray of shape (W, 3, 3)
        From the probe's linear sRGB to the picture's. Each holds the spectrum around it, weighted by straight lines
        to its neighbours, so that what changes little between them is summed exactly; all add up to the unit matrix.
    """
    fine, eye = white_balanced_weights("D65", _FINE_NM)
    exact = eye[:, :, None] * _basis(fine)[:, None, :]
    # Rounded tables leave 1e-4.
    exact = exact @ np.linalg.inv(exact.sum(axis=0))
    nodes = np.linspace(FIRST_NM, LAST_NM, int(np.ceil((LAST_NM - FIRST_NM) / step_nm - 1e-9)) + 1)
    near = np.maximum(0, 1 - np.abs(fine - nodes[:, None]) / (nodes[1] - nodes[0]))
    matrices = np.einsum("wf,fij->wij", near, exact)
    nodes.setflags(write=False)
    matrices.setflags(write=False)
    return nodes, matrices


def _basis(wavelength_nm: Float64Array) -> Float64Array:
    """Spectra of the primaries relative to D65, shape (W, 3)."""
    from colour.recovery import MSDS_BASIS_FUNCTIONS_sRGB_MALLETT2019 as basis

    return np.stack([np.interp(wavelength_nm, basis.wavelengths, basis.values[:, i]) for i in range(3)], axis=-1)
