"""Complex refractive indices of the metals under printed holograms, at the wavelength of the green filter."""

from __future__ import annotations

from dataclasses import dataclass

WAVELENGTH_NM = 530.0
"""Centre of the spectral filter, for which the indices stand."""


@dataclass(frozen=True)
class Metal:
    """A metal at :data:`WAVELENGTH_NM`.

    Attributes
    ----------
    index : complex
        ``n + i k``, interpolated linearly between the entries of the table.
    page : tuple of str
        Shelf, book and page in the database of refractiveindex.info (M. N. Polyanskiy, Scientific Data 11, 94 (2024);
        release v2026-05-24; CC0).
    source : str
        Who measured or modelled it.
    """

    index: complex
    page: tuple[str, str, str]
    source: str


METALS = {
    "silver": Metal(0.0533 + 3.4101j, ("main", "Ag", "Johnson"), "Johnson and Christy 1972"),
    "aluminium": Metal(0.8946 + 6.1880j, ("main", "Al", "Rakic-BB"), "Rakić et al. 1998, Brendel-Bormann model"),
    "gold": Metal(0.5576 + 2.2039j, ("main", "Au", "Johnson"), "Johnson and Christy 1972"),
    "copper": Metal(1.1274 + 2.5978j, ("main", "Cu", "Johnson"), "Johnson and Christy 1972"),
    "brass": Metal(0.5730 + 2.5680j, ("other", "Cu-Zn", "Querry-Cu70Zn30"), "Querry 1985, 70 % Cu, 30 % Zn"),
    "iron": Metal(2.8889 + 2.9164j, ("main", "Fe", "Johnson"), "Johnson and Christy 1974"),
    "platinum": Metal(2.0332 + 3.6000j, ("main", "Pt", "Rakic-BB"), "Rakić et al. 1998, Brendel-Bormann model"),
}
"""By the name that settings give them."""
