"""Draw flash_polygons.png: ``python docs/images/flash_polygons.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png

WIDTH = 400


def main() -> None:
    """Put the photograph under room light and the first flash above the rectified ones under all three."""
    run = pipeline.run("flash_polygons")
    taken, sheet = run["photos"], run["rectified"]
    white = np.percentile(sheet.radiance.max(axis=-1), 99)
    above = [taken.room / 255, *(taken.images[0, k] / 255 for k in (1, 3))]
    below = [encode_srgb(picture / white) for picture in sheet.radiance]
    rows = [np.hstack([shown(picture) for picture in row]) for row in (above, below)]
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(rows)))


def shown(picture: np.ndarray) -> np.ndarray:
    """At the width of a column, black between columns."""
    height = round(picture.shape[0] / picture.shape[1] * WIDTH)
    small = cv2.resize(picture.astype(np.float32), (WIDTH, height), interpolation=cv2.INTER_AREA)
    return cv2.copyMakeBorder(small, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
