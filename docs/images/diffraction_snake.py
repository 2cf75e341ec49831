"""Draw diffraction_snake.png: ``python docs/images/diffraction_snake.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline
from pipeline.report.encoded import png
from pipeline.report.labelled_pictures import exposed_pictures

WORDS = ["surface=xenopeltis", *(f"graph.shading.{word}" for word in ("size_px=480", "samples=4", "coherence_um=65"))]


def main() -> None:
    """Put the three distances beside each other."""
    shown, _ = exposed_pictures(pipeline.run("diffraction_snake", WORDS)["shading"])
    Path(__file__).with_suffix(".png").write_bytes(png(np.hstack(list(shown))))


if __name__ == "__main__":
    main()
