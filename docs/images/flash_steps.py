"""Draw flash_steps.png: ``python docs/images/flash_steps.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.report.encoded import png
from pipeline.report.shades import orientation_colours

SIDE = 300


def main() -> None:
    """Put kinematic paper from 24 views, by the threshold and by lobes, beside that from 350."""
    maps = []
    for tiles, count in (("[6,4]", 1), ("[10,7]", 5)):
        read = [f"graph.{fit}.photographs={count}" for fit in ("fit", "fit_threshold")]
        run = pipeline.run("flash_kinematic", [f"rig.tiles={tiles}", *read, "until=[fit,fit_threshold]"])
        maps += [shown(run[name].orientation_rad) for name in ("fit_threshold", "fit")]
    Path(__file__).with_suffix(".png").write_bytes(png(np.hstack(maps)))


def shown(orientation_rad: np.ndarray) -> np.ndarray:
    """As hue, white between maps."""
    hue = orientation_colours(orientation_rad).astype(np.float32)
    large = cv2.resize(hue, (SIDE, SIDE), interpolation=cv2.INTER_NEAREST)
    return cv2.copyMakeBorder(large, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
