"""Light probes from files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from photo_makers import write_image

from pipeline.errors import InputError
from pipeline.stages.capture.light_probe import light_probe as read


def test_probes_of_files_are_read_as_they_are(tmp_path: Path) -> None:
    rgb = np.random.default_rng(3).uniform(0, 5, (8, 16, 3)).astype(np.float32)
    for name in ("probe.exr", "probe.hdr"):
        write_image(tmp_path / name, rgb)
        np.testing.assert_allclose(
            read(file=tmp_path / name).rgb, rgb, rtol=0.01, atol=5 / 128
        )  # one exponent for all three in RGBE


@pytest.mark.parametrize(
    ("image", "told"),
    [
        (np.ones((8, 16), np.float32), "is grey"),
        (np.ones((8, 8, 3), np.float32), "8 x 8 pixels"),
        (np.zeros((8, 16, 3), np.float32), "is black"),
        (np.full((8, 16, 3), -1.0, np.float32), "128 pixels hold no light"),
        (np.full((8, 16, 3), np.nan, np.float32), "128 pixels hold no light"),
    ],
)
def test_files_that_are_no_probe_are_refused(image: np.ndarray, told: str, tmp_path: Path) -> None:
    write_image(tmp_path / "probe.exr", image)
    with pytest.raises(InputError, match=told):
        read(file=tmp_path / "probe.exr")


def test_a_missing_probe_is_named(tmp_path: Path) -> None:
    write_image(tmp_path / "museum.exr", np.ones((8, 16, 3), np.float32))
    with pytest.raises(InputError, match=r"no photo musem.exr[\s\S]*did you mean 'museum.exr'"):
        read(file=tmp_path / "musem.exr")
