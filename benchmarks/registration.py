"""Registration of the scenes of polarisation imaging, turned and shifted by hand: ours and OpenCV's.

    python benchmarks/registration.py
    python benchmarks/registration.py stars facets --methods edges ecc_edges

Every scene is photographed on the simulated bench as its experiment does, displaced by hand by half a pixel per axis
and turned by none, 0.2 or 0.5 degrees (standard deviations), with the noise of 10,000 electrons or of 1,000; then again
by a camera with pixels three times as large, displaced by half of one of those.

``rms px``
    By how much a method misplaces the corners of the picture, root mean square over the corners and over all
    photographs but the first. Photographs that it says it left where they were count as that.
``seconds``
    Of the whole stage, resampling included.
``left``
    How many photographs it left, of how many.

``edges`` is told nothing and finds out whether there are turns; OpenCV's methods run twice, for translations and for
rigid motions (``+ turn``). The last table has the geometric means of error and seconds over all rows of a method, and
their product, accuracy over time: the least is the default of ``align.register``.
"""

from __future__ import annotations

import argparse
import logging
import sys
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pipeline.data.gratings import GratingSample
from pipeline.data.photographs import PolarizerSequence
from pipeline.devices.simulated import Camera, Panel, PolarizationBench
from pipeline.optics.registration import Motions
from pipeline.optics.rigid import RigidMotion
from pipeline.stages.align import register as module
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.stages.simulate.banknote_emblem import banknote_emblem
from pipeline.stages.simulate.compact_disc import compact_disc
from pipeline.stages.simulate.facets import facets
from pipeline.stages.simulate.fireworks import fireworks
from pipeline.stages.simulate.gradient_stars import gradient_stars
from pipeline.stages.simulate.kinematic_tile import kinematic_tile
from pipeline.stages.simulate.logo import logo


@dataclass(frozen=True)
class Scene:
    """A sample, and how its experiment photographs it."""

    draw: Callable[[], GratingSample]
    pixel_mm: float
    count: int = 12
    step_deg: float = 15.0


SCENES = {
    "logo": Scene(logo, 0.02),
    "facets": Scene(facets, 0.02),
    "banknote": Scene(banknote_emblem, 0.03, 17, 13.0),
    "fireworks": Scene(fireworks, 0.03),
    "stars": Scene(gradient_stars, 0.03),
    "kinematic": Scene(kinematic_tile, 0.03, 13),
    "cd": Scene(compact_disc, 0.126),
}
WAYS = (
    (0.0, 10_000.0, 1),
    (0.2, 10_000.0, 1),
    (0.5, 10_000.0, 1),
    (0.5, 1_000.0, 1),
    (0.0, 10_000.0, 3),
    (0.5, 10_000.0, 3),
)
"""Degrees by which the hand turns, electrons, and how many times as large pixels are."""

METHODS = {
    "edges": ("edges", "auto"),
    "ecc": ("ecc", "shift"),
    "ecc + turn": ("ecc", "rigid"),
    "ecc_edges": ("ecc_edges", "shift"),
    "ecc_edges + turn": ("ecc_edges", "rigid"),
    "phase_correlation": ("phase_correlation", "shift"),
    "phase_correlation + turn": ("phase_correlation", "rigid"),
}


class Mount:
    """A polariser that stands where it is told, at once."""

    stops_rad: tuple[float, ...] | None = None
    shaft_rad = 0.0

    def move_to(self, angle_rad: float) -> float:
        self.shaft_rad = angle_rad
        return angle_rad


@dataclass(frozen=True)
class Case:
    """Photographs and how they truly moved."""

    scene: str
    turn_deg: float
    electrons: float
    coarser: int
    photos: PolarizerSequence
    true: list[RigidMotion]


def cases(scene: str) -> Iterator[Case]:
    """The scene photographed in each of the ways."""
    drawn = SCENES[scene].draw()
    for turn_deg, few, times in WAYS:
        pixel_mm = SCENES[scene].pixel_mm
        camera = Camera(pixel_mm=times * pixel_mm, blur_mm=0.6 * pixel_mm, electrons=few, turn_deg=turn_deg)
        bench = PolarizationBench(camera=camera, mount=Mount(), light=Panel())
        photos = polarizer_sequence(drawn, rig=bench, count=SCENES[scene].count, step_deg=SCENES[scene].step_deg)
        true = [RigidMotion(*motion) for motion in zip(camera.turns_rad, camera.shifts_px, strict=True)]
        yield Case(scene, turn_deg, few, times, photos, true)


def error_px(motions: list[RigidMotion], case: Case) -> float:
    """Root mean square over the picture's corners and all photographs but the first."""
    shape = case.photos.valid.shape
    corners = np.array([(0, 0, 1, 1), (0, 1, 0, 1)]) * (np.array(shape)[:, None] - 1.0)
    off = [
        one.apply(corners, shape, shape) - other.apply(corners, shape, shape)
        for one, other in zip(motions, case.true, strict=True)
    ]
    return float(np.sqrt(np.mean(np.sum(np.square(off[1:]), axis=1))))


def registered(case: Case, method: str, motion: str) -> tuple[list[RigidMotion], set[int], float]:
    """Motion found of each photograph, which of them were left where they were with a warning, and seconds."""
    found: list[Motions] = []
    left: set[int] = set()
    believed = module._believed
    listener = logging.Handler(logging.WARNING)
    listener.emit = lambda record: left.add(record.args[0]) if record.msg.startswith("Photo %d") else None
    module._believed = lambda motions, *rest: (found.append(motions), believed(motions, *rest))[1]
    module._log.addHandler(listener)
    try:
        start = time.perf_counter()
        module.register(case.photos, method=method, motion=motion)
        seconds = time.perf_counter() - start
    finally:
        module._believed = believed
        module._log.removeHandler(listener)
    motions = [RigidMotion() if k in left else found[0].of(k) for k in range(len(case.true))]
    return motions, left, seconds


def report(costs: dict[str, list[tuple[float, float]]]) -> None:
    """Geometric means over all rows, and the winner."""
    print(f"\n{'method':26} {'rms px':>9} {'worst px':>9} {'seconds':>8} {'px s':>9}")
    products = {}
    for method, rows in costs.items():
        error, seconds = np.exp(np.mean(np.log(rows), axis=0))
        products[method] = error * seconds
        print(f"{method:26} {error:9.4f} {max(e for e, _ in rows):9.2f} {seconds:8.2f} {products[method]:9.4f}")
    print(f"best by accuracy over time: {min(products, key=products.__getitem__)}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", default=list(SCENES), metavar="scene", help=", ".join(SCENES))
    parser.add_argument("--methods", nargs="+", default=list(METHODS), choices=METHODS)
    chosen = parser.parse_args()
    module._log.propagate = False
    logging.getLogger("pipeline").setLevel(logging.WARNING)
    costs: dict[str, list[tuple[float, float]]] = defaultdict(list)
    heading = f"{'scene':10} {'turned':>6} {'electrons':>9} {'pixels':>6} {'method':26} {'rms px':>9}"
    print(heading, f"{'seconds':>8} {'left':>6}")
    warm = False
    for scene in chosen.scenes:
        for case in cases(scene):
            if not warm:  # kernels are compiled
                registered(case, "edges", "rigid")
                warm = True
            still = error_px([RigidMotion()] * len(case.true), case)
            place = f"{scene:10} {case.turn_deg:6g} {case.electrons:9g} {case.coarser:6d}"
            print(f"{place} {'not registered':26} {still:9.4f}")
            for name in chosen.methods:
                motions, left, seconds = registered(case, *METHODS[name])
                error = error_px(motions, case)
                costs[name].append((error, seconds))
                note = f"{len(left)}/{len(motions) - 1}" if left else ""
                print(f"{place} {name:26} {error:9.4f} {seconds:8.2f} {note:>6}")
                sys.stdout.flush()
    report(costs)


if __name__ == "__main__":
    main()
