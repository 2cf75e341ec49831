"""Many graphs as one, in which equal nodes stand once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pipeline.execution.outcome import Listener, Outcome
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

    def labels(self, points: Sequence[Sequence[str]]) -> dict[str, str]:
        """What to call each merged node, given what tells the points apart: what all points share goes by its own name.

        ``fit~2``, which those points have whose estimator is jones, is called ``fit at estimator=jones``.
        """
        everywhere = set(points[0]).intersection(*points)
        users: dict[str, list[Sequence[str]]] = {}
        own: dict[str, str] = {}
        for words, names in zip(points, self.names, strict=True):
            for name, merged in names.items():
                users.setdefault(merged, []).append(words)
                own.setdefault(merged, name)
        labels: dict[str, str] = {}
        for merged, lists in users.items():
            shared = set(lists[0]).intersection(*lists) - everywhere
            words = " ".join(word.lstrip("+") for word in lists[0] if word in shared)
            label = f"{own[merged]} at {words}" if words else own[merged]
            ambiguous = label in labels.values() or (not words and len(lists) < len(points))
            labels[merged] = f"{merged} of {len(lists)} points" if ambiguous else label
        return labels


class Labelled:
    """A listener that hears of nodes by other names."""

    def __init__(self, listener: Listener, labels: Mapping[str, str]) -> None:
        self._listener = listener
        self._labels = labels

    def started(self, name: str) -> None:
        """Note that a stage has begun."""
        self._listener.started(self._named(name))

    def advanced(self, name: str, done: int, total: int) -> None:
        """Note that a stage has come further."""
        self._listener.advanced(self._named(name), done, total)

    def ended(self, outcome: Outcome) -> None:
        """Note that a node is done with."""
        reason = re.sub(r"\w+~\d+", lambda match: self._named(match[0]), outcome.reason)
        blocked_by = tuple(map(self._named, outcome.blocked_by))
        self._listener.ended(replace(outcome, name=self._named(outcome.name), reason=reason, blocked_by=blocked_by))

    def _named(self, name: str) -> str:
        return self._labels.get(name, name)


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
