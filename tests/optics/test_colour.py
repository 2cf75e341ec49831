"""Spectra to linear sRGB, against colour-science."""

from __future__ import annotations

import colour
import numpy as np
import pytest

from pipeline.optics.colour import encode_srgb, filtered_weights, spectral_colour, white_balanced_weights


@pytest.mark.parametrize("light", ["D65", "A", "inverse A", "E"])
@pytest.mark.parametrize("step_nm", [1.0, 5.0, 20.0])
def test_white_is_white(light: str, step_nm: float) -> None:
    wavelength, weights = white_balanced_weights(light, step_nm)
    assert (wavelength[0], wavelength[-1]) == (380, 780)
    np.testing.assert_allclose(np.ones(wavelength.size) @ weights, [1, 1, 1], rtol=1e-12)


def test_a_reflectance_has_the_colour_that_colour_science_computes() -> None:
    wavelength, weights = white_balanced_weights("D65", 5.0)
    reflectance = 0.2 + 0.6 * np.exp(-(((wavelength - 610) / 60) ** 2))
    shape = colour.SpectralShape(380, 780, 5)
    xyz = colour.sd_to_XYZ(
        colour.SpectralDistribution(dict(zip(wavelength, reflectance, strict=True))),
        cmfs=colour.MSDS_CMFS["CIE 1931 2 Degree Standard Observer"].copy().align(shape),
        illuminant=colour.SDS_ILLUMINANTS["D65"].copy().align(shape),
        method="Integration",
    )
    expected = colour.XYZ_to_sRGB(xyz / 100, apply_cctf_encoding=False)
    np.testing.assert_allclose(reflectance @ weights, expected, atol=2e-3)


def test_wavelengths_have_their_colours() -> None:
    wavelength, weights = white_balanced_weights("E", 5.0)
    for nm, channel in ((450, 2), (540, 1), (620, 0)):
        assert np.argmax(weights[np.argmin(np.abs(wavelength - nm))]) == channel


def test_the_inverse_of_illuminant_a_is_its_reciprocal() -> None:
    weights = {light: white_balanced_weights(light, 5.0)[1] for light in ("A", "inverse A", "E")}
    shown = np.abs(weights["E"]) > 1e-6
    product = weights["A"][shown[:, 1], 1] * weights["inverse A"][shown[:, 1], 1] / weights["E"][shown[:, 1], 1] ** 2
    np.testing.assert_allclose(product, product[0], rtol=1e-9)
    assert weights["inverse A"][5, 1] / weights["A"][5, 1] > weights["inverse A"][60, 1] / weights["A"][60, 1]


def test_encoding_is_srgb() -> None:
    linear = np.linspace(0, 1, 101)
    np.testing.assert_allclose(encode_srgb(linear), colour.cctf_encoding(linear, function="sRGB"), atol=1e-6)
    np.testing.assert_allclose(encode_srgb(np.array([-1.0, 2.0])), [0, 1], atol=1e-7)


def test_one_wavelength_is_seen_in_its_hue_as_bright_as_a_display_can() -> None:
    """Monochromatic light lies outside sRGB: 500 nm lacks red, 620 nm blue (CIE 1931)."""
    assert spectral_colour(500).tolist() == pytest.approx([0, 1, 0.362], abs=0.001)
    assert spectral_colour(620)[[0, 2]].tolist() == [1, 0]
    assert spectral_colour(450).argmax() == 2


def test_a_narrow_filter_leaves_the_colour_of_its_wavelength() -> None:
    wavelength, weights = filtered_weights("E", 1.0, 600.0, 2.0)
    assert np.median(wavelength) == pytest.approx(600)
    every, unfiltered = white_balanced_weights("E", 1.0)
    known = unfiltered[every == 600.0][0]
    assert weights.sum(axis=0) / weights.sum() == pytest.approx(known / known.sum(), rel=0.01)


def test_a_filter_of_twice_the_width_lets_twice_the_light_through() -> None:
    narrow, wide = (filtered_weights("D65", 1.0, 530.0, width)[1].sum(axis=0)[1] for width in (4.0, 8.0))
    assert wide / narrow == pytest.approx(2, rel=0.01)


def test_filters_side_by_side_add_up_to_white() -> None:
    """Gaussians that stand closer than they are wide add up to a constant, here the width times sqrt(pi / ln 16)."""
    centres = np.arange(350.0, 811.0, 4.0)
    total = sum(filtered_weights("D65", 1.0, centre, 10.0)[1].sum(axis=0) for centre in centres)
    assert total * 4.0 / (10.0 * np.sqrt(np.pi / np.log(16))) == pytest.approx(np.ones(3), abs=0.01)
