"""A part of a graph: until a node, from a node on, or some nodes anew."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from pipeline.errors import InputError, nearest
from pipeline.graph.nodes import Graph


def until(graph: Graph, wanted: Any) -> Graph:
    """The nodes that ``until`` names and all that they need; the others are absent.

    Raises
    ------
    InputError
        There is no such node.
    """
    names = _names(graph, wanted, "until")
    if not names:
        return graph
    kept: set[str] = set()
    waiting = list(names)
    while waiting:
        name = waiting.pop()
        if name not in kept:
            kept.add(name)
            waiting += graph.nodes[name].upstream()
    left_out = {name: f"not needed for {', '.join(names)} (until)" for name in graph.nodes if name not in kept}
    nodes = {name: node for name, node in graph.nodes.items() if name in kept}
    return Graph(nodes, {**graph.absent, **left_out}, graph.dropped, graph.bare)


def forced(graph: Graph, start: Any, anew: Any) -> dict[str, str]:
    """Nodes to compute though the store has them, and why: those of ``from`` and all after them, those of ``force``.

    Raises
    ------
    InputError
        There is no such node, or ``force`` names what real devices captured.
    """
    found: dict[str, str] = {}
    first = _names(graph, start, "from")
    for name, node in graph.nodes.items():
        if name in first:
            found[name] = f"asked for: from={name}"
        elif (before := next((u for u in node.upstream() if u in found), None)) is not None:
            found[name] = f"asked for: it follows {before}"
    for name in _names(graph, anew, "force"):
        found[name] = f"asked for: force={name}"
    for name, reason in found.items():
        if graph.nodes[name].is_source and "=" in reason:
            raise InputError(
                f"'{name}' was captured by real devices and cannot be computed again",
                where=reason.removeprefix("asked for: "),
                hint="recapture=true takes it anew",
            )
    return {name: reason for name, reason in found.items() if not graph.nodes[name].is_source}


def _names(graph: Graph, written: Any, word: str) -> tuple[str, ...]:
    if written is None:
        return ()
    names = [written] if isinstance(written, str) else written
    if not isinstance(names, Iterable) or isinstance(names, Mapping):
        raise InputError(f"{word} is {written!r}", where=word, expected="a node's name, or a list of them")
    for name in names:
        if name not in graph.nodes:
            raise InputError(
                f"there is no node '{name}'",
                where=word,
                expected="a node of the graph",
                hint=nearest(name, graph.nodes),
            )
    return tuple(names)
