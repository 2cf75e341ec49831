"""How patterns repeat, by lattices that are known."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.optics.tile_lattice import edges, lattice, placed

RNG = np.random.default_rng(5)
WAVES = RNG.normal(size=(5, 5, 2))


def repeating(steps: NDArray, shape: tuple[int, int] = (260, 330)) -> NDArray[np.float32]:
    """A sum of waves that repeats by both steps, given as (column, row)."""
    row, column = np.mgrid[: shape[0], : shape[1]]
    one, other = np.linalg.inv(np.asarray(steps, float)).T @ np.stack([column.ravel(), row.ravel()])
    total = np.zeros(row.size)
    for i in range(5):
        for j in range(5):
            phase = 2 * np.pi * (i * one + (j - 2) * other)
            total += WAVES[i, j, 0] * np.cos(phase) + WAVES[i, j, 1] * np.sin(phase)
    total -= total.mean()
    return total.reshape(shape).astype(np.float32)


@pytest.mark.parametrize(
    "steps",
    [
        [[41.37, 0.0], [0.0, 36.82]],
        [[41.37, 0.6], [-0.5, 36.82]],  # turned
        [[40.2, 0.0], [20.1, 33.4]],  # as bricks
    ],
)
def test_steps_are_found_to_a_hundredth_of_a_pixel(steps: list[list[float]]) -> None:
    found, correlation = lattice(repeating(np.array(steps)))
    assert correlation > 0.95
    assert found[0] == pytest.approx(steps[0], abs=0.02)
    numbers = (found[1] - steps[1]) @ np.linalg.inv(steps)
    assert found[1] == pytest.approx(steps[1] + np.rint(numbers) @ steps, abs=0.02)
    assert abs(np.linalg.det(found)) == pytest.approx(np.linalg.det(steps), rel=1e-3)


def test_light_that_changes_over_the_sheet_does_not_hide_the_lattice() -> None:
    pattern = (repeating(np.array([[41.37, 0.0], [0.0, 36.82]])) > 0).astype(np.float32)
    row, column = np.mgrid[:260, :330]
    found, _ = lattice(edges((0.2 + 0.8 * (column / 330) * (row / 260)).astype(np.float32) * (1 + pattern)))
    assert found == pytest.approx(np.array([[41.37, 0.0], [0.0, 36.82]]), abs=0.05)


def test_what_does_not_repeat_is_refused() -> None:
    with pytest.raises(ValueError, match="no peak"):
        lattice(RNG.normal(size=(200, 240)).astype(np.float32))


def test_stripes_repeat_along_one_direction_only() -> None:
    stripes = np.tile(RNG.normal(size=30), (200, 8)) + 0.3 * RNG.normal(size=(200, 240))
    with pytest.raises(ValueError, match="no peak that stands out on all sides"):
        lattice((stripes - stripes.mean()).astype(np.float32))


def test_rows_that_run_aslant_are_refused() -> None:
    slanted = np.array([[38.0, 17.0], [-17.0, 38.0]])
    with pytest.raises(ValueError, match="do not run along the sides"):
        lattice(repeating(slanted))


def test_tiles_fill_the_sheet_and_no_more() -> None:
    numbers = placed((70, 100), np.diag([20.0, 14.0]), np.zeros(2), (20.0, 14.0), 0.02)
    assert len(numbers) == 25
    assert numbers.min(axis=0).tolist() == [0, 0]
    assert numbers.max(axis=0).tolist() == [4, 4]
