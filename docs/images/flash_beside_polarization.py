"""Draw flash_beside_polarization.png: ``python docs/images/flash_beside_polarization.py [RUNS]``."""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

import pipeline
from pipeline.report.encoded import png
from pipeline.report.shades import orientation_colours

SIDE = 180
SCENES = ("polygons", "stars", "kinematic", "alone", "film", "weak")
METHODS = ("flash", "cosine", "jones", "fine")


def main() -> None:
    """Put the drawing above what each method makes of it; tiles begin where the sheet does."""
    runs = [f"paths.runs={sys.argv[1]}"] if len(sys.argv) > 1 else []
    done = pipeline.sweep("flash_beside_polarization", [*runs, f"scene={','.join(SCENES)}"])
    found = {(point.settings["scene"], point.settings["method"]): point.run for point in done.points}
    columns = []
    for scene in SCENES:
        flash = found[scene, "flash"]
        columns.append([shown(flash["sample"].orientation_rad)])
        for method in METHODS:
            run = found[scene, method]
            if method == "flash":
                away = place(run["drawn"].orientation_rad, run["sample"].orientation_rad)
                columns[-1].append(shown(np.roll(run["fit"].orientation_rad, away, axis=(0, 1))))
                continue
            node = "fit_cosine" if method == "cosine" else "fit_polarization"
            turned = run[node].orientation_rad - run["evaluate"].offset_rad
            columns[-1].append(shown(np.mod(turned, np.pi)))
    Path(__file__).with_suffix(".png").write_bytes(png(np.hstack([np.vstack(column) for column in columns])))


def place(part: np.ndarray, whole: np.ndarray) -> tuple[int, int]:
    """How far to move a tile that was found, in pixels, to begin as the drawing does, by correlation."""
    rows, columns = part.shape
    at = np.ix_(np.arange(rows) * len(whole) // rows, np.arange(columns) * whole.shape[1] // columns)
    spectra = [np.fft.fft2(np.nan_to_num(np.exp(2j * angle))) for angle in (whole[at], part)]
    score = np.fft.ifft2(spectra[0] * spectra[1].conj()).real
    down, right = np.unravel_index(int(score.argmax()), score.shape)
    return int(down), int(right)


def shown(orientation_rad: np.ndarray) -> np.ndarray:
    """In hues, at the size of a cell, white between cells."""
    picture = orientation_colours(orientation_rad).astype(np.float32)
    large = cv2.resize(picture, (SIDE, SIDE), interpolation=cv2.INTER_NEAREST)
    return cv2.copyMakeBorder(large, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=(1, 1, 1))


if __name__ == "__main__":
    main()
