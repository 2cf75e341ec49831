"""The cosine fit and the curve fit against polanalyser's Stokes fit and against copying the same bytes.

    python benchmarks/fit_speed.py

12 photographs of 6 megapixels, 16-bit integers and float32. Each way is timed in turn, several rounds over, and its
best time stands. polanalyser is called as its documentation shows (``calcStokes`` with a list of angles, then
``cvtStokesToAoLP``) and uses as many threads as NumPy's linear algebra does; it gives the angle only, the fit gives
angle, correlation and mean. ``stage`` is ``fit.cosine`` as an experiment calls it, mask and map included (float32 only:
stages exchange float32). ``curve known`` is ``fit.jones`` where zeroth order and film are given, ``curve searched``
where they are not.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable

import numpy as np
import polanalyser as pa

from pipeline.data.photographs import PolarizerSequence
from pipeline.optics.angles import axial_difference
from pipeline.optics.harmonic import fit_rows, harmonic_fit
from pipeline.optics.response_curve import FilmedGrating, relative_stokes
from pipeline.parallel import cores, over_rows, thread_budget
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.fit.jones import jones

SHAPE = (12, 2000, 3000)
ROUNDS = 15
KNOWN = {"amplitude_ratio": 1.08, "phase_deg": 40.0, "retardation_deg": 8.0}
GRATING = FilmedGrating(1.08, np.deg2rad(40.0), np.deg2rad(8.0))


def photographs(dtype: type) -> tuple[np.ndarray, np.ndarray]:
    """Gratings of random orientation and brightness under a film, with noise."""
    rng = np.random.default_rng(0)
    angles = np.arange(SHAPE[0]) * np.pi / SHAPE[0]
    orientation, level = rng.random((2, *SHAPE[1:]), np.float32)
    _, s1, s2 = relative_stokes(np.linspace(0, np.pi, 4096), GRATING)
    place = (orientation * 4095).astype(np.int32)
    s1, s2 = s1.astype(np.float32)[place], s2.astype(np.float32)[place]
    images = np.empty(SHAPE, dtype)
    for image, angle in zip(images, angles, strict=True):
        signal = (0.2 + 0.3 * level) * (1 + s1 * np.cos(2 * angle) + s2 * np.sin(2 * angle))
        signal += 0.002 * rng.standard_normal(SHAPE[1:], np.float32)
        image[:] = signal if dtype is np.float32 else np.rint(65535 * np.clip(signal, 0, 1))
    return images, angles


def seconds(work: Callable[[], object], threads: int) -> float:
    with thread_budget(threads):
        start = time.perf_counter()
        work()
        return time.perf_counter() - start


def main() -> None:
    logging.disable(logging.INFO)
    print(f"{SHAPE[0]} photographs of {SHAPE[1] * SHAPE[2] / 1e6:.0f} Mpixel, {cores()} cores, best of {ROUNDS} rounds")
    header = ("what", "threads", "seconds", "times polanalyser", "copies")
    print("{:8} {:22} {:>7} {:>9} {:>18} {:>7}".format("dtype", *header))
    for dtype in (np.uint16, np.float32):
        images, angles = photographs(dtype)
        target = np.zeros_like(images)
        out = tuple(np.zeros(SHAPE[1:], np.float32) for _ in range(3))
        photos = PolarizerSequence(images, angles, np.ones(SHAPE[1:], bool))

        def copy(images: np.ndarray = images, target: np.ndarray = target) -> None:
            over_rows(lambda a, b: np.copyto(target[:, a:b], images[:, a:b]), SHAPE[1], tile=250)

        def fit(images: np.ndarray = images, angles: np.ndarray = angles, out: tuple = out) -> None:
            over_rows(fit_rows(images, harmonic_fit(angles), None, out), SHAPE[1], tile=128)

        def stokes(images: np.ndarray = images, angles: np.ndarray = angles) -> np.ndarray:
            return pa.cvtStokesToAoLP(pa.calcStokes(images, angles))

        ways: dict[tuple[str, int], Callable[[], object]] = {}
        for threads in sorted({1, cores()}):
            ways["copy", threads] = copy
            ways["fit", threads] = fit
            if dtype is np.float32:
                ways["stage, prenormalize", threads] = lambda p=photos: cosine(p)
                ways["stage, not prenormalize", threads] = lambda p=photos: cosine(p, prenormalize=False)
                ways["curve known", threads] = lambda p=photos: jones(p, **KNOWN)
                ways["curve searched", threads] = lambda p=photos: jones(p)
        fit()
        if dtype is np.float32:
            cosine(photos)
            jones(photos)
        best = dict.fromkeys([("polanalyser", 1), *ways], np.inf)
        for _ in range(ROUNDS):
            for key, work in ways.items():
                best[key] = min(best[key], seconds(work, key[1]))
            best["polanalyser", 1] = min(best["polanalyser", 1], seconds(stokes, 1))
        for (name, threads), best_s in best.items():
            gain, copies = (
                best["polanalyser", 1] / best_s,
                best_s / best["copy", threads if name != "polanalyser" else 1],
            )
            print(f"{np.dtype(dtype).name:8} {name:22} {threads:7} {best_s:9.4f} {gain:18.1f} {copies:7.2f}")
        difference = np.rad2deg(np.abs(axial_difference(out[0], stokes())))
        print(f"{np.dtype(dtype).name:8} angle differs from polanalyser's by at most {difference.max():.2g} degrees")


if __name__ == "__main__":
    main()
