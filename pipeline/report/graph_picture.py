"""The graph as a picture: one box a node, in layers, edges led around what lies between.

Layers go from left to right while they have room on a page, and from top to bottom where they are many.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from itertools import pairwise

from markupsafe import Markup

from pipeline.report.naming import duration
from pipeline.report.view import NodeView

BOX_WIDTH, BOX_HEIGHT, BEND = 172, 60, 14
GAP_ALONG, GAP_ACROSS, MARGIN = 46, 18, 6
MOST_ACROSS_A_PAGE = 6
"""Layers side by side on a page whose boxes can still be read."""
SWEEPS = 6

Slot = tuple[str, int]
"""A node's name, or a bend of an edge that passes: the edge's name and its layer."""


@dataclass(frozen=True)
class Way:
    """Where layers go; places are given along it, where a box begins, and across it, where its middle is."""

    down: bool

    @property
    def length(self) -> int:
        """Of a box along the way."""
        return BOX_HEIGHT if self.down else BOX_WIDTH

    def breadth(self, slot: Slot) -> float:
        """What a slot takes across the way."""
        if slot[1] >= 0:
            return BEND
        return BOX_WIDTH if self.down else BOX_HEIGHT

    def xy(self, along: float, across: float) -> tuple[float, float]:
        """A point of the picture."""
        return (across, along) if self.down else (along, across)


def graph_svg(nodes: Mapping[str, NodeView]) -> Markup:
    """Draw the nodes of a run, each a link to its section."""
    layers, edges = _layered(nodes)
    way = Way(down=len(layers) > MOST_ACROSS_A_PAGE)
    place = _placed(layers, edges, way)
    across = max((at + way.breadth(slot) / 2 for slot, (_, at) in place.items()), default=0.0) + MARGIN
    along = len(layers) * (way.length + GAP_ALONG) - GAP_ALONG + 2 * MARGIN
    width, height = way.xy(along, across)
    drawn = [_edge(edge, place, f"{edge[0][0]} to {edge[-1][0]}: {said}", way) for edge, said in edges]
    drawn += [_box(nodes[slot[0]], at, way) for slot, at in place.items() if slot[1] < 0]
    least = 0.75 * width if way.down else 118 * len(layers)
    return Markup(
        f'<svg class="graph" viewBox="0 0 {width:.0f} {height:.0f}" role="img" aria-label="graph of the experiment" '
        f'style="min-width:{min(width, least):.0f}px;max-width:{width:.0f}px">{"".join(drawn)}</svg>'
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


def _placed(
    layers: list[list[Slot]], edges: Sequence[tuple[list[Slot], str]], way: Way
) -> dict[Slot, tuple[float, float]]:
    """Where every slot begins along the way, and its middle across, which is pulled towards those of neighbours."""
    before: dict[Slot, list[Slot]] = {slot: [] for layer in layers for slot in layer}
    after: dict[Slot, list[Slot]] = {slot: [] for layer in layers for slot in layer}
    for edge, _ in edges:
        for left, right in pairwise(edge):
            before[right].append(left)
            after[left].append(right)
    middle: dict[Slot, float] = {}
    for layer in layers:
        middle |= _stacked(layer, {slot: float(i) for i, slot in enumerate(layer)}, way)
    for sweep in range(SWEEPS):
        forward = sweep % 2 == 0
        for layer in layers if forward else reversed(layers):
            near = before if forward else after
            wish = {slot: _mean([middle[n] for n in near[slot]], middle[slot]) for slot in layer}
            layer.sort(key=lambda slot: wish[slot])
            middle |= _stacked(layer, wish, way)
    first = min((middle[slot] - way.breadth(slot) / 2 for slot in middle), default=0.0)
    return {
        slot: (MARGIN + index * (way.length + GAP_ALONG), middle[slot] - first + MARGIN)
        for index, layer in enumerate(layers)
        for slot in layer
    }


def _stacked(layer: Sequence[Slot], wish: Mapping[Slot, float], way: Way) -> dict[Slot, float]:
    """Middles across the way in the given order, apart as they must be, on average where they wish to be."""
    middle: dict[Slot, float] = {}
    reached = -float("inf")
    for slot in layer:
        middle[slot] = max(wish[slot], reached + way.breadth(slot) / 2)
        reached = middle[slot] + way.breadth(slot) / 2 + GAP_ACROSS
    shift = _mean([wish[slot] - middle[slot] for slot in layer], 0.0)
    return {slot: at + shift for slot, at in middle.items()}


def _mean(values: Sequence[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _edge(edge: Sequence[Slot], place: Mapping[Slot, tuple[float, float]], title: str, way: Way) -> str:
    def point(along: float, across: float) -> str:
        x, y = way.xy(along, across)
        return f"{x:.1f},{y:.1f}"

    begin, across = place[edge[0]]
    last = (begin + way.length, across)
    steps = [f"M{point(*last)}"]
    for slot in edge[1:]:
        begin, across = place[slot]
        half = (last[0] + begin) / 2
        steps.append(f"C{point(half, last[1])} {point(half, across)} {point(begin, across)}")
        last = (begin, across)
        if slot[1] >= 0:
            last = (begin + way.length, across)
            steps.append(f"L{point(*last)}")
    return f'<path class="edge" d="{"".join(steps)}"><title>{escape(title)}</title></path>'


def _box(node: NodeView, place: tuple[float, float], way: Way) -> str:
    x, top = way.xy(place[0], place[1] - way.breadth((node.name, -1)) / 2)
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
