"""The viewer of a run that has maps: which maps, in what light, and how it looks where nothing can be turned."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from pipeline.data.gratings import GratingSample, OrientationMap, PeriodMap
from pipeline.data.height_fields import HeightField
from pipeline.data.pictures import PictureSeries
from pipeline.optics.colour import encode_srgb
from pipeline.optics.rasterise import Camera
from pipeline.optics.sheet.view import View, fitting_field_of_view, photographed
from pipeline.parallel import over_rows
from pipeline.report.encoded import webp_uri
from pipeline.report.view import NodeView, RunView
from pipeline.viewer.payload import MOST_STRETCH, deepest_um, payload
from pipeline.viewer.scene import Scene

MOST_TEXELS = 512
MOST_SHEETS = 8
STILL_PIXELS = 400
ASPECTS = (1.5, 2.2)
MOST_LIGHT_MM = 64.0
WHITE_PERCENTILE = 97
"""Of what is lit at first; brighter points, as in the mirror image of the light, are clipped."""
_MIDDLE_UM = 0.55
_BINS = 36


@dataclass(frozen=True)
class Sheet:
    """Maps that the reader may choose.

    Attributes
    ----------
    name : str
        In a word or two.
    caption : str
        Whose maps these are.
    payload : Markup
        JSON for the script.
    """

    name: str
    caption: str
    payload: Markup


@dataclass(frozen=True)
class Viewer:
    """What the page's element needs.

    Attributes
    ----------
    still : str
        Picture for where nothing can be drawn, as a data URI.
    aspect : float
        Width over height of the picture.
    sheets : list of Sheet
        The maps, those first that the page begins with.
    pictures : list of str
        Nodes whose rendered pictures the page shows.
    light_sigma, depth, deepest, stretch, most_light : float
        Where sliders start and end.
    """

    still: str
    aspect: float
    sheets: list[Sheet]
    pictures: list[str]
    light_sigma: float
    depth: float
    deepest: float
    stretch: float
    most_light: float


def viewer(run: RunView, values: Mapping[str, Any]) -> Viewer | None:
    """The viewer of a run, if it has maps of orientation and period."""
    found = list(islice(_different(_scenes(run, values)), MOST_SHEETS))
    if not found:
        return None
    first, _, _ = found[0]
    aspect = float(np.clip(first.size_mm[0] / first.size_mm[1], *ASPECTS))
    scene = reduced(first)
    view = first_view(scene, round(STILL_PIXELS / aspect), STILL_PIXELS)
    scene = replace(scene, eye_mm=view.eye_mm)
    rgb = _rendered(scene, view)
    if not rgb.any():
        scene = replace(scene, light_mm=_shining_light(scene.orientation_rad, scene.period_um))
        rgb = _rendered(scene, view)
    brightest = rgb.max(axis=-1)
    lit = brightest[brightest > 0.01 * brightest.max()]
    white = float(np.percentile(lit, WHITE_PERCENTILE)) if lit.size else 1.0
    sheets = []
    for other, name, whose in found:
        thin = reduced(other)
        shown = replace(
            scene,
            orientation_rad=thin.orientation_rad,
            period_um=thin.period_um,
            pixel_mm=thin.pixel_mm,
            tiles=thin.tiles,
        )
        text = payload(shown, exposure=1 / white, file=f"{run.name}_{run.digest}.png")
        sheets.append(Sheet(name, f"{whose} {_size(other.orientation_rad.shape, shown)}", Markup(text)))
    return Viewer(
        still=webp_uri(encode_srgb(rgb / white)),
        aspect=aspect,
        sheets=sheets,
        pictures=[name for name, value in values.items() if isinstance(value, PictureSeries)],
        light_sigma=scene.light_sigma_mm,
        depth=scene.depth_um,
        deepest=deepest_um(scene),
        stretch=MOST_STRETCH,
        most_light=max(MOST_LIGHT_MM, scene.light_sigma_mm),
    )


def _different(scenes: Iterable[tuple[Scene, str, str]]) -> Iterator[tuple[Scene, str, str]]:
    """Scenes, each pair of maps once."""
    seen: list[tuple[NDArray[np.floating], NDArray[np.floating]]] = []
    for scene, name, whose in scenes:
        pair = (scene.orientation_rad, scene.period_um)
        if not any(all(map(_equal, pair, other)) for other in seen):
            seen.append(pair)
            yield scene, name, whose


def _equal(one: NDArray[np.floating], other: NDArray[np.floating]) -> bool:
    return one is other or np.array_equal(one, other, equal_nan=True)


def reduced(scene: Scene, most: int = MOST_TEXELS) -> Scene:
    """Every so manieth point of large maps: orientations on both sides of an edge have no mean."""
    every = -(-max(scene.orientation_rad.shape) // most)
    kept = slice(every // 2, None, every)
    return replace(
        scene,
        orientation_rad=np.asarray(scene.orientation_rad[kept, kept]),
        period_um=np.asarray(scene.period_um[kept, kept]),
        pixel_mm=scene.pixel_mm * every,
    )


def first_view(scene: Scene, rows: int, columns: int) -> View:
    """The whole sheet from where the eye is; if part of it lies beside or behind, from above its middle."""
    up, width_height = np.array([0.0, 1.0, 0.0]), scene.size_mm
    above = np.array([0.0, 0.0, float(np.linalg.norm(scene.eye_mm))])
    for eye in (scene.eye_mm, above):
        camera = Camera(eye, np.zeros(3), up, 0.5)
        try:
            angle = fitting_field_of_view(camera, *width_height, rows, columns)
        except ValueError:
            continue
        return photographed(replace(camera, field_of_view_rad=angle), rows, columns)
    raise AssertionError("a sheet is always in front of what is above it")


def _rendered(scene: Scene, view: View) -> NDArray[np.float32]:
    from pipeline.optics.sheet.maps import Tiled, sample_rows
    from pipeline.optics.sheet.spectral import shade_rows, spectral_table

    planes = np.stack([scene.orientation_rad, scene.period_um]).astype(np.float32)
    maps = Tiled(planes, scene.pixel_mm, scene.tiles)
    table = spectral_table(
        light=scene.illuminant,
        wavelength_step_nm=5.0,
        coherence_um=scene.coherence_um,
        depth_um=scene.depth_um,
        longest_period_um=float(np.nanmax(scene.period_um)),
        largest_half_vector=2.0,
        normal_reflectance=scene.normal_reflectance,
    )
    shown = np.empty((2, view.rows, view.columns), np.float32)
    rgb = np.zeros((view.rows, view.columns, 3), np.float32)

    def shade(first: int, last: int) -> None:
        sample_rows(maps, view, shown, (first, last))
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


def _scenes(run: RunView, values: Mapping[str, Any]) -> Iterator[tuple[Scene, str, str]]:
    """Scenes of a run, the best first: as nodes render it, else as measured; as drawn; absolute orientations first."""
    lit = [(node, pair) for node in run.nodes.values() if (pair := _pair(node.inputs, values)) and _is_lit(node)]
    rendered = False
    maps = [(o, p) for o in _of(values, OrientationMap) for p in _of(values, PeriodMap)]
    for absolute in (True, False):
        for node, (o, p) in lit:
            if values[o].absolute == absolute and _usable(values[o].orientation_rad, values[p].period_um):
                flat = " Its bumps are left out." if _given(node.inputs, values, HeightField) else ""
                rendered = True
                whose = _whose(o, p, values[o].absolute, node.name) + flat
                yield _as_lit(node, values[o], values[p]), f"{o}, {p}", whose
    for absolute in (True, False) if not rendered else ():
        for o, p in maps:
            if values[o].absolute == absolute and _usable(values[o].orientation_rad, values[p].period_um):
                pixel_mm = values[o].pixel_mm or values[p].pixel_mm
                yield (
                    _lit_by_default(values[o].orientation_rad, values[p].period_um, pixel_mm),
                    f"{o}, {p}",
                    _whose(o, p, absolute),
                )
    for name in _of(values, GratingSample):
        sample = values[name]
        if _usable(sample.orientation_rad, sample.period_um):
            scene = _lit_by_default(sample.orientation_rad, sample.period_um, sample.pixel_mm)
            yield replace(scene, depth_um=sample.depth_um), f"{name}, as drawn", f"The {sample.name} as drawn ({name})."


def _of(values: Mapping[str, Any], kind: type) -> list[str]:
    return [name for name, value in values.items() if isinstance(value, kind)]


def _usable(orientation_rad: NDArray[np.floating], period_um: NDArray[np.floating]) -> bool:
    return orientation_rad.shape == period_um.shape and bool((np.isfinite(orientation_rad) & (period_um > 0)).any())


def _pair(inputs: Mapping[str, tuple[str, ...]], values: Mapping[str, Any]) -> tuple[str, str] | None:
    """Names of the maps of orientation and period that a node gets."""
    o, p = _given(inputs, values, OrientationMap), _given(inputs, values, PeriodMap)
    return (o[0], p[0]) if o and p else None


def _given(inputs: Mapping[str, tuple[str, ...]], values: Mapping[str, Any], kind: type) -> list[str]:
    """Nodes among those that a node gets whose values are of a kind."""
    sources = (source for group in inputs.values() for source in group or () if source in values)
    return [name for name in sources if isinstance(values[name], kind)]


def _is_lit(node: NodeView) -> bool:
    return {"lights_mm", "camera_mm", "light_sigma_mm", "depth_um"} <= set(node.settings)


def _as_lit(node: NodeView, orientation: OrientationMap, period: PeriodMap) -> Scene:
    """As the settings of a node under a point light say."""
    settings = node.settings
    index = settings.get("refractive_index")
    tiles = settings.get("tiles", (1, 1))
    columns = orientation.orientation_rad.shape[1]
    return Scene(
        orientation.orientation_rad,
        period.period_um,
        orientation.pixel_mm or period.pixel_mm or settings.get("width_mm", 15.0) / columns,
        np.asarray(settings["lights_mm"][0], np.float64),
        np.asarray(settings["camera_mm"], np.float64),
        (int(tiles[0]), int(tiles[1])),
        float(settings["light_sigma_mm"]),
        settings.get("illuminant", "D65"),
        float(settings["depth_um"]),
        float(settings.get("coherence_um", 65.0)),
        1.0 if index is None else ((index - 1) / (index + 1)) ** 2,
    )


def _lit_by_default(
    orientation_rad: NDArray[np.floating], period_um: NDArray[np.floating], pixel_mm: float | None
) -> Scene:
    pitch = pixel_mm or 15.0 / orientation_rad.shape[1]
    light = _shining_light(orientation_rad, period_um)
    return Scene(orientation_rad, period_um, pitch, light, np.array([0.0, 0.0, 500.0]))


def _shining_light(orientation_rad: NDArray[np.floating], period_um: NDArray[np.floating]) -> NDArray[np.float64]:
    """From where the commonest gratings send green along the sheet's normal."""
    known = np.isfinite(orientation_rad) & (period_um > 0)
    counts, edges = np.histogram(orientation_rad[known], _BINS, (0, np.pi))
    most = counts.argmax()
    among = known & (orientation_rad >= edges[most]) & (orientation_rad <= edges[most + 1])
    azimuth, period = float(np.median(orientation_rad[among])), float(np.median(period_um[among]))
    sine = min(_MIDDLE_UM / period, 0.9)
    return 400 * np.array([sine * np.cos(azimuth), sine * np.sin(azimuth), np.sqrt(1 - sine**2)])


def _whose(orientation: str, period: str, absolute: bool, node: str | None = None) -> str:
    light = f", lit as for {node}" if node else ""
    offset = (
        "" if absolute else " Orientations are known up to one offset: facets may shine under other lights than here."
    )
    return f"The maps of {orientation} and {period}{light}.{offset}"


def _size(shape: tuple[int, ...], scene: Scene) -> str:
    rows, columns = scene.orientation_rad.shape
    kept = f"{columns} × {rows} points"
    if rows < shape[0]:
        every = -(-max(shape) // MOST_TEXELS)
        kept = f"one of every {every} × {every} of {shape[1]} × {shape[0]} points"
    tiled = f", repeated {scene.tiles[0]} × {scene.tiles[1]} times" if scene.tiles != (1, 1) else ""
    width, height = scene.size_mm
    return f"{kept[0].upper()}{kept[1:]}{tiled}: {width:.3g} × {height:.3g} mm."
