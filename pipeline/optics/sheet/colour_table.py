"""The colour of an order as a table: its integral over the spectrum, made once for a light, a depth and a window.

Order m sends ``lambda_m = a u / m`` to the eye, and its integral over the spectrum is one around that wavelength, by a
Gaussian of width ``s / m``, with ``s = a sqrt(var)`` and var the variance of the lobe along u. What is left to each
pixel is the lobe across, and a look-up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import FIRST_NM, LAST_NM, Spectrum, white_balanced_weights
from pipeline.optics.gratings import Form, efficiencies, highest_order, window_spread
from pipeline.optics.sheet.extent import Extent

Precision = Literal["single", "double"]
Float64Array = NDArray[np.float64]

REACH = 4.0
MIDDLE_UM = 0.55
_COLOUR_UM, _WIDTH_UM = 0.015, 0.025
"""Over how much of wavelength and of width colours bend: ``sqrt(colour / second derivative)``."""
_NEGLIGIBLE = 1e-3
_MOST_NODES = 1 << 22
_STEPS_NM = (2.0, 1.0, 0.5, 0.2, 0.1)


@dataclass(frozen=True)
class Axis:
    """Evenly spaced nodes."""

    low: float
    high: float
    count: int

    @property
    def nodes(self) -> Float64Array:
        """All of them."""
        return np.linspace(self.low, self.high, self.count)

    @property
    def per_unit(self) -> float:
        """Nodes in a unit."""
        return (self.count - 1) / (self.high - self.low)


@dataclass(frozen=True)
class ColourTable:
    """Colours of orders, to be interpolated.

    Attributes
    ----------
    orders : ndarray of shape (M, W, S, P, 4), of the type in which pixels are worked out
        Linear sRGB and a zero, of orders 1 to M, over ``w``, the root of ``s`` and ``lambda_m``.
    zeroth : ndarray of shape (W, E, R, 4), of the same type
        Of order 0 over ``w``, the standard deviation that light and pixel add to the lobe, and the distance from the
        middle in standard deviations at 550 nm.
    w, root_width, wavelength_um, added, distance : Axis
        Nodes of both.
    spread_per_um : float
        Standard deviation of an order through the coherence window over the wavelength.
    normal_reflectance : float
        At normal incidence, for Schlick's reflectance relative to it; 1 for a mirror.
    """

    orders: NDArray[np.floating]
    zeroth: NDArray[np.floating]
    w: Axis
    root_width: Axis
    wavelength_um: Axis
    added: Axis
    distance: Axis
    spread_per_um: float
    normal_reflectance: float

    def __str__(self) -> str:
        size = " x ".join(str(count) for count in self.orders.shape[:-1])
        return f"{size} nodes (orders, w, width, wavelength), {self.orders.nbytes / 2**20:.2g} MiB"


def colour_table(
    occurring: Extent,
    *,
    light: Spectrum,
    coherence_um: float,
    depth_um: float,
    periods_um: tuple[float, float],
    orders: Form = "exact",
    tolerance: float = 0.01,
    normal_reflectance: float = 1.0,
    precision: Precision = "single",
) -> ColourTable:
    """Tabulate colours as finely as a tolerance needs, for what occurs in some pictures.

    Parameters
    ----------
    occurring : Extent
        Limits of the half vector and of the lobes' widths.
    light : str
        Spectrum of the light.
    coherence_um, depth_um : float
        Width of the coherence window, and depth of the gratings from crest to trough.
    periods_um : tuple of float
        The shortest and the longest.
    orders : {"exact", "second order"}
        Form of the orders' shares.
    tolerance : float
        Error of a colour, relative to the brightest of its order, that interpolation may make.
    normal_reflectance : float
        See :class:`ColourTable`.
    precision : {"single", "double"}
        Of the table, and of what is looked up in it.

    Raises
    ------
    ValueError
        The table would be too large: gratings are deep, or what occurs differs a lot.
    """
    per_um = float(window_spread(1.0, coherence_um))
    first, last = FIRST_NM / 1000, LAST_NM / 1000
    least, most = occurring.light_variance[0], occurring.light_variance[1] + occurring.pixel_variance
    narrow = periods_um[0] * float(np.hypot(per_um * first, np.sqrt(least)))
    wide = periods_um[1] * float(np.hypot(per_um * last, np.sqrt(most)))
    highest = highest_order(periods_um[1], first, occurring.across)
    # Straight lines between nodes err by h^2 / 8 of the second derivative; a quarter of the tolerance for each axis.
    part = np.sqrt(2 * tolerance)
    wavelength = _axis(first - REACH * wide, last + REACH * wide, part * _COLOUR_UM)
    root_width = _axis(np.sqrt(narrow), np.sqrt(wide), part * np.sqrt(_WIDTH_UM) / 2)
    w = _axis(*occurring.w, part * 2 * first / (2 * np.pi * max(depth_um, 1e-6)))
    added = _axis(np.sqrt(least), np.sqrt(most), part * 2 * per_um * MIDDLE_UM)
    distance = _axis(0.0, REACH * last / MIDDLE_UM, part / 3)
    nodes = highest * w.count * root_width.count * wavelength.count
    if nodes > _MOST_NODES:
        raise ValueError(f"a table of colours would have {nodes} nodes, more than {_MOST_NODES}")

    @cache
    def spectrum(step_nm: float, last_order: int) -> tuple[Float64Array, Float64Array, Float64Array]:
        """Wavelengths, what each contributes, and the orders' shares by order, ``w`` and wavelength."""
        sampled_nm, weights = white_balanced_weights(light, step_nm)
        phase = 2000 * np.pi / sampled_nm * w.nodes[:, None] * depth_um
        shares = efficiencies(orders, np.arange(last_order + 1)[:, None, None], phase)
        return sampled_nm / 1000, weights * (MIDDLE_UM * per_um) ** 2, shares

    sampled, colour, shares = spectrum(_STEPS_NM[0], highest)
    real: type[np.floating] = np.float32 if precision == "single" else np.float64
    zeroth = _zeroth(shares[0], colour, sampled, per_um, added, distance).astype(real)
    brightest = shares.max(axis=(1, 2))
    seen = np.flatnonzero(brightest[1:] > _NEGLIGIBLE * tolerance * brightest[1:].max())
    count = int(seen[-1]) + 1 if seen.size else 1
    table = np.zeros((count, w.count, root_width.count, wavelength.count, 4), real)
    for j, width in enumerate(root_width.nodes**2):
        for m in range(1, count + 1):
            sampled, colour, shares = spectrum(_step_nm(1000 * width / m), count)
            lobe = np.exp(-0.5 * ((wavelength.nodes[:, None] - sampled) * m / width) ** 2)
            table[m - 1, :, j, :, :3] = lobe @ (shares[m, :, :, None] * colour)
    return ColourTable(
        orders=table,
        zeroth=zeroth,
        w=w,
        root_width=root_width,
        wavelength_um=wavelength,
        added=added,
        distance=distance,
        spread_per_um=per_um,
        normal_reflectance=normal_reflectance,
    )


def _step_nm(width_nm: float) -> float:
    """The widest of some steps that samples a Gaussian of such a width, or the finest."""
    return next((step for step in _STEPS_NM if step <= 0.6 * width_nm), _STEPS_NM[-1])


def _zeroth(
    share: Float64Array, colour: Float64Array, sampled: Float64Array, per_um: float, added: Axis, distance: Axis
) -> Float64Array:
    table = np.zeros((len(share), added.count, distance.count, 4))
    for j, more in enumerate(added.nodes):
        relative = ((per_um * MIDDLE_UM) ** 2 + more**2) / ((per_um * sampled) ** 2 + more**2)
        lobe = relative * np.exp(-0.5 * distance.nodes[:, None] ** 2 * relative)
        table[:, j, :, :3] = lobe @ (share[:, :, None] * colour)
    return table


def _axis(low: float, high: float, step: float) -> Axis:
    high = max(high, low * (1 + 1e-6) + 1e-9)
    return Axis(float(low), float(high), max(2, int(np.ceil((high - low) / step)) + 1))
