"""A full-HD sheet under a point light: the fast renderer against the reference, in one run.

    python benchmarks/rendering_speed.py

1920 x 1080 pixels of 0.1 mm, orientations and periods (0.7 to 1.7 um) that vary from pixel to pixel, a camera at 500 mm
and a torch at 300 mm. In one scene orientations turn around the middle, so that spokes are lit; in the other every
pixel diffracts towards the camera. The reference sums 81 wavelengths and all orders in double precision. Times are wall
and CPU time of a frame on all cores, the best of several, tables and maps prepared; other processes that share the
cores lengthen the first, not the second. The limits: reading the maps and adding to a picture, and a plain compiled
loop with one look-up a pixel. Errors are the largest of any colour, relative to the brightest pixel and to white (the
brightest 0.5 percent of what is lit), and relative to the brightest where the reference sums 401 wavelengths.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.devices.virtual_light import white_level
from pipeline.optics.sheet import spectral, tabulated
from pipeline.optics.sheet.colour_table import ColourTable, Precision, colour_table
from pipeline.optics.sheet.extent import extent
from pipeline.optics.sheet.maps import Tiled, prepared_gratings, sample_rows
from pipeline.optics.sheet.view import View, rectified
from pipeline.parallel import cores, over_rows

ROWS, COLUMNS, PIXEL_MM = 1080, 1920, 0.1
EYE, LIGHT = np.array([0.0, 0.0, 500.0]), np.array([60.0, 120.0, 300.0])
DEPTH_UM, COHERENCE_UM = 0.12, 65.0
ROUNDS = 20

Float32Array = NDArray[np.float32]


def spokes() -> tuple[Float32Array, Float32Array]:
    """Orientations that turn ten times around the middle, and wavy periods."""
    y, x = np.mgrid[ROWS // 2 : -(ROWS // 2) : -1, -(COLUMNS // 2) : COLUMNS // 2]
    period = 1.2 + 0.5 * np.sin(x / 150) * np.cos(y / 170)
    return (5 * np.arctan2(y, x) % np.pi).astype(np.float32), period.astype(np.float32)


def everywhere() -> tuple[Float32Array, Float32Array]:
    """Orientations towards the mirror image of the torch."""
    y, x = np.mgrid[ROWS // 2 : -(ROWS // 2) : -1, -(COLUMNS // 2) : COLUMNS // 2] * PIXEL_MM
    point = EYE[:2] + (LIGHT[:2] - EYE[:2]) * EYE[2] / (EYE[2] + LIGHT[2])
    return (np.arctan2(y - point[1], x - point[0]) % np.pi).astype(np.float32), spokes()[1]


def timed(frame: Callable[[], object], rounds: int) -> tuple[float, float]:
    """Milliseconds of wall and CPU time."""
    best = [np.inf, np.inf]
    for _ in range(rounds):
        wall, cpu = time.perf_counter(), time.process_time()
        frame()
        best = [min(best[0], time.perf_counter() - wall), min(best[1], time.process_time() - cpu)]
    return 1000 * best[0], 1000 * best[1]


@njit(nogil=True, cache=True, error_model="numpy", fastmath=True)
def plain_rows(rgb, gratings, table, light, eye, pixel, first, last):  # type: ignore[no-untyped-def]
    """The least that a renderer by look-up can do: directions, and one node a pixel."""
    rows, columns = gratings.shape[1:]
    half = np.float32(0.5)
    for row in range(first, last):
        y = (half * np.float32(rows) - np.float32(row)) * pixel
        for column in range(columns):
            x = (np.float32(column) - half * np.float32(columns)) * pixel
            lx, ly, lz = light[0] - x, light[1] - y, light[2]
            cx, cy, cz = eye[0] - x, eye[1] - y, eye[2]
            by_light = np.float32(1) / np.sqrt(lx * lx + ly * ly + lz * lz)
            by_eye = np.float32(1) / np.sqrt(cx * cx + cy * cy + cz * cz)
            hx, hy = lx * by_light + cx * by_eye, ly * by_light + cy * by_eye
            c, s, a = gratings[0, row, column], gratings[1, row, column], gratings[2, row, column]
            u, v = abs(hx * c + hy * s) * a, abs(hy * c - hx * s)
            i, j = min(int(v * 1000), table.shape[0] - 1), min(int(u * 300), table.shape[1] - 1)
            for k in range(3):
                rgb[row, column, k] += table[i, j, k]


def compared(name: str, maps: tuple[Float32Array, Float32Array], light_sigma_mm: float, view: View) -> None:
    """Time both renderers of one scene, and print their difference."""
    orientation, period = maps
    occurring = extent(view, LIGHT, light_sigma_mm)
    gratings = prepared_gratings(orientation, period)
    started = time.perf_counter()
    table = made_table(light_sigma_mm, view, period)
    prepared = time.perf_counter() - started
    summed, finely = (
        spectral.spectral_table(
            light="D65",
            wavelength_step_nm=step_nm,
            coherence_um=COHERENCE_UM,
            depth_um=DEPTH_UM,
            longest_period_um=float(period.max()),
            largest_half_vector=occurring.across,
        )
        for step_nm in (5.0, 1.0)
    )
    exact, found, finer = (np.zeros((ROWS, COLUMNS, 3), np.float32) for _ in range(3))
    common = {"view": view, "light_mm": LIGHT, "light_sigma_mm": light_sigma_mm}

    def fast(first: int, last: int) -> None:
        tabulated.shade_rows(found, (first, last), gratings, table=table, **common)

    def slow(first: int, last: int) -> None:
        spectral.shade_rows(exact, (first, last), orientation, period, table=summed, **common)

    def slowest(first: int, last: int) -> None:
        spectral.shade_rows(finer, (first, last), orientation, period, table=finely, **common)

    for kernel, picture in ((fast, found), (slow, exact), (slowest, finer)):
        kernel(0, 1)
        picture[:] = 0
        over_rows(kernel, ROWS)
    error = float(np.abs(found - exact).max())
    lit = float((exact.max(axis=-1) > 0.01 * white_level(exact, 99.5)).mean())
    relative = (
        100 * error / float(exact.max()),
        100 * error / float(white_level(exact, 99.5)),
        100 * float(np.abs(found - finer).max() / finer.max()),
    )
    wall, cpu = timed(lambda: over_rows(fast, ROWS), ROUNDS)
    slow_wall, slow_cpu = timed(lambda: over_rows(slow, ROWS), 2)
    print(
        f"{name:>22} {100 * lit:4.0f} % {wall:8.1f} {cpu:8.1f} {slow_wall:9.0f} {slow_cpu:9.0f} {slow_cpu / cpu:6.0f} "
        f"{relative[0]:8.2f} {relative[1]:8.2f} {relative[2]:8.2f} {1000 * prepared:8.0f}"
    )


def in_double(view: View) -> None:
    """Time and compare the fast renderer in both precisions where every pixel is lit."""
    orientation, period = everywhere()
    gratings = prepared_gratings(orientation, period)
    pictures, cpu = {}, {}
    for precision in ("single", "double"):
        table = made_table(12.0, view, period, precision)
        planes, rgb = gratings.astype(table.orders.dtype), np.zeros((ROWS, COLUMNS, 3), np.float32)

        def fast(first: int, last: int, rgb=rgb, planes=planes, table=table) -> None:  # type: ignore[no-untyped-def]
            tabulated.shade_rows(
                rgb, (first, last), planes, view=view, light_mm=LIGHT, light_sigma_mm=12.0, table=table
            )

        fast(0, 1)
        rgb[:] = 0
        over_rows(fast, ROWS)
        pictures[precision] = rgb.copy()
        cpu[precision] = timed(lambda fast=fast: over_rows(fast, ROWS), ROUNDS)[1]
    apart = float(np.abs(pictures["single"] - pictures["double"]).max() / pictures["double"].max())
    print(
        f"all lit, sigma 12 mm, in double precision: CPU {cpu['double']:.1f} instead of {cpu['single']:.1f}; "
        f"single is off by {100 * apart:.1g} percent of the brightest pixel"
    )


def made_table(light_sigma_mm: float, view: View, period: Float32Array, precision: Precision = "single") -> ColourTable:
    """The table of colours of a scene."""
    return colour_table(
        extent(view, LIGHT, light_sigma_mm),
        light="D65",
        coherence_um=COHERENCE_UM,
        depth_um=DEPTH_UM,
        periods_um=(float(period.min()), float(period.max())),
        precision=precision,
    )


def main() -> None:
    """Print the table."""
    view = rectified(ROWS, COLUMNS, PIXEL_MM, EYE)
    gratings = prepared_gratings(*spokes())
    made_table(12.0, view, spokes()[1])
    print(f"{COLUMNS} x {ROWS} pixels, {cores()} threads; milliseconds of a frame, wall and CPU; errors in percent")
    print(
        f"{'scene, torch':>22} {'lit':>6} {'fast':>8} {'CPU':>8} {'reference':>9} {'CPU':>9} {'ratio':>6} "
        f"{'of max':>8} {'of white':>8} {'401':>8} {'table ms':>8}"
    )
    for name, maps in (("spokes", spokes()), ("all lit", everywhere())):
        for sigma in (12.0, 3.0, 0.0):
            compared(f"{name}, sigma {sigma:g} mm", maps, sigma, view)
    in_double(view)
    rgb = np.zeros((ROWS, COLUMNS, 3), np.float32)
    table = np.zeros((256, 512, 4), np.float32)
    moved = np.empty_like(gratings)
    light, eye, pixel = LIGHT.astype(np.float32), EYE.astype(np.float32), np.float32(PIXEL_MM)

    def added(first: int, last: int) -> None:
        rgb[first:last] += gratings[:, first:last].sum(axis=0)[..., None]

    def plain(first: int, last: int) -> None:
        plain_rows(rgb, gratings, table, light, eye, pixel, first, last)

    def sampled(first: int, last: int) -> None:
        sample_rows(Tiled(gratings, PIXEL_MM), view, moved, (first, last))

    for name, kernel in (
        ("maps read, picture added to", added),
        ("one look-up a pixel, plain loop", plain),
        ("maps looked up anew, as the camera moves", sampled),
    ):
        kernel(0, 1)
        wall, cpu = timed(lambda kernel=kernel: over_rows(kernel, ROWS), ROUNDS)
        print(f"{name:>42}: {wall:.1f}, CPU {cpu:.1f}")


if __name__ == "__main__":
    main()
