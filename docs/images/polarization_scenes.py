"""Draw polarization_scenes.png: ``python docs/images/polarization_scenes.py [RUNS]``, from runs that are there."""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import hsv_to_rgb

import pipeline

SCENES = ("logo", "kinematic", "banknote", "stars", "fireworks", "cd")
PIXELS = 400


def few(image: np.ndarray) -> np.ndarray:
    """Every so-many-th pixel of an image."""
    return image[:: max(1, len(image) // PIXELS), :: max(1, len(image) // PIXELS)]


def hues(orientation_rad: np.ndarray) -> np.ndarray:
    """Orientations as hues, black where there is none."""
    there = np.isfinite(orientation_rad)
    hue = np.where(there, orientation_rad, 0) / np.pi % 1
    return hsv_to_rgb(np.stack([hue, np.full_like(hue, 0.85), there * 0.95], axis=-1))


def main() -> None:
    """One row a scene: as drawn, as measured, how far off, period, as rendered and as the torch shows it."""
    words = [f"paths.runs={sys.argv[1]}"] if len(sys.argv) > 1 else []
    figure, rows = plt.subplots(len(SCENES), 6, figsize=(13, 13.2), layout="constrained")
    titles = ("orientation drawn", "orientation measured", "error", "relative period", "rendered", "under the torch")
    for panels, scene in zip(rows, SCENES, strict=True):
        run = pipeline.run(f"polarization_{scene}", words)
        sample, map_, error, period = run["sample"], run["placed"], run["evaluate"], run["period"]
        width_mm = sample.orientation_rad.shape[1] * sample.pixel_mm
        panels[0].imshow(hues(few(sample.orientation_rad)))
        panels[1].imshow(hues(few(np.where(map_.mask, map_.orientation_rad, np.nan))))
        off = panels[2].imshow(np.rad2deg(few(error.error_rad)), vmin=-3, vmax=3, cmap="RdBu_r")
        relative = period.period_um / np.nanmedian(period.period_um[period.mask])
        lengths = panels[3].imshow(few(np.where(period.mask, relative, np.nan)), cmap="viridis")
        panels[4].imshow(few(np.clip(run["rendering"].rgb[0], 0, 1) ** (1 / 2.2)))
        panels[5].imshow(few(np.clip(run["torch"].rgb[0], 0, 1) ** (1 / 2.2)))
        figure.colorbar(off, ax=panels[2], shrink=0.8, label="degrees")
        figure.colorbar(lengths, ax=panels[3], shrink=0.8)
        panels[0].set_ylabel(f"{scene}, {width_mm:.0f} mm")
        for panel in panels:
            panel.set(xticks=[], yticks=[])
    for panel, title in zip(rows[0], titles, strict=True):
        panel.set_title(title, fontsize=10)
    figure.savefig(Path(__file__).with_suffix(".png"), dpi=75)


if __name__ == "__main__":
    main()
