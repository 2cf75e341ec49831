"""Draw rendering_bumps.png, a flat sheet and a wavy one: ``python docs/images/rendering_bumps.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png
from pipeline.report.shades import reduced

CIRCLE = ["maps=circles", "tiles=[1,1]", "graph.sample.count=1", "graph.oblique=null"]
WAVES = {"stage": "simulate.cosine_grating", "period_um": 25000, "depth_um": 200, "size_um": 25000, "pitch_um": 250}


def main() -> None:
    """Under two of the experiment's lights, without waves and with them."""
    wavy = [f"graph.bumps.{name}={value}" for name, value in WAVES.items()] + ["graph.rendering.bumps=bumps"]
    runs = [pipeline.run("render_point_light", [*CIRCLE, *words]) for words in ([], wavy)]
    pictures = [reduced(encode_srgb(picture), most=360) for run in runs for picture in run["rendering"].rgb[:2]]
    Path(__file__).with_suffix(".png").write_bytes(png(np.hstack(pictures)))


if __name__ == "__main__":
    main()
