"""The graph as a picture: layers from left to right, one box a node, edges led around what lies between."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise

from markupsafe import Markup

from pipeline.report.naming import duration
from pipeline.report.view import NodeView

BOX_WIDTH, BOX_HEIGHT, BEND = 172, 60, 14
GAP_X, GAP_Y, MARGIN = 46, 18, 6
SWEEPS = 6

Slot = tuple[str, int]
"""A node's name, or a bend of an edge that passes: the edge's name and its layer."""


def graph_svg(nodes: Mapping[str, NodeView]) -> Markup:
    """Draw the nodes of a run, each a link to its section."""
    layers, ways = _layered(nodes)
    place = _placed(layers, ways)
    bottom = max((y + _tall(slot) / 2 for slot, (_, y) in place.items()), default=0.0)
    width = len(layers) * (BOX_WIDTH + GAP_X) - GAP_X + 2 * MARGIN
    height = bottom + MARGIN
    drawn = [_edge(way, place, f"{way[0][0]} to {way[-1][0]}: {said}") for way, said in ways]
    drawn += [_box(nodes[slot[0]], x, y) for slot, (x, y) in place.items() if slot[1] < 0]
    return Markup(
        f'<svg class="graph" viewBox="0 0 {width} {height:.0f}" role="img" aria-label="graph of the experiment" '
        f'style="min-width:{min(width, 118 * len(layers))}px;max-width:{width}px">{"".join(drawn)}</svg>'
    )


def _depths(nodes: Mapping[str, NodeView]) -> dict[str, int]:
    """Longest way from a source to each node."""
    depth: dict[str, int] = {}
    for name, node in nodes.items():
        above = [depth[s] for sources in node.inputs.values() for s in sources if s in depth]
        depth[name] = max(above, default=-1) + 1
    return depth


def _layered(nodes: Mapping[str, NodeView]) -> tuple[list[list[Slot]], list[tuple[list[Slot], str]]]:
    """Nodes by depth, with a bend in every layer that an edge passes; and the edges with the names of their inputs."""
    depth = _depths(nodes)
    layers: list[list[Slot]] = [[] for _ in range(max(depth.values(), default=-1) + 1)]
    for name in nodes:
        layers[depth[name]].append((name, -1))
    joined: dict[tuple[str, str], list[str]] = {}
    for name, node in nodes.items():
        for parameter, sources in node.inputs.items():
            for source in sources:
                if source in depth:
                    joined.setdefault((source, name), []).append(parameter)
    ways = []
    for (source, name), parameters in joined.items():
        bends: list[Slot] = [(f"{source} to {name}", layer) for layer in range(depth[source] + 1, depth[name])]
        for bend in bends:
            layers[bend[1]].append(bend)
        ways.append(([(source, -1), *bends, (name, -1)], ", ".join(parameters)))
    return layers, ways


def _placed(layers: list[list[Slot]], ways: Sequence[tuple[list[Slot], str]]) -> dict[Slot, tuple[float, float]]:
    """Left edge and middle height of every slot: ordered so that few edges cross, then pulled towards neighbours."""
    before: dict[Slot, list[Slot]] = {slot: [] for layer in layers for slot in layer}
    after: dict[Slot, list[Slot]] = {slot: [] for layer in layers for slot in layer}
    for way, _ in ways:
        for left, right in pairwise(way):
            before[right].append(left)
            after[left].append(right)
    y: dict[Slot, float] = {}
    for layer in layers:
        y |= _stacked(layer, {slot: float(i) for i, slot in enumerate(layer)})
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for layer in layers if forward else reversed(layers):
            near = before if forward else after
            wish = {slot: _mean([y[n] for n in near[slot]], y[slot]) for slot in layer}
            layer.sort(key=lambda slot: wish[slot])
            y |= _stacked(layer, wish)
    top = min((y[slot] - _tall(slot) / 2 for slot in y), default=0.0)
    return {
        slot: (MARGIN + index * (BOX_WIDTH + GAP_X), y[slot] - top + MARGIN)
        for index, layer in enumerate(layers)
        for slot in layer
    }


def _stacked(layer: Sequence[Slot], wish: Mapping[Slot, float]) -> dict[Slot, float]:
    """Heights in the given order, apart as they must be, on average where they wish to be."""
    y: dict[Slot, float] = {}
    reached = -float("inf")
    for slot in layer:
        y[slot] = max(wish[slot], reached + _tall(slot) / 2)
        reached = y[slot] + _tall(slot) / 2 + GAP_Y
    shift = _mean([wish[slot] - y[slot] for slot in layer], 0.0)
    return {slot: height + shift for slot, height in y.items()}


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _tall(slot: Slot) -> float:
    return BOX_HEIGHT if slot[1] < 0 else BEND


def _edge(way: Sequence[Slot], place: Mapping[Slot, tuple[float, float]], title: str) -> str:
    x, y = place[way[0]]
    steps = [f"M{x + BOX_WIDTH:.1f},{y:.1f}"]
    last = (x + BOX_WIDTH, y)
    for slot in way[1:]:
        x, y = place[slot]
        middle = (last[0] + x) / 2
        steps.append(f"C{middle:.1f},{last[1]:.1f} {middle:.1f},{y:.1f} {x:.1f},{y:.1f}")
        if slot[1] >= 0:
            x += BOX_WIDTH
            steps.append(f"L{x:.1f},{y:.1f}")
        last = (x, y)
    return f'<path class="edge" d="{"".join(steps)}"><title>{escape(title)}</title></path>'


def _box(node: NodeView, x: float, y: float) -> str:
    top = y - BOX_HEIGHT / 2
    taken = f", {duration(node.seconds)}" if node.seconds is not None and node.status in {"ran", "cached"} else ""
    told = f"{node.name} ({node.stage}): {node.status}{taken}"
    return (
        f'<a href="#node-{escape(node.name)}"><g class="box {node.status}"><title>{escape(told)}</title>'
        f'<rect x="{x:.1f}" y="{top:.1f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6"/>'
        f'<rect class="state" x="{x:.1f}" y="{top:.1f}" width="5" height="{BOX_HEIGHT}" rx="2.5"/>'
        f'<text x="{x + 14:.1f}" y="{top + 18:.1f}" class="name">{escape(_cut(node.name, 22))}</text>'
        f'<text x="{x + 14:.1f}" y="{top + 34:.1f}" class="stage">{escape(_cut(node.stage or "-", 27))}</text>'
        f'<text x="{x + 14:.1f}" y="{top + 50:.1f}" class="stage">{escape(node.status + taken)}</text></g></a>'
    )


def _cut(words: str, most: int) -> str:
    return words if len(words) <= most else words[: most - 1] + "…"
