"""Draw flash_renderings.png: ``python docs/images/flash_renderings.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png

WIDTH, HEIGHT = 320, 226
SAMPLES = ("polygons", "circles", "stars", "varying", "kinematic", "stochastic")


def main() -> None:
    """Put the first photograph of each sample beside the rendering of what was measured, two samples in a row."""
    pairs = []
    for sample in SAMPLES:
        run = pipeline.run(f"flash_{sample}", ["until=[rendering,photographed]"])
        pairs.append(np.hstack([shown(run[name].rgb[0]) for name in ("photographed", "rendering")]))
    rows = [np.hstack(pairs[k : k + 2]) for k in range(0, len(pairs), 2)]
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(rows)))


def shown(picture: np.ndarray) -> np.ndarray:
    """At the size of a cell, encoded for a display, white between pictures."""
    small = cv2.resize(encode_srgb(picture), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    return cv2.copyMakeBorder(small, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
