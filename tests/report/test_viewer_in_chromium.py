"""The page in a real browser: it draws what Python draws, answers to the reader, and asks nobody for anything."""

from __future__ import annotations

import base64
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from test_viewer import LIGHT, lit_run

from pipeline.data.gratings import PeriodMap
from pipeline.devices.virtual_light import Lighting
from pipeline.devices.virtual_sheet import Sampling, Sheet, render_sheet
from pipeline.optics.colour import encode_srgb
from pipeline.optics.sheet.view import View
from pipeline.report.page import page

SOFTWARE = ["--no-sandbox", "--use-gl=angle", "--use-angle=gl-egl", "--ignore-gpu-blocklist"]
LEVELS = {"spectral": 2, "table": 3}
"""Largest difference of a pixel's encoded levels, of 255."""
IDLE = "() => (v => !v.frame.asked && !v.frame.drawing)(document.querySelector('figure.viewer').viewer)"
"""Whether no frame is asked for or waited for: finer ones follow a coarse one by themselves."""


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    file = folder / "report.html"
    file.write_text(page(lit_run(folder)), encoding="utf-8")
    return file


@pytest.fixture(scope="module")
def playwright() -> Iterator[Any]:
    library = pytest.importorskip("playwright.sync_api", reason="playwright is not installed: pip install playwright")
    with library.sync_playwright() as found:
        yield found


def _launched(playwright: Any, *flags: str) -> Any:
    names = ("chromium", "chromium-browser", "google-chrome")
    path = next((found for name in names if (found := shutil.which(name))), None)
    if path is None:
        pytest.skip("there is no Chromium; on Debian: apt install chromium")
    return playwright.chromium.launch(executable_path=path, args=list(flags))


@pytest.fixture(scope="module")
def browser(playwright: Any) -> Iterator[Any]:
    found = _launched(playwright, *SOFTWARE)
    yield found
    found.close()


@pytest.fixture
def shown(browser: Any, report: Path) -> Iterator[Any]:
    """The page with a live viewer; in the end nothing has gone wrong and nothing was asked for."""
    tab = browser.new_page(viewport={"width": 560, "height": 700})
    wrong: list[str] = []
    tab.on("console", lambda message: wrong.append(message.text) if message.type in {"error", "warning"} else None)
    tab.on("pageerror", lambda error: wrong.append(str(error)))
    tab.on(
        "request", lambda request: None if request.url[:5] in {"file:", "data:", "blob:"} else wrong.append(request.url)
    )
    tab.goto(report.as_uri())
    tab.wait_for_selector("figure.viewer.live", timeout=20_000)
    yield tab
    tab.close()
    assert not wrong


def viewer(tab: Any, expression: str) -> Any:
    """What an expression in the page's script gives, ``viewer`` being the one of the page."""
    return tab.evaluate(f"() => {{ const {{viewer}} = document.querySelector('figure.viewer'); return {expression}; }}")


def picture(tab: Any) -> np.ndarray:
    """What the canvas shows, RGBA, 8 bits."""
    url = viewer(tab, "(viewer.paint(), viewer.canvas.toDataURL())")
    data = np.frombuffer(base64.b64decode(url.partition(",")[2]), np.uint8)
    return cv2.cvtColor(cv2.imdecode(data, cv2.IMREAD_UNCHANGED), cv2.COLOR_BGRA2RGBA)


def slide(tab: Any, name: str, value: float) -> None:
    tab.locator(f"input[name={name}]").evaluate(
        "(input, value) => { input.value = value; input.dispatchEvent(new Event('input', {bubbles: true})); }", value
    )


def expected(tab: Any, run: Any, light_sigma_mm: float) -> np.ndarray:
    """The same by the renderer of render.point_light, encoded, in levels."""
    seen, exposure = viewer(tab, "(viewer.paint(), [viewer.view(), viewer.sheet.start.exposure])")
    view = View(np.array(seen["to_sheet"]), np.array(seen["eye"]), seen["rows"], seen["columns"])
    lighting = Lighting(
        lights_mm=np.array([seen["light"]]),
        camera_mm=view.eye_mm,
        light_sigma_mm=light_sigma_mm,
        illuminant=LIGHT["illuminant"],
        depth_um=LIGHT["depth_um"],
        coherence_um=LIGHT["coherence_um"],
        wavelength_step_nm=1.0,
        refractive_index=LIGHT["refractive_index"],
    )
    theta, period = run.values["fit"].orientation_rad, run.values["period"].period_um
    sheet = Sheet(theta, period, LIGHT["width_mm"] / theta.shape[1], tuple(LIGHT["tiles"]))
    rgb = render_sheet(sheet, view, lighting, sampling=Sampling(1, 1.0))[0]
    return np.rint(255 * encode_srgb(exposure * rgb))


@pytest.mark.parametrize("method", LEVELS)
def test_it_draws_what_python_draws(shown: Any, tmp_path: Path, method: str) -> None:
    shown.locator(f"input[value={method}]").check()
    tab, run = shown, lit_run(tmp_path)
    for turned in (False, True):
        if turned:
            viewer(tab, "(viewer.turn(0.08, -0.05), viewer.magnify(1.4, 0.1, 0.1))")
        found, levels = picture(tab), expected(tab, run, LIGHT["light_sigma_mm"])
        inside = found[..., 3] == 255
        assert inside.mean() > 0.4
        assert levels.max() > 250
        away = np.abs(found[..., :3].astype(int) - levels)[inside].max(axis=-1)
        # A pixel in whose middle two points of the maps meet may show either.
        assert np.mean(away > LEVELS[method]) < 1e-3


def test_another_pair_of_maps_is_drawn_under_the_same_light(browser: Any, tmp_path: Path) -> None:
    run = lit_run(tmp_path)
    coarse = run.values["period"]
    finer = PeriodMap(0.9 * coarse.period_um, coarse.mask, coarse.pixel_mm)
    node = replace(run.nodes["torch"], name="again", inputs={"orientation": ("fit",), "period": ("finer",)})
    both = run.with_node(replace(run.nodes["period"], name="finer"), finer).with_node(node)
    file = tmp_path / "report.html"
    file.write_text(page(both), encoding="utf-8")
    tab = browser.new_page(viewport={"width": 560, "height": 700})
    tab.goto(file.as_uri())
    tab.wait_for_selector("figure.viewer.live", timeout=20_000)
    first = picture(tab)
    tab.locator("select[name=maps]").select_option("fit, finer")
    tab.wait_for_function("() => document.querySelector('.whose').textContent.includes('lit as for again')")
    found, levels = (
        picture(tab),
        expected(tab, replace(run, values={**run.values, "period": finer}), LIGHT["light_sigma_mm"]),
    )
    tab.locator("select[name=maps]").select_option("fit, period")
    tab.wait_for_function("() => document.querySelector('.whose').textContent.includes('lit as for torch')")
    assert np.array_equal(picture(tab), first)
    tab.close()
    inside = found[..., 3] == 255
    away = np.abs(found[..., :3].astype(int) - levels)[inside].max(axis=-1)
    assert np.mean(away > LEVELS["table"]) < 1e-3
    assert np.abs(found[..., :3].astype(int) - first[..., :3]).max() > 20


def test_sliders_change_the_picture_and_reset_takes_it_back(shown: Any) -> None:
    first = picture(shown)
    for name, value in (("light_sigma", 6.0), ("depth", 0.05), ("period_scale", 0.4), ("exposure", -2.0)):
        slide(shown, name, value)
        assert np.abs(picture(shown)[..., :3].astype(int) - first[..., :3]).max() > 20, name
        shown.locator("button[name=reset]").click()
        assert np.array_equal(picture(shown), first), name


def test_dragging_keys_and_wheel_move_light_sheet_and_picture(shown: Any) -> None:
    canvas = shown.locator("canvas")
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    middle = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    state = "(({light, yaw, pitch, zoom}) => ({light, yaw, pitch, zoom}))(viewer)"

    def drag(across: float, down: float, button: str = "left") -> None:
        shown.mouse.move(*middle)
        shown.mouse.down(button=button)
        shown.mouse.move(middle[0] + across, middle[1] + down, steps=3)
        shown.mouse.up(button=button)

    first, at = picture(shown), viewer(shown, state)
    drag(40, -30)
    moved = viewer(shown, state)
    assert moved["light"][0] > at["light"][0]
    assert moved["light"][1] > at["light"][1]  # y points up
    assert np.hypot(*moved["light"][:2]) > np.hypot(*at["light"][:2])
    assert np.linalg.norm(moved["light"]) == pytest.approx(np.linalg.norm(at["light"]))
    assert not np.array_equal(picture(shown), first)
    drag(40, 20, "right")
    turned = viewer(shown, state)
    assert turned["yaw"] > 0
    assert turned["pitch"] > 0
    assert turned["light"] == moved["light"]
    shown.mouse.wheel(0, -400)
    shown.wait_for_function("() => document.querySelector('figure.viewer').viewer.zoom > 1.5")
    shown.keyboard.press("ArrowLeft")
    assert viewer(shown, state)["light"][0] < turned["light"][0]
    shown.keyboard.press("m")
    assert shown.locator("input[value=spectral]").is_checked()
    shown.mouse.dblclick(*middle)
    assert viewer(shown, state) == at
    assert np.array_equal(picture(shown), first)


def test_dots_are_drawn_with_their_orientation_when_they_are_large(shown: Any) -> None:
    first = picture(shown)
    coarse = "(viewer.paint(0.5), viewer.magnify(1e9, 0, 0), viewer.paint(), viewer.texelPixels())"
    assert viewer(shown, coarse) == pytest.approx(160, rel=0.01)
    viewer(shown, "(viewer.magnify(1e-9, 0, 0), viewer.paint(), viewer.magnify(1e9, 0.1, 0.05))")
    large = picture(shown)
    assert viewer(shown, "(viewer.paint(), viewer.texelPixels())") == pytest.approx(160)
    slide(shown, "exposure", -30.0)
    assert picture(shown)[..., :3].max() > 150  # the line, where the grating itself is dark
    assert not np.array_equal(large, first)


def test_nothing_is_drawn_while_nothing_changes(shown: Any) -> None:
    shown.wait_for_function(IDLE)
    last = viewer(shown, "viewer.frame.last")
    shown.wait_for_timeout(150)
    assert viewer(shown, "viewer.frame.last") == last


def test_a_slow_card_gets_one_frame_at_a_time_and_fewer_pixels_while_a_slider_moves(shown: Any) -> None:
    shown.wait_for_function(IDLE)
    width = viewer(shown, "viewer.canvas.width")
    viewer(shown, "viewer.painter.gl.getSyncParameter = () => window.done ? 0x9119 : 0x9118")
    slide(shown, "depth", 0.2)
    shown.wait_for_function("() => document.querySelector('figure.viewer').viewer.frame.drawing")
    last = viewer(shown, "viewer.frame.last")
    slide(shown, "depth", 0.3)
    shown.wait_for_timeout(150)
    assert viewer(shown, "viewer.frame.last") == last
    shown.evaluate("window.done = true")
    shown.wait_for_function(
        f"last => document.querySelector('figure.viewer').viewer.frame.last > last && ({IDLE})()", arg=last
    )
    assert viewer(shown, "viewer.canvas.width") <= width / 2 + 1
    shown.locator("input[name=depth]").dispatch_event("change")
    shown.wait_for_function("w => document.querySelector('figure.viewer').viewer.canvas.width === w", arg=width)


def test_a_picture_can_be_kept(shown: Any) -> None:
    with shown.expect_download() as download:
        shown.locator("button[name=save]").click()
    assert download.value.suggested_filename == "toy_3f2a91c0.png"
    kept = cv2.imread(str(download.value.path()), cv2.IMREAD_UNCHANGED)
    assert kept.shape == picture(shown).shape


def test_two_fingers_zoom_and_one_moves_the_light(shown: Any) -> None:
    shown.locator("canvas").scroll_into_view_if_needed()
    box = shown.locator("canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    touch = shown.context.new_cdp_session(shown)

    def fingers(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": x + across, "y": y + down, "id": k} for k, (across, down) in enumerate(places)]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    first = viewer(shown, "[viewer.light[0], viewer.zoom]")
    fingers("touchStart", (0, 0))
    fingers("touchMove", (40, 0))
    fingers("touchEnd")
    moved = viewer(shown, "[viewer.light[0], viewer.zoom]")
    assert moved[0] > first[0]
    assert moved[1] == 1.0
    fingers("touchStart", (-20, 0), (20, 0))
    fingers("touchMove", (-60, 0), (60, 0))
    fingers("touchEnd")
    assert viewer(shown, "viewer.zoom") == pytest.approx(3.0, rel=0.1)
    assert viewer(shown, "viewer.light[0]") == moved[0]


def test_a_lost_context_is_made_anew(shown: Any) -> None:
    first = picture(shown)
    viewer(shown, "(window.lost = viewer.painter.gl.getExtension('WEBGL_lose_context')).loseContext()")
    shown.wait_for_function("() => document.querySelector('.viewer').viewer.painter.gl.isContextLost()")
    viewer(shown, "lost.restoreContext()")
    shown.wait_for_function("() => !document.querySelector('.viewer').viewer.painter.gl.isContextLost()")
    shown.wait_for_timeout(100)
    assert np.array_equal(picture(shown), first)


def test_without_float_targets_there_is_no_table(browser: Any, report: Path) -> None:
    tab = browser.new_page(viewport={"width": 560, "height": 700})
    tab.add_init_script("WebGL2RenderingContext.prototype.getExtension = () => null;")
    tab.goto(report.as_uri())
    tab.wait_for_selector("figure.viewer.live", timeout=20_000)
    assert tab.locator("input[value=spectral]").is_checked()
    assert tab.locator("input[value=table]").is_disabled()
    assert picture(tab)[..., :3].max() > 200
    tab.close()


def test_without_webgl_there_is_a_picture_and_a_sentence(playwright: Any, report: Path) -> None:
    browser = _launched(playwright, "--no-sandbox", "--disable-3d-apis")
    try:
        tab = browser.new_page()
        tab.goto(report.as_uri())
        tab.wait_for_selector("figure.viewer.still", timeout=20_000)
        assert "WebGL2" in tab.locator("figure.viewer .sorry").inner_text()
        assert tab.locator("figure.viewer .stage img").is_visible()
        assert not tab.locator("figure.viewer canvas").is_visible()
        assert not tab.locator("figure.viewer .controls").is_visible()
    finally:
        browser.close()
