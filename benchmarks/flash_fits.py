"""Orientation and period from flash photographs against the least that reading them takes.

    python benchmarks/flash_fits.py

The sheet of ``flash_polygons``, 10 x 7 tiles, in five white and three green photographs of 1200 x 800 pixels. The limit
is one pass of a plain compiled loop over all views (each repeat of each pixel in each photograph): brightness between
pixels, direction and length of the half vector. Times are wall and CPU time on all cores, the least of several; other
processes that share the cores lengthen the first, not the second, of which the ratios are.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.simulated_flash import FlashBench, PhoneFlash
from pipeline.parallel import cores, over_rows
from pipeline.stages.align.radiance import radiance
from pipeline.stages.align.rectified import rectified
from pipeline.stages.align.tiles import tiles
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.fit.flash_orientation import flash_orientation
from pipeline.stages.fit.flash_period import flash_period
from pipeline.stages.fit.highlight import highlight
from pipeline.stages.simulate.polygons import polygons

PLACES = [[40.0, 20.0, 250.0], [-80.0, 50.0, 250.0], [-30.0, -90.0, 250.0], [90.0, -50.0, 250.0], [20.0, 110.0, 250.0]]
ROUNDS = 5


@njit(nogil=True, cache=True, error_model="numpy")
def plain_rows(pictures, homographies, lights, eye, pixel, columns, sums, first, last):  # type: ignore[no-untyped-def]
    """The least that a fit can do: what each view shows, and where it diffracts to."""
    high, wide = pictures.shape[1:]
    for row in range(first, last):
        for column in range(columns):
            for h in homographies:
                w = h[2, 0] * column + h[2, 1] * row + h[2, 2]
                across, down = (
                    (h[0, 0] * column + h[0, 1] * row + h[0, 2]) / w,
                    (h[1, 0] * column + h[1, 1] * row + h[1, 2]) / w,
                )
                i, j = int(down), int(across)
                if not (0 <= i < high - 1 and 0 <= j < wide - 1):
                    continue
                y, x = ((high - 1) / 2 - down) * pixel, (across - (wide - 1) / 2) * pixel
                cx, cy, cz = eye[0] - x, eye[1] - y, eye[2]
                by_eye = 1 / np.sqrt(cx * cx + cy * cy + cz * cz)
                f, g = down - i, across - j
                for k in range(len(pictures)):
                    lx, ly, lz = lights[k, 0] - x, lights[k, 1] - y, lights[k, 2]
                    by_light = 1 / np.sqrt(lx * lx + ly * ly + lz * lz)
                    u, v = lx * by_light + cx * by_eye, ly * by_light + cy * by_eye
                    p = pictures[k]
                    upper = (1 - g) * p[i, j] + g * p[i, j + 1]
                    lower = (1 - g) * p[i + 1, j] + g * p[i + 1, j + 1]
                    sums[row, 0] += (1 - f) * upper + f * lower
                    sums[row, 1] += np.arctan2(v, u)
                    sums[row, 2] += u * u + v * v


def one_pass(photos: FlashPhotographs, found: Tiles) -> Callable[[], object]:
    """A pass over all views; the pictures' means are made in it, as the fits do."""
    eye: NDArray[np.float64] = np.asarray(photos.camera_mm, np.float64)

    def run() -> object:
        pictures = photos.radiance.mean(axis=-1, dtype=np.float32)
        sums = np.zeros((found.shape[0], 3))
        given = pictures, found.homographies, photos.light_mm, eye, found.pixel_mm, found.shape[1], sums
        over_rows(lambda first, last: plain_rows(*given, first, last), found.shape[0], tile=8)
        return sums

    return run


def timed(work: Callable[[], object]) -> tuple[float, float]:
    """Milliseconds of wall and CPU time."""
    work()
    best = [np.inf, np.inf]
    for _ in range(ROUNDS):
        wall, cpu = time.perf_counter(), time.process_time()
        work()
        best = [min(best[0], time.perf_counter() - wall), min(best[1], time.process_time() - cpu)]
    return 1000 * best[0], 1000 * best[1]


def taken(places: list[list[float]], wavelength_nm: float | None) -> FlashPhotographs:
    """The sheet, photographed, merged and rectified."""
    camera = FlashCamera(wavelength_nm=wavelength_nm, bandwidth_nm=None if wavelength_nm is None else 10.0)
    return rectified(
        radiance(flash_photographs(SAMPLE, rig=FlashBench(camera=camera, light=PhoneFlash(lights_mm=places))))
    )


SAMPLE = polygons()


def main() -> None:
    """Print the table."""
    white, green = taken(PLACES, None), taken(PLACES[:3], 530.0)
    found, seen, seen_green = tiles(white), highlight(white), highlight(green)
    orientation = flash_orientation(white, found, seen)
    works: list[tuple[str, FlashPhotographs, Callable[[], object]]] = [
        ("align.tiles", white, lambda: tiles(white)),
        ("fit.highlight", white, lambda: highlight(white)),
        ("fit.flash_orientation threshold", white, lambda: flash_orientation(white, found, seen, method="threshold")),
        ("fit.flash_orientation lobe", white, lambda: flash_orientation(white, found, seen)),
        (
            "fit.flash_period naive",
            green,
            lambda: flash_period(green, found, seen_green, orientation, method="naive"),
        ),
        ("fit.flash_period modelled", green, lambda: flash_period(green, found, seen_green, orientation)),
    ]
    limits = {id(photos): timed(one_pass(photos, found)) for photos in (white, green)}
    print(f"{len(found.homographies)} tiles of {found.shape[1]} x {found.shape[0]} pixels, {cores()} threads")
    print("| | views, millions | wall, ms | CPU, ms | passes |\n|---|---|---|---|---|")
    for name, photos, work in works:
        views = len(photos.radiance) * len(found.homographies) * found.shape[0] * found.shape[1] / 1e6
        wall, cpu = timed(work)
        print(f"| {name} | {views:.1f} | {wall:.0f} | {cpu:.0f} | {cpu / limits[id(photos)][1]:.1f} |")
    for name, photos in (("one pass, white", white), ("one pass, green", green)):
        print(f"| {name} | | {limits[id(photos)][0]:.0f} | {limits[id(photos)][1]:.0f} | 1 |")


if __name__ == "__main__":
    main()
