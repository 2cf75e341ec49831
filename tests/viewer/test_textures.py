"""Coded maps, shares and weights against what they stand for, and how they travel inside a page."""

from __future__ import annotations

import base64
import json
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from made_up_sheet import spiral
from scipy.special import jv

from pipeline.optics.colour import white_balanced_weights
from pipeline.viewer.payload import payload
from pipeline.viewer.textures import coded_maps, textures


@given(st.integers(2, 65535), st.integers(0, 2**32 - 1))
def test_codes_are_within_half_a_step(levels: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    theta = (np.pi * random.random((7, 9))).astype(np.float32)
    period = random.uniform(0.5, 3.0, (7, 9)).astype(np.float32)
    theta[0, 0] = period[1, 1] = np.nan
    codes, (turn, low, step) = coded_maps(theta, period, levels)
    known = codes[..., 0] > 0
    assert np.array_equal(known, codes[..., 1] > 0)
    assert not known[0, 0]
    assert not known[1, 1]
    assert codes.max() <= levels
    axial = (codes[known, 0] - 1.0) * turn - theta[known]
    assert np.abs((axial + np.pi / 2) % np.pi - np.pi / 2).max() <= turn / 2 + 1e-6
    assert np.abs(low + (codes[known, 1] - 1.0) * step - period[known]).max() <= step / 2 + 1e-6


def test_maps_without_gratings_are_dark() -> None:
    nothing = np.full((3, 4), np.nan, np.float32)
    assert not coded_maps(nothing, nothing, 100)[0].any()


def test_shares_are_bessel_functions_and_sum_to_one() -> None:
    prepared = textures(spiral(depth_um=0.3), stretch=20.0)
    phase = np.arange(prepared.shares.shape[1]) / prepared.constants["phase_scale"]
    assert prepared.shares[2] == pytest.approx(jv(2, phase / 2) ** 2, abs=1e-6)
    assert prepared.shares[0] + 2 * prepared.shares[1:].sum(axis=0) == pytest.approx(1, abs=1e-4)
    assert phase[-1] >= 2 * np.pi / 0.38 * 2 * 0.3


@pytest.mark.parametrize(("row", "step_nm"), [(0, 1.0), (1, 20.0)])
def test_the_spectrum_is_that_of_white_paper(row: int, step_nm: float) -> None:
    wavelength, weights = white_balanced_weights("D65", step_nm)
    found = textures(spiral()).spectrum[row, : len(wavelength), :3]
    assert found * (wavelength[:, None] / 550) ** 2 == pytest.approx(weights, abs=1e-7)
    assert not textures(spiral()).spectrum[row, len(wavelength) :].any()


def test_what_a_page_carries_is_what_is_drawn() -> None:
    scene = spiral()
    sheet = json.loads(payload(scene, exposure=2.0, file="a.png"))
    maps = sheet["textures"]["maps"]
    packed = np.frombuffer(zlib.decompress(base64.b64decode(maps["data"])), np.uint8).reshape(2, 2, -1)
    steps = packed[:, 0].astype(np.uint16) << 8 | packed[:, 1]
    codes = np.cumsum(steps, axis=1, dtype=np.uint16).reshape(2, *maps["size"][::-1])
    assert np.array_equal(np.moveaxis(codes, 0, -1), coded_maps(scene.orientation_rad, scene.period_um, 2**14 - 1)[0])
    assert sheet["start"]["exposure"] == 2.0
    assert sheet["constants"]["pixel_mm"] == scene.pixel_mm


def test_a_page_cannot_be_broken_out_of() -> None:
    text = payload(spiral(), exposure=1.0, file="</script><script>alert(1)</script>.png")
    assert "<" not in text
    assert json.loads(text)["file"].startswith("</script>")
