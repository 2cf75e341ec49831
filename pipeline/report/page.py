"""The page: what was run, how to run it again, what came out, and what it took."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader
from markupsafe import Markup

from pipeline.data import PictureSeries
from pipeline.errors import PipelineError
from pipeline.report.figures import Picture, beside, figures_of
from pipeline.report.graph_picture import graph_svg
from pipeline.report.naming import labelled
from pipeline.runs import NodeRun, Run

TILES = 6


@dataclass(frozen=True)
class Section:
    """A node of the run with its figures."""

    node: NodeRun
    pictures: list[Picture]
    settings: list[tuple[str, str, bool]]
    metrics: list[Any]
    damage: str = ""


def page(run: Run) -> str:
    """The report as one HTML text that needs nothing else."""
    nodes = list(run.nodes.values())
    with ThreadPoolExecutor(2) as pool:
        sections = list(pool.map(lambda node: _section(run, node), nodes))
    template = Environment(loader=PackageLoader("pipeline.report"), autoescape=True).get_template("report.html.j2")
    measured = [node for node in nodes if node.seconds is not None]
    longest = max((node.seconds or 0.0 for node in measured), default=0.0)
    return template.render(
        run=run,
        tiles=[labelled(name, value) for name, value in run.metrics.items()][:TILES],
        metrics=[labelled(name, value) for name, value in run.metrics.items()],
        warnings=[(node.name, text) for node in nodes for text in node.warnings],
        troubled=[node for node in nodes if node.status in {"failed", "blocked"}],
        graph=Markup(graph_svg(run.nodes)),
        sections=sections,
        compared=_compared(run),
        measured=measured,
        longest=longest,
        data_uri=_data_uri,
        count={s: sum(node.status == s for node in nodes) for s in ("ran", "cached", "failed", "blocked", "absent")},
    )


def _section(run: Run, node: NodeRun) -> Section:
    pictures, metrics, damage = [], [], ""
    if node.artifact:
        try:
            value = run.value(node.name)
            pictures = [] if isinstance(value, PictureSeries) and _partners(run, node.name) else figures_of(value)
            metrics = [labelled(name, figure) for name, figure in getattr(value, "metrics", {}).items()]
        except PipelineError as error:
            damage = str(error)
    settings = [(name, _shown(value), name in node.written) for name, value in _flat(node.settings)]
    return Section(node, pictures, settings, metrics, damage)


def _partners(run: Run, name: str) -> list[str]:
    """Other nodes with pictures under the same lights."""
    series = _series(run)
    if name not in series:
        return []
    lights = series[name].light_mm
    return [n for n, other in series.items() if n != name and np.array_equal(other.light_mm, lights)]


def _series(run: Run) -> dict[str, PictureSeries]:
    return {n.name: run.value(n.name) for n in run.nodes.values() if n.artifact and n.type == PictureSeries.__name__}


def _compared(run: Run) -> list[tuple[list[str], Picture]]:
    """Pictures of several nodes under the same lights, beside each other."""
    series, done, found = _series(run), set(), []
    for name in series:
        partners = [name, *_partners(run, name)]
        if len(partners) > 1 and name not in done:
            done |= set(partners)
            found.append((partners, beside([series[n] for n in partners])))
    return found


def _flat(settings: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    rows = []
    for name, value in settings.items():
        if isinstance(value, Mapping):
            rows += _flat(value, f"{prefix}{name}.")
        else:
            rows.append((prefix + name, value))
    return rows


def _shown(value: Any) -> str:
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)


def _data_uri(picture: Picture) -> str:
    return "data:image/png;base64," + base64.b64encode(picture.png).decode()
