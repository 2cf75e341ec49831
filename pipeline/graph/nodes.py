"""A checked graph: stages with their inputs, settings and devices, ready to be planned."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pipeline.graph.catalog import Entry


@dataclass(frozen=True)
class DeviceRecipe:
    """A device and its settings, not yet built; whether it says that it is simulated."""

    entry: Entry
    settings: Mapping[str, Any]
    simulated: bool = False

    def walk(self) -> Iterator[DeviceRecipe]:
        """This device and those inside it."""
        yield self
        for value in self.settings.values():
            if isinstance(value, DeviceRecipe):
                yield from value.walk()

    @property
    def physical(self) -> bool:
        """Whether what it captures cannot be computed again."""
        return any(recipe.entry.signature.constants.get("physical") is True for recipe in self.walk())


def plain(value: Any) -> Any:
    """A setting as plain values: devices as mappings with their name under ``device``, paths as text."""
    if isinstance(value, DeviceRecipe):
        return {"device": value.entry.name, **{name: plain(item) for name, item in value.settings.items()}}
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, list):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    return value


@dataclass(frozen=True)
class Needs:
    """What a stage needs of the machine that it runs on.

    Attributes
    ----------
    memory_gb : float
        Memory; stages run side by side only while their needs fit the machine's.
    exclusive : bool
        Whether nothing of the same run may run beside it on that machine, as when its time is to be measured.
    """

    memory_gb: float = 0.0
    exclusive: bool = False

    def __bool__(self) -> bool:
        return self.exclusive or self.memory_gb > 0


@dataclass(frozen=True)
class Node:
    """One stage of the graph with its inputs and settings, all checked.

    Attributes
    ----------
    name : str
        Name in the graph.
    entry : Entry
        The stage.
    inputs : dict of str to tuple of str or None
        Upstream nodes of each parameter; None where the parameter does without.
    lists : frozenset of str
        Parameters that take a list of values.
    settings : dict
        Every setting, defaults included; devices as :class:`DeviceRecipe`.
    written : frozenset of str
        Settings that YAML or the command line wrote.
    path : str
        Path in the YAML.
    needs : Needs
        What it takes of a machine.
    """

    name: str
    entry: Entry
    inputs: Mapping[str, tuple[str, ...] | None]
    lists: frozenset[str]
    settings: Mapping[str, Any]
    written: frozenset[str]
    path: str
    needs: Needs = field(default_factory=Needs)

    def upstream(self) -> tuple[str, ...]:
        """Names of all upstream nodes, each once."""
        return tuple(dict.fromkeys(name for names in self.inputs.values() for name in names or ()))

    def devices(self) -> Iterator[DeviceRecipe]:
        """The outermost devices among the settings."""
        for value in self.settings.values():
            if isinstance(value, DeviceRecipe):
                yield value

    @property
    def is_source(self) -> bool:
        """Whether its value comes from real devices and cannot be computed again."""
        return any(device.physical for device in self.devices())


@dataclass(frozen=True)
class Graph:
    """Checked nodes in an order in which each follows its inputs.

    Attributes
    ----------
    nodes : dict of str to Node
        What can run.
    absent : dict of str to str
        Nodes that this configuration goes without, and why.
    dropped : dict of str to tuple of str
        Settings that YAML wrote for a stage that an override replaced, by node.
    bare : dict of str to str
        Those of the absent nodes that have a simulated device and no sample, and both in words.
    """

    nodes: Mapping[str, Node]
    absent: Mapping[str, str] = field(default_factory=dict)
    dropped: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    bare: Mapping[str, str] = field(default_factory=dict)

    @property
    def remarks(self) -> tuple[str, ...]:
        """What the user should know."""
        lacking = (
            f"{name}: {self.nodes[name].entry.name} has no {', '.join(settings)}; left out"
            for name, settings in self.dropped.items()
            if name in self.nodes
        )
        bare = (f"{name} and what needs it are left out: {why}" for name, why in self.bare.items())
        return (*lacking, *bare)
