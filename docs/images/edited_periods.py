"""Draw edited_periods.png: ``python docs/images/edited_periods.py``."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import pipeline
from pipeline.optics.colour import encode_srgb
from pipeline.report.encoded import png
from pipeline.report.shades import orientation_colours, reduced

PICTURES = ("rendering", "rendering_quadratic", "rendering_sine")


def main() -> None:
    """For many circles and for one, put orientations, original and the two edits under the flash beside each other."""
    rows = []
    for count in (5, 1):
        run = pipeline.run("edit_periods", [f"graph.sample.count={count}"])
        shown = [orientation_colours(run["orientation"].orientation_rad)]
        shown += [encode_srgb(run[name].rgb[0]) for name in PICTURES]
        rows.append(np.hstack([reduced(picture, most=240) for picture in shown]))
    Path(__file__).with_suffix(".png").write_bytes(png(np.vstack(rows)))


if __name__ == "__main__":
    main()
