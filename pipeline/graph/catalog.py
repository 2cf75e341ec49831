"""Which stages and devices there are, by the names that YAML gives them; nothing is imported to find out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cached_property

from pipeline.codebase.source import ModuleSource, Sources, declared
from pipeline.codebase.syntax import Parameter, Signature
from pipeline.errors import InputError, nearest
from pipeline.graph.annotations import Annotation, parse_annotation


@dataclass(frozen=True)
class Entry:
    """A stage (a function) or a device (a class) that YAML can name.

    Attributes
    ----------
    name : str
        Name in YAML, ``fit.cosine`` or ``simulated.Camera``.
    module : str
        Module that defines it.
    signature : Signature
        Parameters and manual.
    """

    name: str
    module: str
    signature: Signature
    _names: dict[str, str]

    @cached_property
    def inputs(self) -> dict[str, tuple[Parameter, Annotation]]:
        """Upstream values: the parameters that can be given by position."""
        return self._parsed(keyword_only=False)

    @cached_property
    def settings(self) -> dict[str, tuple[Parameter, Annotation]]:
        """Settings: the keyword-only parameters."""
        return self._parsed(keyword_only=True)

    @cached_property
    def returns(self) -> Annotation:
        """Type of the value."""
        return parse_annotation(self.signature.returns or "None", self._names)

    @property
    def type(self) -> str:
        """Short name of the value's type."""
        return self.returns.name.rpartition(".")[2]

    @property
    def summary(self) -> str:
        """First line of the manual."""
        return self.signature.doc.split("\n", 1)[0]

    def entries(self, parameter: str) -> list[str]:
        """What the manual says that a list holds, such as columns and rows; empty where it does not."""
        line = rf"^ *(?:\w+, )*{parameter}(?:, \w+)* : \[([\w, ]+)\](?:, optional)?$"
        found = re.search(line, self.signature.doc, re.MULTILINE)
        return found[1].split(", ") if found else []

    def _parsed(self, *, keyword_only: bool) -> dict[str, tuple[Parameter, Annotation]]:
        found = {}
        for parameter in self.signature.parameters:
            if parameter.keyword_only == keyword_only:
                try:
                    found[parameter.name] = (parameter, parse_annotation(parameter.annotation, self._names))
                except InputError as error:
                    raise error.at(f"{self.module}.{self.signature.name}, parameter {parameter.name}") from None
        return found


class Catalog:
    """Looks stages and devices up in ``pipeline`` and in packages that declare the same-named entry-point groups."""

    def __init__(self, sources: Sources) -> None:
        self.sources = sources

    @cached_property
    def stages(self) -> dict[str, Entry]:
        """Every stage, by name."""
        found: dict[str, Entry] = {}
        for root in self._roots("pipeline.stages"):
            for package in self.sources.subpackages(root):
                for module in self.sources.modules_in(package):
                    for entry in _entries(module, package.rpartition(".")[2], classes=False):
                        _add(found, entry)
        return found

    @cached_property
    def devices(self) -> dict[str, Entry]:
        """Every device, by name."""
        found: dict[str, Entry] = {}
        for root in self._roots("pipeline.devices"):
            for module in self.sources.modules_in(root):
                for entry in _entries(module, module.name.rpartition(".")[2], classes=True):
                    _add(found, entry)
        return found

    def stage(self, name: str) -> Entry:
        """The stage of that name.

        Raises
        ------
        InputError
            There is none; the nearest name is given.
        """
        return _looked_up(name, self.stages, "stage", "a stage: a function in a module under pipeline/stages")

    def device(self, name: str) -> Entry:
        """The device of that name.

        Raises
        ------
        InputError
            There is none; the nearest name is given.
        """
        offered = {n: entry for n, entry in self.devices.items() if is_device(entry)}
        return _looked_up(name, offered, "device", "a device: a class in a module under pipeline/devices")

    def _roots(self, group: str) -> list[str]:
        return [group, *declared(group)]


def is_device(entry: Entry) -> bool:
    """Whether a class in a module of devices is one that a rig would name, not a value or a helper of it."""
    return not (entry.module.endswith(".protocols") or entry.signature.decorated)


def _entries(module: ModuleSource, prefix: str, *, classes: bool) -> list[Entry]:
    return [
        Entry(f"{prefix}.{signature.name}", module.name, signature, module.names)
        for signature in module.signatures.values()
        if signature.is_class == classes
    ]


def _add(found: dict[str, Entry], entry: Entry) -> None:
    other = found.get(entry.name)
    if other is not None:
        raise InputError(
            f"two modules offer '{entry.name}'", where=f"{other.module}, {entry.module}", expected="one of each name"
        )
    found[entry.name] = entry


def _looked_up(name: str, entries: dict[str, Entry], kind: str, expected: str) -> Entry:
    entry = entries.get(name)
    if entry is None:
        raise InputError(f"there is no {kind} '{name}'", expected=expected, hint=nearest(name, entries))
    if entry.signature.fault:
        raise InputError(f"'{name}' cannot be used as a {kind}: {entry.signature.fault}", where=f"{entry.module}.py")
    return entry
