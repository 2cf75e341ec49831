"""Draw rendering_environment.png: ``python docs/images/rendering_environment.py``."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png
from pipeline.report.light_probes import exposed_probe

SIDE = 560
SHEETS = {
    "circles": ["maps=circles", "graph.rendering.size_px=[1120,1120]"],
    "kinematic": [
        *("maps=kinematic", "tiles=[12,8]", "graph.rendering.size_px=[1120,840]"),
        *("graph.rendering.view=camera", "graph.rendering.camera_mm=[-100,-200,450]"),
    ],
}


def column(environment: str) -> NDArray[np.float32]:
    """A probe, and under it two sheets in it, the second seen from the side."""
    parts = []
    for words in SHEETS.values():
        run = pipeline.run("render_environment", [f"environment={environment}", "rotation_deg=[0]", *words])
        if not parts:
            parts.append(exposed_probe(run["probe"])[0])
        rgb = run["rendering"].rgb[0]
        parts.append(encode_srgb(rgb / np.percentile(rgb.max(axis=-1)[rgb.any(axis=-1)], 93.0)))
    scaled = [
        cv2.resize(part, (SIDE, round(SIDE * len(part) / part.shape[1])), interpolation=cv2.INTER_AREA)
        for part in parts
    ]
    return np.vstack(scaled)


def main() -> None:
    """Both columns."""
    picture = np.hstack([column("room"), column("outdoors")])
    (Path(__file__).parent / "rendering_environment.png").write_bytes(png(picture))


if __name__ == "__main__":
    main()
