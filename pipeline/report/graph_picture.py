"""The graph as a picture: layers from left to right, one box a node, drawn as SVG."""

from __future__ import annotations

from collections.abc import Mapping
from html import escape

from pipeline.runs import NodeRun

BOX_WIDTH, BOX_HEIGHT, GAP_X, GAP_Y, MARGIN = 168, 46, 44, 18, 10


def graph_svg(nodes: Mapping[str, NodeRun]) -> str:
    """Draw the nodes of a run, each a link to its section."""
    columns = _columns(nodes)
    tallest = max(len(column) for column in columns)
    height = tallest * (BOX_HEIGHT + GAP_Y) - GAP_Y + 2 * MARGIN
    width = len(columns) * (BOX_WIDTH + GAP_X) - GAP_X + 2 * MARGIN
    place = {}
    for x, column in enumerate(columns):
        free = height - 2 * MARGIN - (len(column) * (BOX_HEIGHT + GAP_Y) - GAP_Y)
        for y, name in enumerate(column):
            place[name] = (MARGIN + x * (BOX_WIDTH + GAP_X), MARGIN + free / 2 + y * (BOX_HEIGHT + GAP_Y))
    edges = [
        _edge(place[source], place[node.name], f"{source} to {node.name} as {parameter}")
        for node in nodes.values()
        for parameter, sources in node.inputs.items()
        for source in sources
        if source in place
    ]
    boxes = [_box(nodes[name], *position) for name, position in place.items()]
    return (
        f'<svg class="graph" viewBox="0 0 {width} {height:.0f}" role="img" aria-label="graph of the experiment" '
        f'style="max-width:{width}px">{"".join(edges)}{"".join(boxes)}</svg>'
    )


def _columns(nodes: Mapping[str, NodeRun]) -> list[list[str]]:
    """Nodes by their longest way from a source, each column ordered by where its inputs stand."""
    depth: dict[str, int] = {}
    for name, node in nodes.items():
        above = [depth[s] for sources in node.inputs.values() for s in sources if s in depth]
        depth[name] = max(above, default=-1) + 1
    columns: list[list[str]] = [[] for _ in range(max(depth.values(), default=0) + 1)]
    for name in nodes:
        columns[depth[name]].append(name)
    rank: dict[str, float] = {}
    for column in columns:
        for name in column:
            above_ranks = [rank[s] for sources in nodes[name].inputs.values() for s in sources if s in rank]
            rank[name] = sum(above_ranks) / len(above_ranks) if above_ranks else len(rank)
        column.sort(key=lambda name: rank[name])
        for index, name in enumerate(column):
            rank[name] = index / max(len(column), 1)
    return columns


def _edge(start: tuple[float, float], end: tuple[float, float], title: str) -> str:
    x0, y0 = start[0] + BOX_WIDTH, start[1] + BOX_HEIGHT / 2
    x1, y1 = end[0], end[1] + BOX_HEIGHT / 2
    bend = max((x1 - x0) / 2, 16)
    path = f"M{x0:.1f},{y0:.1f} C{x0 + bend:.1f},{y0:.1f} {x1 - bend:.1f},{y1:.1f} {x1:.1f},{y1:.1f}"
    return f'<path class="edge" d="{path}"><title>{escape(title)}</title></path>'


def _box(node: NodeRun, x: float, y: float) -> str:
    seconds = f"{node.seconds:.2f} s" if node.seconds is not None else node.status
    under = escape(node.stage or node.reason)[:28]
    return (
        f'<a href="#node-{escape(node.name)}"><g class="box {node.status}">'
        f'<rect x="{x:.1f}" y="{y:.1f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6"/>'
        f'<text x="{x + 10:.1f}" y="{y + 19:.1f}" class="name">{escape(node.name)}</text>'
        f'<text x="{x + BOX_WIDTH - 10:.1f}" y="{y + 19:.1f}" class="time">{escape(seconds)}</text>'
        f'<text x="{x + 10:.1f}" y="{y + 36:.1f}" class="stage">{under}</text></g></a>'
    )
