"""Draw flash_maps.png: ``python docs/images/flash_maps.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png
from pipeline.report.shades import orientation_colours

HEIGHT = 230


def main() -> None:
    """Put kinematic paper and its maps above stochastic paper, measured and made again."""
    wheels = pipeline.run("flash_kinematic", ["until=[fit,fit_one,fit_threshold]"])
    spiral = pipeline.run("flash_stochastic", ["until=[rendering,rendering_unfiltered]"])
    maps = [orientation_colours(wheels[name].orientation_rad) for name in ("fit_one", "fit_threshold", "fit")]
    pictures = [spiral["rectified"].radiance, spiral["filtered"].radiance]
    pictures += [spiral[name].rgb for name in ("rendering", "rendering_unfiltered")]
    rows = [
        np.hstack([shown(part) for part in (exposed(wheels["rectified"].radiance[0]), *maps)]),
        np.hstack([shown(exposed(part[0])) for part in pictures]),
    ]
    width = max(row.shape[1] for row in rows)
    padded = [np.pad(row, ((0, 0), (0, width - row.shape[1]), (0, 0)), constant_values=1) for row in rows]
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(padded)))


def exposed(radiance: np.ndarray) -> np.ndarray:
    """For what lies around the highlight."""
    return encode_srgb(radiance / np.percentile(radiance.max(axis=-1), 98.5))


def shown(picture: np.ndarray) -> np.ndarray:
    """At the height of a row, white between pictures."""
    width = round(picture.shape[1] / picture.shape[0] * HEIGHT)
    small = cv2.resize(picture.astype(np.float32), (width, HEIGHT), interpolation=cv2.INTER_AREA)
    return cv2.copyMakeBorder(small, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
