"""The page's shader off screen against the reference: largest differences relative to the picture's maximum."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_up_sheet import difference, reference, spiral

from pipeline.errors import InputError
from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet.view import View, photographed, rectified
from pipeline.viewer import offscreen
from pipeline.viewer.offscreen import OffScreen
from pipeline.viewer.scene import Scene
from pipeline.viewer.shader import METHODS, Method

EXACT = {"spectral": 1e-3, "table": 1e-2}


@pytest.fixture(scope="module", autouse=True)
def _drawable() -> None:
    pytest.importorskip("moderngl", reason="moderngl is not installed: pip install 'optibench[gpu]'")
    try:
        offscreen.renderer()
    except InputError as error:
        pytest.skip(str(error))


def _oblique(scene: Scene, rows: int = 90, columns: int = 130) -> View:
    camera = Camera(np.array([-100.0, -200.0, 450.0]), np.zeros(3), np.array([0.0, 1.0, 0.0]), 0.13)
    return photographed(camera, rows, columns)


def _flat(scene: Scene) -> View:
    return rectified(90, 120, 0.35, scene.eye_mm)


SCENES = {
    "point": {"light_sigma_mm": 0.0},
    "small": {"light_sigma_mm": 12.0, "depth_um": 0.3},
    "wide, where negative orders overlap": {"light_sigma_mm": 60.0, "illuminant": "inverse A"},
    "in the mirror": {"light_mm": np.array([0.0, 0.0, 400.0]), "depth_um": 0.05},
    "film": {"normal_reflectance": 0.04, "light_mm": np.array([250.0, 100.0, 90.0])},
    "tiles": {"tiles": (3, 2), "pixel_mm": 0.15, "coherence_um": 35.0},
    "long periods, many orders": {"period_um": np.full((60, 60), 6.0, np.float32)},
}


@pytest.mark.parametrize("look", [_flat, _oblique])
@pytest.mark.parametrize("changes", SCENES.values(), ids=SCENES)
def test_both_methods_agree_with_the_reference(changes, look) -> None:
    scene = spiral(**changes)
    view = look(scene)
    scene = replace(scene, eye_mm=view.eye_mm)
    expected = reference(scene, view)
    assert expected.max() > 0
    with OffScreen(scene) as gl:
        for method in METHODS:
            assert difference(gl.picture(view, method=method), expected) < EXACT[method]


def test_lobes_are_widened_by_the_pixels_area() -> None:
    scene = spiral(pixel_mm=6.0, light_sigma_mm=0.0)
    view = rectified(40, 40, 9.0, scene.eye_mm)
    expected = reference(scene, view, pixel_part=1.0)
    assert difference(reference(scene, view), expected) > 0.1
    with OffScreen(scene) as gl:
        assert difference(gl.picture(view, pixel_part=1.0), expected) < EXACT["spectral"]


def test_samples_average_the_points_of_a_pixel() -> None:
    scene = spiral()
    view = rectified(20, 20, 1.2, scene.eye_mm)
    points = [view.moved(across, down) for across in (-1 / 3, 0, 1 / 3) for down in (-1 / 3, 0, 1 / 3)]
    expected = np.mean([reference(scene, point) for point in points], axis=0)
    with OffScreen(scene) as gl:
        assert difference(gl.picture(view, samples=3), expected) < EXACT["spectral"]


@pytest.mark.parametrize("method", METHODS)
def test_y_points_up_and_what_has_no_grating_is_dark(method: Method) -> None:
    theta = np.full((40, 60), np.nan, np.float32)
    theta[:20, 30:] = 0.0  # the upper right quarter sends its light along x
    scene = spiral(orientation_rad=theta, period_um=np.ones_like(theta), light_mm=np.array([180.0, 0.0, 300.0]))
    with OffScreen(scene) as gl:
        picture = gl.picture(rectified(50, 70, 0.4, scene.eye_mm), method=method)
    lit = picture.max(axis=-1) > 0
    assert lit[5:25, 35:65].all()
    lit[5:25, 35:65] = False
    assert not lit.any()


def test_a_light_elsewhere_is_taken_instead_of_the_scenes() -> None:
    scene = spiral()
    other = replace(scene, light_mm=np.array([-120.0, 30.0, 280.0]))
    view = _flat(scene)
    with OffScreen(scene) as gl:
        found = gl.picture(view, light_mm=other.light_mm)
    assert difference(found, reference(other, view)) < EXACT["spectral"]


def test_an_unknown_method_is_refused() -> None:
    with OffScreen(spiral()) as gl, pytest.raises(InputError, match="no method bessel"):
        gl.picture(_flat(gl.scene), method="bessel")  # type: ignore[arg-type]


def test_a_machine_without_egl_is_told_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    offscreen.renderer.cache_clear()
    monkeypatch.setattr(offscreen, "_PROBE", "raise Exception('cannot load libEGL.so')")
    with pytest.raises(InputError, match=r"cannot draw off screen: .*libEGL.*\n?.*libegl1"):
        OffScreen(spiral())
    monkeypatch.setattr(offscreen, "_PROBE", "import os; os.kill(os.getpid(), 11)")
    with pytest.raises(InputError, match="the driver ended its process"):
        offscreen.renderer()
    offscreen.renderer.cache_clear()
