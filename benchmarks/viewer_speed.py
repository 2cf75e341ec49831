"""The viewer's shader: milliseconds a full-HD frame off screen, frames a second of a page in Chromium, and differences.

    python benchmarks/viewer_speed.py

A sheet of 300 by 300 mm, 512 x 512 points whose orientations and periods vary, under a light at three places. Off
screen (moderngl through EGL) each frame is drawn and waited for; the time is the median of several. Differences are the
largest from the sum over wavelengths in double precision, relative to its maximum, leaving out pixels in whose middle
two points of the maps meet: either is right. The page (playwright and Chromium) is that of ``render_point_light`` with
circles: drawn fully, and while a pointer drags the light, when slow machines draw fewer pixels. Chromium draws with
Mesa's software driver or, with ``--gpu``, on what it finds by itself.
"""

from __future__ import annotations

import shutil
import sys
import time
from dataclasses import replace
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import pipeline
from pipeline.errors import PipelineError
from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet.maps import Tiled, sample_rows
from pipeline.optics.sheet.spectral import shade_rows, spectral_table
from pipeline.optics.sheet.view import View, fitting_field_of_view, photographed
from pipeline.parallel import cores, over_rows
from pipeline.viewer.offscreen import OffScreen, renderer
from pipeline.viewer.scene import Scene
from pipeline.viewer.shader import METHODS, Method
from pipeline.viewer.textures import coded_maps

LIGHTS = {"aside": (200.0, 60.0, 300.0), "nearly in the mirror": (30.0, 0.0, 400.0), "grazing": (380.0, 0.0, 60.0)}
PAGE = ["maps=circles", "tiles=[1,1]", "graph.rendering.size_px=[120,120]", "graph.oblique.size_px=[120,90]"]
DRAWN_FULLY = """count => {
  const {viewer} = document.querySelector('.viewer'), {gl} = viewer.painter;
  const drawn = () => { viewer.paint(); gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4)); };
  drawn();
  const start = performance.now();
  for (let i = 0; i < count; i++) drawn();
  return (performance.now() - start) / count;
}"""
FRAMES = 7
SIDE = 512
SOFTWARE = ["--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist"]


def sheet() -> Scene:
    """Orientations that turn around the middle, periods that grow away from it."""
    y, x = np.mgrid[1 : -1 : SIDE * 1j, -1 : 1 : SIDE * 1j]
    theta, period = (np.arctan2(y, x) + np.hypot(x, y)) % np.pi, 0.7 + 0.6 * np.hypot(x, y)
    codes, (turn, low, step) = coded_maps(theta, period, 65535)
    theta, period = (codes[..., 0] - 1.0) * turn, low + (codes[..., 1] - 1.0) * step
    lights = np.array(list(LIGHTS.values()))
    return Scene(
        theta.astype(np.float32), period.astype(np.float32), 300 / SIDE, lights[0], np.array([0.0, 0.0, 500.0])
    )


def full_hd(scene: Scene) -> View:
    """As large in the picture as it can be."""
    camera = Camera(scene.eye_mm, np.zeros(3), np.array([0.0, 1.0, 0.0]), 0.5)
    angle = fitting_field_of_view(camera, *scene.size_mm, 1080, 1920, margin=0.6)
    return photographed(replace(camera, field_of_view_rad=angle), 1080, 1920)


def milliseconds(gl: OffScreen, view: View, method: Method, light_mm: np.ndarray) -> float:
    """Median of some frames, after one that does not count."""
    taken = []
    for _ in range(FRAMES + 1):
        start = time.perf_counter()
        gl.draw(view, method=method, light_mm=light_mm, samples=1, pixel_part=1.0)
        gl.finish()
        taken.append(1000 * (time.perf_counter() - start))
    return float(np.median(taken[1:]))


def reference(scene: Scene, view: View) -> np.ndarray:
    """The sum over wavelengths, on all cores."""
    planes = np.stack([scene.orientation_rad, scene.period_um])
    shown = np.empty((2, view.rows, view.columns), np.float32)
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)
    table = spectral_table(
        light=scene.illuminant,
        wavelength_step_nm=1.0,
        coherence_um=scene.coherence_um,
        depth_um=scene.depth_um,
        longest_period_um=float(scene.period_um.max()),
        largest_half_vector=2.0,
    )

    def shade(first: int, last: int) -> None:
        sample_rows(Tiled(planes, scene.pixel_mm), view, shown, (first, last))
        shade_rows(
            rgb,
            (first, last),
            shown[0],
            shown[1],
            view=view,
            light_mm=scene.light_mm,
            light_sigma_mm=scene.light_sigma_mm,
            table=table,
            pixel_part=1.0,
        )

    over_rows(shade, view.rows)
    return rgb


def off_screen(scene: Scene) -> None:
    """Time and differences of both methods."""
    view = full_hd(scene)
    few = view.thinned(4)
    column, row = np.meshgrid(np.arange(few.columns), np.arange(few.rows))
    texel = few.points(column, row) / scene.pixel_mm + SIDE / 2
    clear = np.abs(texel - np.round(texel)).min(axis=-1) > 1e-3
    print(f"\noff screen on {renderer()}, {cores()} cores\n")
    print("| method | light | ms a full-HD frame | difference |\n|---|---|---|---|")
    with OffScreen(scene) as gl:
        for name, place in LIGHTS.items():
            light = np.array(place)
            expected = reference(replace(scene, light_mm=light), few)
            for method in METHODS:
                found = gl.picture(few, method=method, light_mm=light, pixel_part=1.0)
                error = np.abs(found - expected)[clear].max() / expected.max()
                print(f"| {method} | {name} | {milliseconds(gl, view, method, light):.3g} | {error:.1e} |")


def in_chromium(flags: list[str]) -> None:
    """Frames a second of a run's page while the light is dragged, as the page itself counts them."""
    from playwright.sync_api import sync_playwright

    path = next((found for name in ("chromium", "google-chrome") if (found := shutil.which(name))), None)
    if path is None:
        raise PipelineError("there is no Chromium; on Debian: apt install chromium")
    with TemporaryDirectory() as folder, sync_playwright() as playwright:
        places = [f"paths.runs={folder}", f"paths.store={folder}/store"]
        run = pipeline.run("render_point_light", [*PAGE, *places])
        browser = playwright.chromium.launch(executable_path=path, args=["--no-sandbox", *flags])
        tab = browser.new_page(viewport={"width": 1120, "height": 900})
        tab.goto(run.report.resolve().as_uri())
        tab.wait_for_selector("figure.viewer.live")
        box = tab.locator(".viewer canvas").bounding_box()
        print(f"\nin Chromium, {box['width']:.0f} x {box['height']:.0f} pixels\n")
        print("| method | drawn fully, ms | while dragged, frames a second |\n|---|---|---|")
        for method in ("table", "spectral"):
            tab.locator(f"input[value={method}]").check()
            print(f"| {method} | {tab.evaluate(DRAWN_FULLY, FRAMES):.3g} | {_dragged(tab, box):.3g} |")
        browser.close()


def _dragged(tab: Any, box: Any) -> float:
    tab.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    tab.mouse.down()
    for step in range(90):
        tab.mouse.move(box["x"] + box["width"] / 2 + step, box["y"] + box["height"] / 2 - step / 2)
    tab.mouse.up()
    return 1000 / float(tab.evaluate("() => document.querySelector('.viewer').viewer.frame.ms"))


def main() -> None:
    """Print both tables."""
    off_screen(sheet())
    in_chromium([] if "--gpu" in sys.argv else SOFTWARE)


if __name__ == "__main__":
    main()
