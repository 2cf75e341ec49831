"""Draw diffraction_brdf.png: ``python docs/images/diffraction_brdf.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline
from pipeline.report.brdf_maps import exposed
from pipeline.report.encoded import png
from pipeline.report.shades import reduced

SIDE = 230


def main() -> None:
    """A row for each surface, a column for each direction of light."""
    rows = []
    for surface in ("blaze", "xenopeltis", "elaphe"):
        brdf = pipeline.run("diffraction_brdf_map", [f"surface={surface}", "graph.brdf.size_px=460"])["brdf"]
        shown, _ = exposed(brdf.rgb)
        rows.append(np.hstack([reduced(picture, most=SIDE) for picture in shown]))
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(rows)))


if __name__ == "__main__":
    main()
