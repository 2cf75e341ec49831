"""Draw rendering_figure5.png and rendering_kinematic.png: ``python docs/images/rendering_point_light.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline
from pipeline.data.gratings import OrientationMap, PeriodMap
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png
from pipeline.report.shades import reduced
from pipeline.stages.render.point_light import point_light

SIDE, PIXEL_MM = 280, 250 / 280
LIGHTS = [[0.0, 0.0, 300.0], [80.0, 40.0, 300.0]]


def gratings() -> np.ndarray:
    """Straight gratings of 600 and 1000 lines per mm and slanting ones, and circles of both, under two lights."""
    y, x = np.mgrid[SIDE:0:-1, 0:SIDE] - SIDE / 2
    circles = np.arctan2(y, x) % np.pi
    columns = []
    for angle, lines_per_mm in ((0.0, 600), (0.0, 1000), (np.pi / 4, 1000), (circles, 600), (circles, 1000)):
        orientation = np.broadcast_to(angle, (SIDE, SIDE)).astype(np.float32)
        mask = np.ones((SIDE, SIDE), bool)
        series = point_light(
            OrientationMap(orientation, orientation, orientation, mask, PIXEL_MM, absolute=True),
            PeriodMap(np.full((SIDE, SIDE), 1000 / lines_per_mm, np.float32), mask, PIXEL_MM),
            lights_mm=LIGHTS,
            light_sigma_mm=5.0,
            illuminant="inverse A",
            white_percentile=97.0,
        )
        columns.append(np.vstack([encode_srgb(rgb) for rgb in series.rgb]))
    return np.hstack(columns)


def kinematic() -> np.ndarray:
    """The sheet of the experiment, as it lies and from the side, under two of its lights."""
    run = pipeline.run("render_point_light", [])
    rows = []
    for name in ("rendering", "oblique"):
        rows.append([reduced(encode_srgb(picture), most=500) for picture in run[name].rgb[:2]])
    height = min(picture.shape[0] for row in rows for picture in row)
    return np.vstack([np.hstack([picture[:height] for picture in row]) for row in rows])


def main() -> None:
    """Both pictures."""
    folder = Path(__file__).parent
    (folder / "rendering_figure5.png").write_bytes(png(gratings()))
    (folder / "rendering_kinematic.png").write_bytes(png(kinematic()))


if __name__ == "__main__":
    main()
