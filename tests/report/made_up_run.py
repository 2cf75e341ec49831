"""A run of every type of value, made up: no stage, no store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from pipeline.data.gratings import GratingSample, OrientationError, OrientationMap, PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import PolarizerSequence
from pipeline.data.pictures import PictureSeries
from pipeline.data.polarization import LineDeviation, PolarizerResponse

SIDE = 40
PIXEL_MM = 0.1


@dataclass(frozen=True)
class FakeNode:
    name: str
    stage: str = "toy.stage"
    summary: str = "What the stage does, with ``code`` in it."
    status: Literal["ran", "cached", "failed", "blocked", "absent"] = "ran"
    inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    written: frozenset[str] = frozenset()
    type: str = ""
    key: str = "c0ffee"
    artifact: str = ""
    seconds: float | None = 0.5
    cpu_seconds: float | None = 0.7
    peak_mb: float | None = 250.0
    host: str = "bench"
    finished: str = "2026-03-01T12:30:00+00:00"
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    reason: str = "never run"
    error: str = ""
    blocked_by: tuple[str, ...] = ()


@dataclass(frozen=True)
class FakeRun:
    path: Path
    nodes: Mapping[str, FakeNode]
    values: Mapping[str, Any]
    metrics: Mapping[str, float]
    name: str = "toy"
    digest: str = "3f2a91c0"
    command: str = "python -m pipeline +experiment=toy graph.photos.count=4"
    overrides: tuple[str, ...] = ("graph.photos.count=4",)
    description: str = "A toy that holds every kind of value."
    config_yaml: str = "graph:\n  photos: {stage: toy.stage}\n"
    versions: Mapping[str, str] = field(default_factory=lambda: {"python": "3.11.0", "numpy": "2.0.0"})
    commit: str = "0123456789abcdef0123456789abcdef01234567"
    host: str = "bench"
    finished: str = "2026-03-01T12:31:00+00:00"
    total_seconds: float = 185.0

    def value(self, name: str) -> Any:
        value = self.values[name]
        if isinstance(value, Exception):
            raise value
        return value

    def has(self, name: str) -> bool:
        return name in self.values

    def with_node(self, node: FakeNode, value: Any = None) -> FakeRun:
        """The same run with a node more, or another one of that name."""
        values = dict(self.values) if value is None else {**self.values, node.name: value}
        return replace(self, nodes={**self.nodes, node.name: node}, values=values)


@dataclass(frozen=True, eq=False)
class Unknown:
    """A value of a type that the report has not met."""

    height_um: np.ndarray
    photo: np.ndarray
    name: str = "step <1>"


def polygons(side: int = SIDE, sectors: int = 7) -> tuple[np.ndarray, np.ndarray]:
    """Orientation and period of a wheel of sectors on a ground without grating."""
    y, x = np.mgrid[1 : -1 : side * 1j, -1 : 1 : side * 1j]
    sector = np.floor((np.arctan2(y, x) / (2 * np.pi) % 1) * sectors)
    outside = (np.hypot(x, y) > 0.92) | (np.hypot(x, y) < 0.1)
    orientation = np.where(outside, np.nan, (sector * np.pi / sectors + 0.2) % np.pi).astype(np.float32)
    return orientation, np.where(outside, np.nan, 0.8 + 0.1 * (sector % 4)).astype(np.float32)


def polarizer_response(rows: int = 12, columns: int = 20, offset: float = 2.1) -> PolarizerResponse:
    """A map without a film, its third row flat."""
    theta, psi = np.arange(rows) * np.pi / rows, np.arange(columns) * np.pi / columns
    maximum = np.mod(theta + offset, np.pi)
    intensity = 1 + 0.5 * np.cos(2 * (psi - maximum[:, None]))
    intensity[2], maximum[2] = 1.0, np.nan
    return PolarizerResponse(intensity, psi, theta, maximum, 1.1, 0.7, 0.05, 0.0, offset, "a made-up grating")


def line_deviation() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Orientations, a deviation that wraps, and one after pre-normalisation."""
    theta = np.arange(18) * np.pi / 18
    wrapping = (2 * theta) % np.pi - np.pi / 2
    return theta, wrapping, 0.1 * np.sin(2 * theta)


def values_of_every_type(side: int = SIDE, count: int = 4) -> dict[str, Any]:
    random = np.random.default_rng(1)
    orientation, period = polygons(side)
    mask = np.isfinite(orientation)
    bright = np.where(mask, period / 1.4, 0.02).astype(np.float32)
    angles = np.arange(count) * np.pi / count
    swing = np.nan_to_num(np.cos(2 * (angles[:, None, None] - orientation)))
    images = (bright * (0.5 + 0.3 * swing) + 0.004 * random.standard_normal((count, side, side))).astype(np.float32)
    noisy = ((orientation + 0.01 * random.standard_normal(mask.shape)) % np.pi).astype(np.float32)
    correlation = np.where(mask, 1 - 0.01 * random.random(mask.shape), np.nan).astype(np.float32)
    lights = np.array([[100.0, 0.0, 100.0], [0.0, 100.0, 100.0], [-100.0, 0.0, 100.0]])
    rgb = (random.random((3, side, side, 3)) * mask[..., None]).astype(np.float32)
    camera = np.array([0.0, 0.0, 500.0])
    error = np.where(mask, 0.01 * random.standard_normal(mask.shape), np.nan).astype(np.float32)
    return {
        "sample": GratingSample(orientation, period, PIXEL_MM, 0.12, 1.1, 0.78, 0.05, 0.0, 0.02, "toy logo"),
        "photos": PolarizerSequence(images, angles, random.random(mask.shape) > 0.01, PIXEL_MM, 530.0),
        "fit": OrientationMap(noisy, correlation, bright, mask, PIXEL_MM),
        "period": PeriodMap(period, mask, PIXEL_MM),
        "torch": PictureSeries(rgb, lights, camera, PIXEL_MM, "Photographed"),
        "rendering": PictureSeries(0.9 * rgb, lights.copy(), camera, PIXEL_MM, "Rendered"),
        "evaluate": OrientationError(error, 0.3, {"orientation_error_mean_deg": 0.4}),
        "response": polarizer_response(),
        "line": LineDeviation(*line_deviation(), {"deviation_mean_deg": 1.3}),
        "quality": Metrics({"correlation_mean": 0.99, "masked_share_percent": 12.5}),
    }


def run_with(values: Mapping[str, Any], path: Path) -> FakeRun:
    inputs = {
        "photos": {"sample": ("sample",)},
        "torch": {"sample": ("sample",)},
        "fit": {"photos": ("photos",)},
        "period": {"orientation": ("fit",)},
        "rendering": {"orientation": ("fit",), "period": ("period",)},
        "evaluate": {"estimate": ("fit",), "truth": ("sample",)},
        "line": {"response": ("response",)},
        "quality": {"estimate": ("fit",)},
    }
    settings = {"count": 4, "rig": {"device": "toy.Rig", "camera": {"pixel_mm": 0.1}}, "seed": None}
    nodes = {
        name: FakeNode(
            name,
            type=type(value).__name__,
            artifact=f"digest of {name}",
            inputs=inputs.get(name, {}),
            settings=settings,
            written=frozenset({"count"}),
            status="cached" if name == "photos" else "ran",
        )
        for name, value in values.items()
    }
    figures = {"orientation_error_mean_deg": 0.4, "masked_share_percent": 12.5, "correlation_mean": 0.99}
    return FakeRun(path, nodes, values, figures)
