"""Pictures that are shown one after another."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from pipeline.data.pictures import PictureSeries
from pipeline.optics.colour import encode_srgb
from pipeline.report.figures import figures_of
from pipeline.report.writers import WRITERS


def film(count: int = 5, rows: int = 21, columns: int = 32) -> PictureSeries:
    """A red bar that wanders to the right."""
    rgb = np.zeros((count, rows, columns, 3), np.float32)
    for index in range(count):
        rgb[index, :, 6 * index : 6 * index + 6, 0] = 1
    light = np.tile([100.0, 0.0, 300.0], (count, 1))
    return PictureSeries(rgb, light, np.array([0.0, 0.0, 500.0]), frames_per_second=10.0)


def test_a_film_is_written_as_mp4_and_webp_with_all_its_pictures(tmp_path: Path) -> None:
    value = film()
    files = list(WRITERS["PictureSeries"](tmp_path / "rendering", value))
    assert [file.name for file in files] == ["rendering.webp", "rendering.mp4"]
    done, animation = cv2.imreadanimation(str(files[0]))
    assert done
    assert list(animation.durations) == [100] * 5
    capture = cv2.VideoCapture(str(files[1]))
    assert capture.get(cv2.CAP_PROP_FPS) == pytest.approx(10)
    for index, rgb in enumerate(value.rgb):
        shown = np.uint8(255 * encode_srgb(rgb)[..., ::-1])
        read, frame = capture.read()
        assert read
        assert frame.shape == (20, 32, 3)
        for picture in (animation.frames[index][..., :3][:20], frame):
            away = np.abs(picture.astype(float) - shown[:20])
            assert away.mean() < 12, index
    assert not capture.read()[0]


def test_the_page_shows_a_film_once(tmp_path: Path) -> None:
    (figure,) = figures_of(film())
    assert figure.title == "animation"
    assert str(figure.body).count("data:image/webp") == 1
    assert "5 pictures of 32 × 21 pixels" in figure.caption
    assert "72° above it" in figure.caption
