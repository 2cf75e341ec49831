"""Errors of orientation at the edges of a drawing, and inside."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample, OrientationError
from pipeline.errors import InputError
from pipeline.stages.evaluate.orientation_at_edges import orientation_at_edges


def drawn(tangent: NDArray[np.float32], pixel_mm: float) -> GratingSample:
    return GratingSample(tangent, np.ones_like(tangent), pixel_mm, 0.12, 1.0, 0.0, 0.0, 0.0, 0.0, "made up")


def halves(finer: int = 1) -> GratingSample:
    """Left 20 columns at 10 degrees, then 20 at 170, which is 20 degrees away, and a dark corner."""
    tangent = np.repeat(np.deg2rad([10.0, 170.0]), 20)[None].repeat(30, axis=0).astype(np.float32)
    tangent[:10, :10] = np.nan
    fine = tangent.repeat(finer, axis=0).repeat(finer, axis=1)
    return drawn(fine, 0.3 / finer)


@pytest.mark.parametrize("finer", [1, 3])
def test_errors_at_edges_are_told_from_those_inside(finer: int) -> None:
    error = np.full((30, 40), np.deg2rad(-1.0), np.float32)
    error[:, 18:22] = np.deg2rad(7.0)  # the edge's two columns, and one more on both sides
    error[:12, :10], error[:10, :12], error[10, 10] = [np.deg2rad(7.0)] * 3
    error[:10, :10] = np.nan
    figures = orientation_at_edges(OrientationError(error, 0.0, {}), halves(finer), edge_mm=0.35).metrics
    # Around the dark corner: two rows of 10, two columns of 10, and the pixel between them.
    count = 4 * 30 + 2 * 20 + 1
    assert figures["edge_share_percent"] == pytest.approx(100 * count / (30 * 40 - 100))
    assert figures["edge_error_mean_deg"] == pytest.approx(7.0)
    assert figures["edge_error_median_deg"] == pytest.approx(7.0)
    assert figures["inner_error_median_deg"] == pytest.approx(1.0)
    assert figures["inner_error_mean_deg"] == pytest.approx(1.0)


def test_turns_that_are_no_edges_and_other_truths_are_refused() -> None:
    error = OrientationError(np.zeros((30, 40), np.float32), 0.0, {})
    plain = drawn(np.zeros((30, 40), np.float32), 0.3)
    with pytest.raises(InputError, match="0 pixels lie at edges and 1200 inside"):
        orientation_at_edges(error, plain)
    with pytest.raises(InputError, match="does not lie on errors of"):
        orientation_at_edges(OrientationError(np.zeros((20, 40), np.float32), 0.0, {}), halves())
    with pytest.raises(InputError, match="edge_mm"):
        orientation_at_edges(error, halves(), edge_mm=0.0)
