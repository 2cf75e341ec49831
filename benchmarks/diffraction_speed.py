"""BRDF maps of a measured surface: every evaluator against algorithm 2.3 of the source as a plain compiled loop.

    python benchmarks/diffraction_speed.py

800 x 800 directions of view, 81 wavelengths, a coherence window of 65 um, the shed of Xenopeltis (downloaded once). The
loop takes 30 Taylor terms as the source's shader does, in double precision; ``flss`` the number that 0.001 needs. Slow
evaluators are timed on every 16th row of the disc and their seconds multiplied. Errors are those of the brightness over
these rows, relative to the map's maximum, against Taylor terms for 1e-7. Seconds include all preparation, on as many
threads as there are cores; each time is the best of several.
"""

from __future__ import annotations

import dataclasses
import time

import numpy as np
from numpy.typing import NDArray

from pipeline.optics.colour import white_balanced_weights
from pipeline.optics.diffraction.directions import Directions, disc_of_views, unit_vector
from pipeline.optics.diffraction.evaluators import Recipe, prepared
from pipeline.optics.diffraction.patch import Patch
from pipeline.optics.levelling import plane
from pipeline.parallel import cores, over_rows
from pipeline.stages.capture.published_height_map import published_height_map
from pipeline.stages.fit.periodicity import periodicity

SIZE, EVERY, STEP_NM = 800, 16, 5.0
LOOP = "algorithm 2.3 (flss, 30 terms)"
WHOLE = ("chebyshev, 1e-3", "chebyshev, 1e-4")


def mapped(recipe: Recipe, patch: Patch, directions: Directions) -> tuple[NDArray[np.float32], float, float]:
    """Colours, and the seconds of preparation and of all rows."""
    wavelength_nm, weights = white_balanced_weights("D65", STEP_NM)
    start = time.perf_counter()
    response = prepared(recipe, patch, directions, wavelength_nm / 1000)
    rows, columns = directions.uvw[2].shape
    out = np.empty((3, rows, columns), np.float32)
    kernel = response.rows(directions.uvw, wavelength_nm / 1000, weights, out)
    ready = time.perf_counter()
    over_rows(kernel, rows, tile=64 if rows > 100 else 1)
    return out, ready - start, time.perf_counter() - ready


def main() -> None:
    """Time every evaluator and print the table."""
    surface = published_height_map(name="xenopeltis")
    lattice = periodicity(surface)
    towards = np.stack([np.cos(lattice.direction_rad), np.sin(lattice.direction_rad)], 1) / lattice.period_um[:, None]
    height = np.asarray(surface.height_um, np.float64)
    patch = Patch(height - plane(height), surface.pitch_um)
    whole = disc_of_views(unit_vector(0.0), SIZE)
    some = Directions(whole.light, whole.view[EVERY // 2 :: EVERY])
    basis = Recipe(workers=cores())
    recipes = {
        "chebyshev, 1e-3": basis,
        "chebyshev, 1e-4": dataclasses.replace(basis, tolerance=1e-4),
        LOOP: dataclasses.replace(basis, evaluator="flss", terms=30),
        "flss": dataclasses.replace(basis, evaluator="flss"),
        "nmm": dataclasses.replace(basis, evaluator="nmm", lattice_per_um=towards),
        "pq": dataclasses.replace(basis, evaluator="pq"),
        "pq_sinc": dataclasses.replace(basis, evaluator="pq_sinc"),
        "gem": dataclasses.replace(basis, evaluator="gem", lattice_per_um=towards),
    }
    reference = mapped(dataclasses.replace(basis, evaluator="flss", tolerance=1e-7), patch, some)[0]
    results = {}
    for name, recipe in recipes.items():
        directions, share = (whole, 1) if name in WHOLE else (some, SIZE / len(some.uvw[2]))
        rounds = 5 if name in WHOLE else 2
        made = [mapped(recipe, patch, directions) for _ in range(rounds)]
        rows = made[0][0][:, EVERY // 2 :: EVERY] if name in WHOLE else made[0][0]
        error = float(np.abs(rows - reference).max() / reference.max())
        results[name] = (min(part[1] for part in made), min(part[2] for part in made) * share, error)
    loop = sum(results[LOOP][:2])
    print(f"{SIZE} x {SIZE} directions, 81 wavelengths, Xenopeltis, {cores()} threads")
    print(f"{'evaluator':>32} {'prepared':>9} {'rows':>9} {'loop / it':>10} {'error':>9}")
    for name, (ready, rows, error) in results.items():
        print(f"{name:>32} {ready:7.2f} s {rows:7.2f} s {loop / (ready + rows):10.1f} {error:9.1e}")


if __name__ == "__main__":
    main()
