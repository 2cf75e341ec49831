"""Draw viewer.png, the viewer of a page in Chromium: ``python docs/images/viewer.py``."""

from __future__ import annotations

import shutil
from pathlib import Path

import cv2
import numpy as np
from playwright.sync_api import sync_playwright

import pipeline

SMALL = ["size_px=[120,80]", "samples=1"]
WORDS = [f"graph.{node}.{word}" for node in ("rendering", "oblique") for word in SMALL]
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist"]
CLOSER = "([factor, x, y]) => { const {viewer} = document.querySelector('.viewer'); viewer.magnify(factor, x, y); }"


def main() -> None:
    """The sheet as it is lit at first, and dots of it."""
    report = pipeline.run("render_point_light", WORDS).report.resolve()
    shots = []
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=FLAGS)
        tab = browser.new_page(viewport={"width": 700, "height": 800})
        tab.goto(report.as_uri())
        tab.wait_for_selector("figure.viewer.live")
        stage = tab.locator(".viewer .stage")
        for closer in ([1, 0, 0], [260, -0.0405, -0.0402]):
            tab.evaluate(CLOSER, closer)
            tab.wait_for_function("() => !document.querySelector('.viewer').viewer.frame.asked")
            tab.wait_for_timeout(500)
            shots.append(cv2.imdecode(np.frombuffer(stage.screenshot(), np.uint8), cv2.IMREAD_COLOR))
        browser.close()
    gap = np.full((shots[0].shape[0], 24, 3), 255, np.uint8)
    cv2.imwrite(str(Path(__file__).with_suffix(".png")), np.hstack([shots[0], gap, shots[1]]))


if __name__ == "__main__":
    main()
