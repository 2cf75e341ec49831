"""Many graphs as one, in which equal nodes stand once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.execution.outcome import Outcome
from pipeline.graph.nodes import Graph, Node, plain
from pipeline.storage.keys import digest


@dataclass(frozen=True)
class Merged:
    """A merged graph, and where each graph's nodes are in it.

    Attributes
    ----------
    graph : Graph
        Every different node once.
    names : tuple of dict of str to str
        For each graph, the merged name of each of its nodes.
    """

    graph: Graph
    names: tuple[Mapping[str, str], ...]

    def outcomes_of(self, index: int, outcomes: Mapping[str, Outcome]) -> dict[str, Outcome]:
        """How the nodes of one graph ended, under their own names, given how the merged ones did."""
        own = {merged: name for name, merged in self.names[index].items()}
        return {
            name: replace(
                outcomes[merged],
                name=name,
                blocked_by=tuple(own.get(cause, cause) for cause in outcomes[merged].blocked_by),
            )
            for name, merged in self.names[index].items()
        }


def merge(graphs: Sequence[Graph]) -> Merged:
    """Merge graphs: nodes of one stage, with equal settings and equal nodes upstream, become one.

    A node keeps its name if no different one has it, and gets a number behind it otherwise: ``photos``, ``photos~2``.
    """
    nodes: dict[str, Node] = {}
    by_recipe: dict[str, str] = {}
    names = []
    for graph in graphs:
        found: dict[str, str] = {}
        for name, node in graph.nodes.items():
            inputs = {p: None if up is None else tuple(found[u] for u in up) for p, up in node.inputs.items()}
            recipe = _recipe(node, inputs)
            if recipe not in by_recipe:
                by_recipe[recipe] = _free_name(name, nodes)
                nodes[by_recipe[recipe]] = replace(node, name=by_recipe[recipe], inputs=inputs)
            found[name] = by_recipe[recipe]
        names.append(found)
    return Merged(Graph(nodes), tuple(names))


def _recipe(node: Node, inputs: Mapping[str, tuple[str, ...] | None]) -> str:
    settings = {name: plain(value) for name, value in node.settings.items()}
    needs = {"memory_gb": node.needs.memory_gb, "exclusive": node.needs.exclusive}
    return digest({"stage": node.entry.name, "settings": settings, "inputs": inputs, "needs": needs})


def _free_name(name: str, taken: Mapping[str, Node]) -> str:
    number = 2
    free = name
    while free in taken:
        free = f"{name}~{number}"
        number += 1
    return free
