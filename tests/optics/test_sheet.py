"""How finely a spectrum has to be sampled, and how far a half vector reaches."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.optics.sheet.extent import extent
from pipeline.optics.sheet.spectral import aliasing
from pipeline.optics.sheet.view import rectified


@pytest.mark.parametrize("spread", [0.006, 0.008, 0.012])
def test_aliasing_is_the_worst_error_of_a_sampled_lobe(spread: float) -> None:
    step_nm, period_um = 20.0, 1.1
    step = step_nm / 1000 / period_um
    samples = step * np.arange(-200, 201)
    sums = [
        step * np.exp(-0.5 * ((samples - start) / spread) ** 2).sum() / (np.sqrt(2 * np.pi) * spread)
        for start in np.linspace(0, step, 33)
    ]
    assert aliasing(step_nm, period_um, spread) == pytest.approx(np.abs(np.array(sums) - 1).max(), rel=0.01, abs=1e-12)


def test_the_extent_of_a_picture_is_that_of_its_pixels() -> None:
    light, camera = np.array([100.0, 20.0, 300.0]), np.array([0.0, 0.0, 500.0])
    view = rectified(41, 41, 0.5, camera)
    x, y = np.meshgrid(np.linspace(-10, 10, 41), np.linspace(-10, 10, 41))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1)
    half = sum((p - points) / np.linalg.norm(p - points, axis=-1, keepdims=True) for p in (light, camera))
    found = extent(view, light, 3.0)
    assert found.across == pytest.approx(np.linalg.norm(half[..., :2], axis=-1).max())
    assert found.w == pytest.approx((half[..., 2].min(), half[..., 2].max()))
    away = np.linalg.norm(light - points, axis=-1)
    assert found.light_variance == pytest.approx((9 * (300 / away**2).min() ** 2, 9 / away.min() ** 2))
    along_x, along_y = np.gradient(half, axis=1), np.gradient(half, axis=0)
    change = ((along_x**2).sum(axis=-1) + (along_y**2).sum(axis=-1)).max() / 12
    assert found.pixel_variance == pytest.approx(change, rel=0.02)


def test_a_slope_turns_the_normal_of_the_extent() -> None:
    light, camera, (p, q) = np.array([100.0, 20.0, 300.0]), np.array([0.0, -200.0, 500.0]), (0.3, -0.2)
    view = rectified(1, 1, 1e-3, camera)
    found = extent(view, light, 3.0, np.full((2, 1, 1), [[[p]], [[q]]], np.float32))
    normal = np.array([-p, -q, 1.0]) / np.linalg.norm([p, q, 1.0])
    to_light, to_eye = light / np.linalg.norm(light), camera / np.linalg.norm(camera)
    half = to_light + to_eye
    assert found.w == pytest.approx((half @ normal,) * 2)
    assert found.across == pytest.approx(np.linalg.norm(half - (half @ normal) * normal))
    assert found.light_variance[0] == pytest.approx(9 * (to_light @ normal) ** 2 / (light @ light))
