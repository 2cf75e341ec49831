"""Draw response_curves.png: ``python docs/images/response_curves.py``."""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

import pipeline
from pipeline.optics.response_curve import response_curve
from pipeline.stages.fit._cloud import curve_of

SCENES = (("film of 8°", ["phase_deg=40", "retardation_deg=8"]), ("no film", ["phase_deg=40", "retardation_deg=0"]))


def main() -> None:
    """Simulate the facets under two films and draw what is found."""
    figure, panels = plt.subplots(1, 2, figsize=(9, 4.6), layout="constrained")
    for panel, (name, words) in zip(panels, SCENES, strict=True):
        run = pipeline.run("limits_polarization", ["hydra.mode=RUN", "until=aligned", *words])
        cloud, found = curve_of(run["aligned"], {"film_axis_rad": 0.0}, None, 16000)
        curve = response_curve(found.grating)
        panel.plot(*cloud.points.stokes[::4].T, ",", color="0.45")
        panel.plot(*np.vstack([curve.stokes, curve.stokes[:1]]).T, color="tab:blue", lw=1)
        for degrees in range(0, 180, 30):
            at = curve.stokes[round(degrees / 180 * len(curve.stokes))]
            panel.plot(*at, "o", color="tab:blue", ms=3)
            panel.annotate(f" {degrees}°", at, color="tab:blue", fontsize=8)
        panel.axhline(0, color="0.85", lw=0.6, zorder=0)
        panel.axvline(0, color="0.85", lw=0.6, zorder=0)
        panel.set(aspect="equal", title=name, xlabel="s1", ylabel="s2")
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=80)


if __name__ == "__main__":
    main()
