"""Draw flash_misaligned.png: ``python docs/images/flash_misaligned.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.report.encoded import png
from pipeline.report.shades import orientation_colours

HEIGHT = 250
METHODS = ("threshold_translated", "threshold", "translated", "")


def main() -> None:
    """Put orientations as drawn and as found from translated and from aligned tiles above their errors."""
    run = pipeline.run("flash_misaligned")
    maps = [run["drawn"].orientation_rad, *(run[_name("fit", one)].orientation_rad for one in METHODS)]
    errors = [np.abs(run[_name("evaluate", one)].error_rad) for one in METHODS]
    above = [orientation_colours(part) for part in maps]
    grey = [np.repeat(np.clip(np.rad2deg(np.nan_to_num(part)) / 20, 0, 1)[..., None], 3, axis=-1) for part in errors]
    below = [np.ones_like(grey[0]), *grey]
    rows = [np.hstack([shown(part) for part in row]) for row in (above, below)]
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(rows)))


def _name(node: str, branch: str) -> str:
    return f"{node}_{branch}" if branch else node


def shown(picture: np.ndarray) -> np.ndarray:
    """At the height of a row, white between pictures."""
    width = round(picture.shape[1] / picture.shape[0] * HEIGHT)
    large = cv2.resize(picture.astype(np.float32), (width, HEIGHT), interpolation=cv2.INTER_NEAREST)
    return cv2.copyMakeBorder(large, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
