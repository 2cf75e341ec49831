"""Brackets of exposures: response curves that are known, a bracket that was published, and what spoils others."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import OpenImageIO
import pytest
from numpy.typing import NDArray

from pipeline.optics.hdr import merged, response_curve, unsaturated, weighted_mean

TIMES = np.array([0.002, 0.008, 0.032, 0.128])


def curve(exposure: NDArray) -> NDArray:
    """Of a made-up camera: full at 1, steeper than sRGB in the dark."""
    return np.clip(exposure, 0, 1) ** 0.4


def bracket_of(radiance: NDArray) -> NDArray[np.uint8]:
    return np.stack([np.rint(255 * curve(radiance * time)).astype(np.uint8) for time in TIMES])


@pytest.fixture(scope="module")
def scene() -> NDArray:
    """Radiance (64, 96, 3) over four decades, its channels in another order in each half."""
    ramp = np.geomspace(0.05, 480, 96)[None, :, None] * np.ones((64, 1, 3))
    ramp[32:] = ramp[32:, ::-1]
    ramp[16:48, :, 1] *= 0.4
    return ramp


def test_a_known_response_is_found(scene: NDArray) -> None:
    found = response_curve(bracket_of(scene)[None], TIMES)
    levels = np.arange(10, 246)
    known = (levels / 255) ** 2.5 / (128 / 255) ** 2.5
    assert np.log(found[levels]) == pytest.approx(np.log(np.repeat(known[:, None], 3, axis=1)), abs=0.06)
    assert (np.diff(found, axis=0) >= 0).all()


def test_radiance_is_found_over_four_decades(scene: NDArray) -> None:
    bracket = bracket_of(scene)
    radiance = merged(bracket, TIMES, response_curve(bracket[None], TIMES))
    lit = unsaturated(bracket, TIMES)
    ratio = np.log(radiance[lit] / scene[lit])
    assert np.ptp(scene[lit]) > 300
    assert ratio == pytest.approx(np.median(ratio), abs=0.12)
    assert np.std(ratio) < 0.025


def test_a_saturated_channel_leaves_the_others_alone() -> None:
    scene = np.full((8, 8, 3), [2.0, 60.0, 2.0])
    alone = np.full((8, 8, 3), 2.0)
    response = np.repeat((np.maximum(np.arange(256), 0.5) / 128)[:, None] ** 2.5, 3, axis=1)
    together, apart = (merged(bracket_of(seen), TIMES, response) for seen in (scene, alone))
    assert together[..., ::2] == pytest.approx(apart[..., ::2])


def test_what_is_full_in_the_shortest_exposure_is_no_darker_than_what_is_not() -> None:
    scene = np.geomspace(10, 1e4, 64)[None, :, None] * np.ones((8, 1, 3))
    bracket = bracket_of(scene)
    response = np.repeat((np.maximum(np.arange(256), 0.5) / 128)[:, None] ** 2.5, 3, axis=1)
    radiance = merged(bracket, TIMES, response)
    full = ~unsaturated(bracket, TIMES)
    assert full.any()
    assert radiance[full].min() >= 0.97 * radiance[~full].max()


def test_what_moved_between_exposures_does_not_spoil_the_response(scene: NDArray) -> None:
    bracket = bracket_of(scene)
    clean = response_curve(bracket[None], TIMES)
    for index in range(len(TIMES)):
        bracket[index, : 3 + 2 * index] = (0, 0, 255)
    assert np.log(response_curve(bracket[None], TIMES)[10:246]) == pytest.approx(np.log(clean[10:246]), abs=0.06)


def test_channels_that_a_filter_leaves_dark_get_the_curve_of_the_bright_one(scene: NDArray) -> None:
    found = response_curve(bracket_of(scene * (1e-3, 1, 1e-3))[None], TIMES)
    assert (found == found[:, [1]]).all()


def test_raw_levels_are_merged_as_exactly_as_they_were_stored(scene: NDArray) -> None:
    exposures = np.clip(scene * TIMES[:, None, None, None], 0, 1)
    levels = np.rint(exposures * 65535).astype(np.uint16)
    lit = unsaturated(levels, TIMES)
    radiance = weighted_mean(levels, TIMES, linear=True)
    assert radiance[lit] == pytest.approx(scene[lit], abs=1 / 65535 / TIMES[-1], rel=3e-4)
    assert (radiance[~lit] <= 1.03 / TIMES[0]).all()


def test_the_published_bracket_of_a_memorial_church(measurements: Path) -> None:
    """Debevec and Malik 1997; the merge that they published is of sixteen exposures, of which eight are at hand."""
    folder = measurements / "hdr" / "memorial"
    entries = [line.split() for line in (folder / "list.txt").read_text().splitlines() if line.strip()]
    names, times = zip(*sorted(entries, key=lambda entry: float(entry[1])), strict=True)
    seconds = np.array([float(time) for time in times])
    photos = np.stack([cv2.imread(str(folder / name))[..., ::-1] for name in names])
    published = OpenImageIO.ImageInput.open(str(folder / "memorial.hdr")).read_image()
    border = ((photos[..., 2] > 250) & (photos[..., :2] < 5).all(axis=-1)).any(axis=0)
    known = ~border & (published > 0).all(axis=-1)
    radiance = merged(photos, seconds, response_curve(photos[None], seconds))
    plain = weighted_mean(photos, seconds, linear=False)

    def agreement(found: NDArray) -> float:
        light = [np.log(np.maximum(picture[known] @ (0.2126, 0.7152, 0.0722), 1e-9)) for picture in (found, published)]
        return float(np.corrcoef(*light)[0, 1])

    assert known.mean() > 0.95
    assert agreement(radiance) > 0.99
    assert 0.96 < agreement(plain) < agreement(radiance)
