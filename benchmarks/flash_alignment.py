"""How well, and in what time, flash photographs are merged, rectified and cut into tiles: ours and what is plainer.

    python benchmarks/flash_alignment.py

The sheet of ``flash_polygons``, 10 x 7 tiles of 28 mm, is photographed as that experiment does. Radiance is compared
with what the lens gave the sensor, as the standard deviation of the logarithm of their ratio; corners and tiles with
where they are, in pixels of 0.27 mm. Tiles lie at most so far from where they should, relative to the reference.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from pipeline.data.flash import FlashPhotographs, Tiles
from pipeline.devices.flash_camera import FlashCamera
from pipeline.devices.simulated_flash import FlashBench, PhoneFlash
from pipeline.optics.imaging import seen_by_lens
from pipeline.optics.sheet.view import rectified as scanned
from pipeline.optics.tile_alignment import corners_of
from pipeline.stages.align.radiance import radiance
from pipeline.stages.align.rectified import rectified
from pipeline.stages.align.tiles import tiles
from pipeline.stages.capture.flash_photographs import flash_photographs
from pipeline.stages.simulate.polygons import polygons

SAMPLE = polygons()
TILE_MM, SHEET_MM = 28.0, np.array([280.0, 196.0])
WRONG_PX = {"right": np.zeros((4, 2)), "up to 14 px wrong": np.array([[8, -6], [-6, 8], [10, 10], [-8, 3]])}


def bench(*, raw: bool = False, board: list[int] | None = None, field_of_view_deg: float | None = None) -> FlashBench:
    """The rig of the experiment."""
    camera = FlashCamera(raw=raw, field_of_view_deg=field_of_view_deg)
    return FlashBench(camera=camera, light=PhoneFlash(), knows_corners=True, board=board)


def timed(work: Callable[[], Any]) -> tuple[Any, float]:
    """What it gives, and the seconds of the second time."""
    work()
    begun = time.perf_counter()
    return work(), time.perf_counter() - begun


def merging() -> None:
    """Radiance by each method."""
    print("| photographs | merged by | error of ln radiance | seconds |\n|---|---|---|---|")
    rig = bench()
    rig.place(SAMPLE)
    rig.light.put(0)
    truth = seen_by_lens(rig.camera._scene(), blur_px=rig.camera.blur_px)  # type: ignore[misc]
    for raw in (False, True):
        taken = flash_photographs(SAMPLE, rig=bench(raw=raw))
        for method in ("weighted",) if raw else ("debevec", "weighted"):
            found, seconds = timed(lambda: radiance(taken, method=method))  # type: ignore[arg-type]  # noqa: B023
            lit = found.valid[0] & (truth[..., 1] > 3e-3)
            error = np.std(np.log(found.radiance[0, lit, 1] / truth[lit][:, 1]))
            print(f"| {'raw' if raw else '8 bits'} | {method} | {error:.3f} | {seconds:.2f} |")


def corners(merged: FlashPhotographs, known: NDArray[np.float64]) -> None:
    """Corners by each method."""
    print("\n| corners by | largest error, px | seconds |\n|---|---|---|")
    wide = flash_photographs(SAMPLE, rig=bench(board=[29, 22], field_of_view_deg=42.0))
    for name, photos, true, how in (
        ("outline, room light", merged, known, "contour"),
        ("outline, flash", replace(merged, room=None), known, "contour"),
        ("ChArUco board", radiance(wide), wide.corners_px, "charuco"),
    ):
        found, seconds = timed(lambda: rectified(photos, corners=how))  # type: ignore[arg-type]  # noqa: B023
        print(f"| {name} | {np.abs(found.corners_px - true).max():.2f} | {seconds:.2f} |")


def misplaced(found: Tiles, photos: FlashPhotographs, known: NDArray[np.float64]) -> float:
    """Largest distance of a tile's corner from where it should be relative to the reference, in pixels."""
    rows, columns = photos.valid.shape[1:]
    half = np.array([[-1, 1], [1, 1], [1, -1], [-1, -1]]) * SHEET_MM / 2
    assumed = (
        cv2.findHomography(half, photos.corners_px)[0] @ scanned(rows, columns, found.pixel_mm, np.zeros(3)).homography
    )
    to_sheet = np.linalg.inv(cv2.findHomography(half, known)[0]) @ assumed
    place = np.stack([corners_of(to_sheet @ homography, found.shape) for homography in found.homographies])
    away = place - place[found.reference]
    away -= TILE_MM * np.rint(away.mean(axis=1, keepdims=True) / TILE_MM)
    return float(np.linalg.norm(away, axis=-1).max() / found.pixel_mm)


def placing(merged: FlashPhotographs, known: NDArray[np.float64]) -> None:
    """Tiles by each method."""
    print(
        "\n| corners | tile | motion | largest error, px | stated residual, px | seconds |\n|---|---|---|---|---|---|"
    )
    for corner, wrong in WRONG_PX.items():
        photos = rectified(merged, corners_px=(known + wrong).tolist())
        for tile in (None, [28.3, 27.8]):
            for motion in ("translation", "tile", "sheet", "auto"):
                found, seconds = timed(lambda: tiles(photos, tile_mm=tile, motion=motion))  # type: ignore[arg-type]  # noqa: B023
                error, stated = misplaced(found, photos, known), found.metrics["residual_px"]
                name = "found" if tile is None else "picked 1 % too wide"
                print(f"| {corner} | {name} | {motion} | {error:.2f} | {stated:.2f} | {seconds:.2f} |")


def main() -> None:
    """Print the tables of docs/flash.md."""
    merging()
    taken = flash_photographs(SAMPLE, rig=bench())
    merged = radiance(taken)
    assert taken.corners_px is not None
    corners(merged, taken.corners_px)
    placing(merged, taken.corners_px)


if __name__ == "__main__":
    main()
