"""A sheet in full HD in light probes: seconds and errors of every evaluator.

    python benchmarks/environment_speed.py [PROBE ...]

1920 x 1080 pixels on 300 mm, orientations and periods (0.9 to 1.7 um) that vary from pixel to pixel, seen from 500 mm,
in the procedural room and in probes of files. Seconds are the CPU's over all threads, preparation included, best of
two; two idle cores halve them. Sums are timed on every 8th pixel of every 8th row, brute force on every 96th. Errors
are relative to the largest value: the root mean square, and what a thousandth of the pixels exceeds, against the sum
over every nanometre; those of brute force are the delta response's against it. A sheet of one period, with two by two
points to a pixel, is for the low rank. The last line: terms of the best factorisation, by singular values, into
functions of the place and of the orientation, without the zeroth order.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pipeline.devices.probe_files import read_probe
from pipeline.devices.virtual_environment import Gratings, render_in_environment
from pipeline.devices.virtual_sheet import Sheet
from pipeline.optics.environment import delta
from pipeline.optics.environment.delta import tabulated_orders
from pipeline.optics.environment.probe import Probe, pose
from pipeline.optics.environment.procedural import SCENES, drawn
from pipeline.optics.environment.separated import Nodes, worked_out
from pipeline.optics.sheet.view import View, rectified
from pipeline.parallel import cpu_meter

ROWS, COLUMNS, WIDTH_MM = 1080, 1920, 300.0
EVERY, SELDOM = 8, 96


def sheet() -> Sheet:
    """Spokes of all orientations, and periods in waves."""
    y, x = np.mgrid[:ROWS, :COLUMNS]
    orientation = np.arctan2(ROWS / 2 - y - 0.3, x - COLUMNS / 2 + 0.2) % np.pi
    period = 1.3 + 0.4 * np.sin(9 * x / COLUMNS) * np.cos(7 * y / ROWS)
    return Sheet(orientation.astype(np.float32), period.astype(np.float32), WIDTH_MM / COLUMNS)


def timed(
    view: View, probe: Probe, rounds: int = 2, seen: Sheet | None = None, **settings: object
) -> tuple[NDArray[np.float32], float]:
    """A picture and the least CPU seconds."""
    seconds = []
    for _ in range(rounds):
        with cpu_meter() as used:
            rgb = render_in_environment(seen or SHEET, view, probe, Gratings(), **settings)  # type: ignore[arg-type]
            seconds.append(used())
    return rgb, min(seconds)


def errors(found: NDArray[np.float32], exact: NDArray[np.float32]) -> str:
    """Root mean square, and what a thousandth of the pixels exceeds, in percent of the largest value."""
    difference = 100 * np.abs(found - exact) / exact.max()
    rms, rare = np.sqrt((difference**2).mean()), np.percentile(difference.max(axis=-1), 99.9)
    return f"{rms:9.3f} % {rare:9.2f} %"


def compare(name: str, texels: NDArray[np.float32]) -> None:
    """All evaluators in one probe."""
    probe = Probe(texels, pose(0.0, np.deg2rad(20.0)))
    some, few = VIEW.thinned(EVERY), VIEW.thinned(SELDOM)
    exact, _ = timed(some, probe, 1, evaluator="reference", wavelength_step_nm=1.0)
    print(
        f"\n{name}, {texels.shape[1]} x {texels.shape[0]} texels: seconds, rms error, error of one pixel in a thousand"
    )
    for step in (5.0, 20.0):
        found, seconds = timed(some, probe, evaluator="reference", wavelength_step_nm=step)
        share = ROWS * COLUMNS / (some.rows * some.columns)
        print(f"{f'sum every {step:g} nm':>28} {seconds * share:8.2f} s {errors(found, exact)}")
    for label, settings in {
        "ordered, tolerance 0.01": {"tolerance": 0.01},
        "ordered, tolerance 0.03": {"tolerance": 0.03},
        "ordered, tolerance 0.1": {"tolerance": 0.1},
        "ordered, 20 nm": {"wavelength_step_nm": 20.0},
    }.items():
        found, seconds = timed(VIEW, probe, evaluator="ordered", **settings)
        print(f"{label:>28} {seconds:8.2f} s {errors(found[::EVERY, ::EVERY], exact)}")
    brute, seconds = timed(few, probe, 1, evaluator="brute")
    share = ROWS * COLUMNS / (few.rows * few.columns)
    step = SELDOM // EVERY
    print(f"{'brute force, delta against it':>28} {seconds * share:8.0f} s {errors(exact[::step, ::step], brute)}")
    even = Sheet(SHEET.orientation_rad, np.full_like(SHEET.period_um, 1.67), SHEET.pixel_mm)
    fine, _ = timed(VIEW, probe, 1, even, evaluator="ordered", tolerance=0.003, samples=2)
    for evaluator in ("ordered", "low_rank"):
        found, seconds = timed(VIEW, probe, 1, even, evaluator=evaluator, tolerance=0.03, samples=2)
        print(f"{f'one period, 0.03: {evaluator}':>28} {seconds:8.2f} s {errors(found, fine)}")
    print(f"{'low rank':>28} {terms(probe)}")


def terms(probe: Probe, period_um: float = 1.67) -> str:
    """How many products of a place's and an orientation's function miss at most so much of the largest value."""
    nodes = Nodes(EVERY * 12, (12, 21), 180, np.array([1 / period_um]))
    orders = tabulated_orders(wavelength_step_nm=10.0, depth_um=0.12, longest_period_um=period_um)
    orders = replace(orders, share=np.concatenate([np.zeros_like(orders.share[:1]), orders.share[1:]]))

    def paint(rgb: NDArray[np.float32], gratings: NDArray[np.float32], view: View) -> None:
        delta.shade_rows(rgb, (0, len(rgb)), gratings, view=view, probe=probe, orders=orders)

    values = worked_out(nodes, VIEW, paint)[0, ..., :3]
    matrix = np.moveaxis(values, 0, 2).reshape(nodes.places[0] * nodes.places[1], -1).astype(np.float64)
    left, sizes, right = np.linalg.svd(matrix, full_matrices=False)
    told = []
    for percent in (10, 3, 1):
        needed = next(
            k
            for k in range(len(sizes) + 1)
            if np.abs(matrix - (left[:, :k] * sizes[:k]) @ right[:k]).max() <= percent / 100 * matrix.max()
        )
        told.append(f"{needed} for {percent} %")
    return f"terms of {matrix.shape[0]}: " + ", ".join(told)


SHEET = sheet()
VIEW = rectified(ROWS, COLUMNS, WIDTH_MM / COLUMNS, np.array([0.0, 0.0, 500.0]))

if __name__ == "__main__":
    render_in_environment(SHEET, VIEW.thinned(64), Probe(drawn(SCENES["room"](3.0), 32), np.eye(3)), Gratings())
    compare("room", drawn(SCENES["room"](3.0), 256))
    for path in sys.argv[1:]:
        compare(Path(path).name, read_probe(Path(path)))
