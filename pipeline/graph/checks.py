"""From YAML to a checked graph: every name, type, setting and edge is known to be right before anything runs."""

from __future__ import annotations

import graphlib
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from pipeline.errors import InputError, InputErrors, nearest
from pipeline.graph.annotations import Annotation, check_setting, parse_annotation
from pipeline.graph.catalog import Catalog, Entry
from pipeline.graph.config import Configuration
from pipeline.graph.nodes import DeviceRecipe, Graph, Needs, Node

RESERVED = ("stage", "when", "resources")
DEVICE_RESERVED = ("device", "simulated")
PROTOCOLS = "pipeline.devices.protocols."


def build_graph(configuration: Configuration, catalog: Catalog) -> Graph:
    """Check the graph section of a configuration.

    Raises
    ------
    InputErrors
        Everything that is wrong with it, each with its place, what was expected and the nearest right name.
    """
    return _Builder(configuration, catalog).build()


class _Builder:
    def __init__(self, configuration: Configuration, catalog: Catalog) -> None:
        self.configuration = configuration
        self.catalog = catalog
        self.errors: list[InputError] = []
        self.dropped: dict[str, tuple[str, ...]] = {}
        self.absent: dict[str, str] = {}
        self.bare: dict[str, str] = {}
        self.nodes: dict[str, Node] = {}

    def build(self) -> Graph:
        written = self.configuration.content.get("graph")
        if not isinstance(written, dict) or not written:
            raise InputErrors([self._error("the graph is empty", "graph", expected="nodes: {stage: ..., ...}")])
        for name, node in written.items():
            self._collect(lambda name=name, node=node: self._add(str(name), node))
        names = {*self.nodes, *self.absent, *(str(name) for name in written)}
        self._drop_what_lacks_inputs()
        for node in self.nodes.values():
            for parameter, upstream in node.inputs.items():
                for source in upstream or ():
                    self._collect(lambda n=node, p=parameter, s=source: self._check_edge(n, p, s, names))
        order = self._order()
        if not (self.errors or order):
            name, why = next(iter(self.absent.items()))
            self.errors.append(self._error(f"no node is left to run: '{name}' is {why}", "graph"))
        if self.errors:
            raise InputErrors(self.errors)
        return Graph({name: self.nodes[name] for name in order}, self.absent, self.dropped, self.bare)

    def _collect(self, check: Any) -> None:
        try:
            check()
        except InputError as error:
            self.errors.append(error)
        except InputErrors as several:
            self.errors += several.errors

    def _error(self, what: str, path: str, *, expected: str = "", hint: str = "") -> InputError:
        return InputError(what, where=self.configuration.where(path), expected=expected, hint=hint)

    def _add(self, name: str, written: Any) -> None:
        path = f"graph.{name}"
        if not re.fullmatch(r"[A-Za-z]\w*", name):
            raise self._error(f"'{name}' is no name for a node", path, expected="letters, digits and _")
        if written is None:
            self.absent[name] = "set to null"
            return
        if not isinstance(written, dict):
            raise self._error(f"node '{name}' is {written!r}", path, expected="{stage: package.function, ...}")
        when = written.get("when", True)
        if not isinstance(when, bool):
            raise self._error(f"'when' of node '{name}' is {when!r}", f"{path}.when", expected="true or false")
        stage = written.get("stage")
        if "stage" not in written and self.configuration.written_by_override(path):
            others = [other for other in self.configuration.content["graph"] if other != name]
            raise InputError(
                f"there is no node '{name}'",
                where=self.configuration.override_inside(path),
                expected="the name of a node",
                hint=nearest(name, others),
            )
        if not isinstance(stage, str) or stage == "???":
            raise self._error(
                f"node '{name}' names no stage",
                path,
                expected="stage: package.function",
                hint=nearest("stage", written) if "stage" not in written else "",
            )
        try:
            entry = self.catalog.stage(stage)
        except InputError as error:
            raise error.at(self.configuration.where(f"{path}.stage")) from None
        if not when:
            self.absent[name] = f"left out here ({path}.when is false)"
            return
        try:
            self._fill(name, path, entry, self._kept(name, path, entry, written))
        except InputErrors as several:
            if all(self.configuration.written_by_override(f"{path}.{key}") for key in written):
                raise self._new_node(name, path, several) from None
            raise
        if name in self.nodes:
            self.nodes[name] = replace(self.nodes[name], needs=self._needs(f"{path}.resources", written))

    def _new_node(self, name: str, path: str, several: InputErrors) -> InputErrors:
        """What is wrong with a node that only overrides write: its name may be meant for another one's."""
        others = [other for other in self.configuration.content["graph"] if other != name]
        where = self.configuration.override_inside(path)
        hint = f"'{name}' is a new node; {nearest(name, others)}"
        return InputErrors(InputError(e.what, where=where, expected=e.expected, hint=hint) for e in several.errors)

    def _needs(self, path: str, written: Mapping[str, Any]) -> Needs:
        resources = written.get("resources") or {}
        if not isinstance(resources, dict):
            raise self._error(
                f"'resources' is {resources!r}", path, expected="{memory_gb: a number, exclusive: true or false}"
            )
        known = {"memory_gb": parse_annotation("float", {}), "exclusive": parse_annotation("bool", {})}
        found = {}
        for key, value in resources.items():
            if key not in known:
                raise self._error(
                    f"there is no resource '{key}'",
                    f"{path}.{key}",
                    expected="memory_gb or exclusive",
                    hint=nearest(str(key), known),
                )
            try:
                found[key] = check_setting(value, known[key], key)
            except InputError as error:
                raise error.at(self.configuration.where(f"{path}.{key}")) from None
        return Needs(**found)

    def _kept(self, name: str, path: str, entry: Entry, written: Mapping[str, Any]) -> dict[str, Any]:
        """What the node writes, less what was written for the stage that an override replaced."""
        known = {*entry.inputs, *entry.settings}
        swapped = self.configuration.written_by_override(f"{path}.stage")
        kept, dropped = {}, []
        for key, value in written.items():
            if key in RESERVED:
                continue
            if key not in known and swapped and not self.configuration.written_by_override(f"{path}.{key}"):
                dropped.append(key)
                continue
            kept[key] = value
        if dropped:
            self.dropped[name] = tuple(dropped)
        return kept

    def _fill(self, name: str, path: str, entry: Entry, written: Mapping[str, Any]) -> None:
        problems: list[InputError] = []
        written = {str(key): value for key, value in written.items()}
        for key in written:
            if key not in entry.inputs and key not in entry.settings:
                problems.append(
                    self._error(
                        f"{entry.name} has no setting or input '{key}'",
                        f"{path}.{key}",
                        expected="a name from: " + ", ".join([*entry.inputs, *entry.settings]),
                        hint=nearest(key, [*entry.inputs, *entry.settings]),
                    )
                )
        inputs: dict[str, tuple[str, ...] | None] = {}
        settings: dict[str, Any] = {}
        lists = set()
        for key, (parameter, annotation) in entry.inputs.items():
            if annotation.is_list:
                lists.add(key)
            try:
                inputs[key] = self._upstream(f"{path}.{key}", written, parameter.required, annotation)
            except InputError as error:
                problems.append(error)
        for key, (parameter, annotation) in entry.settings.items():
            place = f"{path}.{key}"
            if key not in written and parameter.required:
                problems.append(
                    self._error(f"{entry.name} needs the setting '{key}'", path, expected=f"{key}: {annotation}")
                )
                continue
            try:
                settings[key] = self._setting(written.get(key, parameter.default), annotation, place)
            except InputError as error:
                problems.append(error)
            except InputErrors as several:
                problems += several.errors
        if problems:
            raise InputErrors(problems)
        self.nodes[name] = Node(
            name, entry, inputs, frozenset(lists), settings, frozenset(written) & frozenset(settings), path
        )

    def _upstream(
        self, path: str, written: Mapping[str, Any], required: bool, annotation: Annotation
    ) -> tuple[str, ...] | None:
        key = path.rpartition(".")[2]
        value = written.get(key)
        if value is None:
            if annotation.optional or not required:
                return None
            raise self._error(
                f"the input '{key}' is not given", path, expected=f"{key}: name of a node that gives {annotation}"
            )
        if isinstance(value, str):
            return (value,)
        if isinstance(value, list) and annotation.is_list and all(isinstance(item, str) for item in value):
            return tuple(value)
        raise self._error(f"the input '{key}' is {value!r}", path, expected="the name of a node")

    def _setting(self, value: Any, annotation: Annotation, path: str) -> Any:
        name = path.rpartition(".")[2]
        if isinstance(value, str) and value == "???":
            place = self.configuration.followed(path)
            raise self._error(
                f"'{name}' is not given",
                path,
                expected=f"{place}={str(annotation).upper()}",
                hint=self.configuration.remark(place),
            )
        if any(cls.startswith(PROTOCOLS) for cls in annotation.classes()):
            if value is None and annotation.optional:
                return None
            return self._device(value, annotation, path)
        try:
            return check_setting(value, annotation, name)
        except InputError as error:
            raise error.at(self.configuration.where(path)) from None

    def _device(self, value: Any, annotation: Annotation, path: str) -> DeviceRecipe:
        if not isinstance(value, dict) or "device" not in value:
            raise self._error(
                f"'{path.rpartition('.')[2]}' is {value!r}",
                path,
                expected=f"a {annotation}: {{device: module.Class, ...}}, as in configs/rig",
            )
        try:
            entry = self.catalog.device(str(value["device"]))
        except InputError as error:
            raise error.at(self.configuration.where(f"{path}.device")) from None
        parameters = {**entry.inputs, **entry.settings}
        value = {str(key): item for key, item in value.items()}
        problems = []
        settings = {}
        for key in value:
            if key not in parameters and key not in DEVICE_RESERVED:
                problems.append(
                    self._error(
                        f"{entry.name} has no setting '{key}'",
                        f"{path}.{key}",
                        expected="a name from: " + ", ".join(parameters),
                        hint=nearest(key, parameters),
                    )
                )
        for key, (parameter, kind) in parameters.items():
            if key not in value and parameter.required:
                problems.append(self._error(f"{entry.name} needs the setting '{key}'", path, expected=f"{key}: {kind}"))
                continue
            try:
                settings[key] = self._setting(value.get(key, parameter.default), kind, f"{path}.{key}")
            except InputError as error:
                problems.append(error)
            except InputErrors as several:
                problems += several.errors
        if problems:
            raise InputErrors(problems)
        return DeviceRecipe(entry, settings, simulated=value.get("simulated") is True)

    def _simulated(self, node: Node) -> str | None:
        """Where the configuration writes a device of the node that is simulated."""
        devices = (name for name, one in node.settings.items() if isinstance(one, DeviceRecipe) and one.simulated)
        return next((self.configuration.followed(f"{node.path}.{name}") for name in devices), None)

    def _drop_what_lacks_inputs(self) -> None:
        """A node whose input is absent does without it if it can, and is absent too if it cannot.

        A real device captures what lies before it, while a simulated one needs what would lie there.
        """
        changed = True
        while changed:
            changed = False
            for node in list(self.nodes.values()):
                inputs = dict(node.inputs)
                for parameter, upstream in node.inputs.items():
                    missing = [name for name in upstream or () if name in self.absent]
                    if not missing:
                        continue
                    changed = True
                    left = tuple(name for name in upstream or () if name not in self.absent)
                    optional = node.entry.inputs[parameter][1].optional or not node.entry.inputs[parameter][0].required
                    simulated = self._simulated(node)
                    if left and parameter in node.lists:
                        inputs[parameter] = left
                    elif optional and simulated is None:
                        inputs[parameter] = None
                    else:
                        self.absent[node.name] = f"needs '{missing[0]}', which is absent"
                        if optional and simulated is not None:
                            self.bare[node.name] = f"{simulated} is simulated, and '{missing[0]}' absent"
                        del self.nodes[node.name]
                        break
                else:
                    self.nodes[node.name] = replace(node, inputs=inputs)

    def _check_edge(self, node: Node, parameter: str, source: str, names: set[str]) -> None:
        path = f"{node.path}.{parameter}"
        if source not in names:
            raise self._error(
                f"there is no node '{source}'", path, expected="the name of a node", hint=nearest(source, names)
            )
        upstream = self.nodes.get(source)
        if upstream is None:
            return
        wanted = node.entry.inputs[parameter][1]
        if upstream.entry.returns.name not in wanted.classes():
            fitting = [
                n.name for n in self.nodes.values() if n.entry.returns.name in wanted.classes() and n is not node
            ]
            raise self._error(
                f"'{source}' gives {upstream.entry.type}, and {node.entry.name} takes another type as '{parameter}'",
                path,
                expected=str(wanted),
                hint=f"{', '.join(fitting)} would fit" if fitting else "",
            )

    def _order(self) -> list[str]:
        edges = {n.name: [s for s in n.upstream() if s in self.nodes] for n in self.nodes.values()}
        try:
            return list(graphlib.TopologicalSorter(edges).static_order())
        except graphlib.CycleError as error:
            cycle = list(reversed(error.args[1]))
            self.errors.append(
                self._error(
                    "the graph goes in a circle: " + " -> ".join(cycle),
                    f"graph.{cycle[0]}",
                    expected="each node after its inputs",
                )
            )
            return []
