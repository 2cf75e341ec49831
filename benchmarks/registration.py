"""Registration of a simulated logo photographed through a turning polariser: ours, OpenCV's, and none.

    python benchmarks/registration.py

The photographs are those of ``simulate.logo`` on the simulated bench, 12 of 810 x 810 pixels with noise and
displacements by hand of half a pixel per axis. The shift error is the root mean square over both axes and all
photographs but the first, whose frame is the reference. The orientation error is that of ``fit.cosine`` without
pre-normalisation and without a filter, one offset removed: over all pixels, and over those within two pixels of an
edge. Seconds are the best of three.
"""

from __future__ import annotations

import logging
import time

import cv2
import numpy as np

from pipeline.data import GratingSample, PolarizerSequence
from pipeline.devices.simulated import Camera, Panel, PolarizationBench
from pipeline.stages.align import register as module
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.stages.evaluate.orientation import orientation
from pipeline.stages.fit.cosine import cosine
from pipeline.stages.simulate.logo import logo

ROUNDS = 3


class Mount:
    """A polariser that turns at once."""

    stops_rad = None
    shaft_rad = 0.0

    def move_to(self, angle_rad: float) -> float:
        self.shaft_rad = angle_rad
        return angle_rad


def photographs(shift_px: float) -> tuple[GratingSample, PolarizerSequence, np.ndarray]:
    camera = Camera(shift_px=shift_px)
    bench = PolarizationBench(camera=camera, mount=Mount(), light=Panel())
    sample = logo()
    return sample, polarizer_sequence(sample, rig=bench, count=12), np.array(camera.shifts_px)


def edges_of(sample: GratingSample, pixels: tuple[int, ...]) -> np.ndarray:
    """Camera pixels within two pixels of where the true orientation changes."""
    ratio = sample.orientation_rad.shape[0] // pixels[0]
    truth = np.nan_to_num(sample.orientation_rad[ratio // 2 :: ratio, ratio // 2 :: ratio], nan=-1).astype(np.float32)
    kernel = np.ones((5, 5), np.uint8)
    return cv2.dilate(truth, kernel) != cv2.erode(truth, kernel)


def main() -> None:
    logging.disable(logging.WARNING)
    sample, photos, true_px = photographs(0.5)
    _, still, _ = photographs(0.0)
    near_edge = edges_of(sample, photos.valid.shape)
    cosine(still)
    found: list[np.ndarray] = []
    estimate = module._estimate
    module._estimate = lambda *args: (shifts := estimate(*args), found.append(shifts.shift_px))[0]
    print(f"{'method':18} {'shift rms px':>12} {'largest px':>10} {'mean deg':>9} {'at edges deg':>12} {'seconds':>8}")
    for method in ("no shifts at all", "none", "phase_correlation", "ecc", "edges"):
        seconds, aligned = (0.0, still) if method == "no shifts at all" else (np.inf, photos)
        for _ in range(0 if method == "no shifts at all" else ROUNDS):
            start = time.perf_counter()
            aligned = module.register(photos, method=method)
            seconds = min(seconds, time.perf_counter() - start)
        result = orientation(cosine(aligned, prenormalize=False), sample)
        at_edges = np.rad2deg(np.nanmean(np.abs(np.where(near_edge, result.error_rad, np.nan))))
        error = {"no shifts at all": 0 * true_px, "none": true_px}.get(method)
        error = found[-1] - true_px if error is None else error
        rms, largest = np.sqrt(np.mean(error[1:] ** 2)), np.abs(error).max()
        mean = result.metrics["orientation_error_mean_deg"]
        print(f"{method:18} {rms:12.4f} {largest:10.3f} {mean:9.3f} {at_edges:12.3f} {seconds:8.2f}")


if __name__ == "__main__":
    main()
