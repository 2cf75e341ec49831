"""Two runs side by side: which settings, code, libraries and results differ, and by how much."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

from pipeline.review.compare import compare
from pipeline.review.rerun import record_of_node
from pipeline.review.untrusted import read_value
from pipeline.runs import NodeRun, Run
from pipeline.storage.artifact import DamagedArtifact

NOTHING = "(nothing)"


@dataclass(frozen=True)
class NodeDifference:
    """How one node differs between two runs.

    Attributes
    ----------
    name : str
        Name in both graphs.
    settings : dict of str to (object, object)
        Stage, inputs and settings that differ, in the first run and in the second.
    code : tuple of str
        Modules that its stage stands on in both and whose code differs.
    code_first, code_second : tuple of str
        Modules that it stands on in one only, as another stage does.
    value : tuple of str
        How its value differs, field by field; empty where it is identical.
    """

    name: str
    settings: Mapping[str, tuple[Any, Any]] = field(default_factory=dict)
    code: tuple[str, ...] = ()
    value: tuple[str, ...] = ()
    code_first: tuple[str, ...] = ()
    code_second: tuple[str, ...] = ()

    def __bool__(self) -> bool:
        return any((self.settings, self.code, self.value, self.code_first, self.code_second))


@dataclass(frozen=True)
class RunDifference:
    """How two runs differ; ``str`` of it is what the command prints.

    Attributes
    ----------
    first, second : str
        The runs.
    nodes : tuple of NodeDifference
        Nodes of both that differ in anything.
    identical : tuple of str
        Nodes of both whose settings, code and values are the same.
    only_first, only_second : tuple of str
        Nodes that one has and the other has not.
    versions : dict of str to (str, str)
        Libraries whose versions differ.
    metrics : dict of str to (float or None, float or None)
        All figures, side by side.
    """

    first: str
    second: str
    nodes: tuple[NodeDifference, ...]
    identical: tuple[str, ...]
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]
    versions: Mapping[str, tuple[str, str]]
    metrics: Mapping[str, tuple[float | None, float | None]]

    def to_json(self) -> str:
        """Everything as JSON; a figure that is no number is text there."""
        return json.dumps(_finite(asdict(self)), indent=1, allow_nan=False)

    def __str__(self) -> str:
        return "\n".join(_text(self))


def diff(first: Run, second: Run, names: tuple[str, str] | None = None) -> RunDifference:
    """Compare two runs, of one experiment or of different ones, under the names that they are asked for by."""
    a, b = ({n.name: n for n in run.nodes.values() if n.status != "absent"} for run in (first, second))
    both = [name for name in a if name in b]
    differences = [_of_nodes(first, second, a[name], b[name]) for name in both]
    figures = dict.fromkeys([*first.metrics, *second.metrics])
    libraries = sorted({*first.versions, *second.versions})
    return RunDifference(
        first=names[0] if names else str(first.path),
        second=names[1] if names else str(second.path),
        nodes=tuple(d for d in differences if d),
        identical=tuple(d.name for d in differences if not d),
        only_first=tuple(name for name in a if name not in b),
        only_second=tuple(name for name in b if name not in a),
        versions={
            name: (first.versions.get(name, ""), second.versions.get(name, ""))
            for name in libraries
            if first.versions.get(name) != second.versions.get(name)
        },
        metrics={name: (first.metrics.get(name), second.metrics.get(name)) for name in figures},
    )


def _of_nodes(first: Run, second: Run, a: NodeRun, b: NodeRun) -> NodeDifference:
    pairs = [("stage", a.stage, b.stage), ("inputs", dict(a.inputs), dict(b.inputs))]
    settings = {name: (before, after) for name, before, after in pairs if before != after}
    settings |= dict(_changed_settings(a.settings, b.settings))
    changed, only_first, only_second = _changed_code(first, second, a, b)
    return NodeDifference(a.name, settings, changed, _changed_value(first, second, a, b), only_first, only_second)


def _changed_settings(a: Any, b: Any, path: str = "") -> Iterator[tuple[str, tuple[Any, Any]]]:
    if isinstance(a, Mapping) and isinstance(b, Mapping) and a.get("device") == b.get("device"):
        for name in dict.fromkeys([*a, *b]):
            inner = f"{path}.{name}".lstrip(".")
            yield from _changed_settings(a.get(name, NOTHING), b.get(name, NOTHING), inner)
    elif a != b or type(a) is not type(b):
        yield path, (a, b)


def _changed_code(
    first: Run, second: Run, a: NodeRun, b: NodeRun
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Modules of both that differ, and those of one only."""
    before, after = (
        run.store.provenance(code) if (code := record_of_node(run, node).code) else {}
        for run, node in ((first, a), (second, b))
    )
    if not before or not after:
        return (), (), ()
    return (
        tuple(name for name in sorted(before) if name in after and before[name][0] != after[name][0]),
        tuple(name for name in sorted(before) if name not in after),
        tuple(name for name in sorted(after) if name not in before),
    )


def _changed_value(first: Run, second: Run, a: NodeRun, b: NodeRun) -> tuple[str, ...]:
    if a.artifact == b.artifact:
        return () if a.artifact or a.status == b.status else (f"it {a.status} -> it {b.status}",)
    if not a.artifact or not b.artifact:
        return (f"{'has' if a.artifact else 'no'} value -> {'has' if b.artifact else 'no'} value",)
    try:
        before = read_value(first.store.object_folder(a.artifact), a.artifact)
        after = read_value(second.store.object_folder(b.artifact), b.artifact)
    except DamagedArtifact as error:
        return (f"differs; by how much cannot be said: {error}",)
    return tuple(map(str, compare(before, after)))


def _text(found: RunDifference) -> Iterator[str]:
    yield f"first:  {found.first}"
    yield f"second: {found.second}"
    for node in found.nodes:
        yield f"{node.name}:"
        for name, (a, b) in node.settings.items():
            yield f"  setting  {name}: {_short(a)} -> {_short(b)}"
        yield from (f"  code     {_file(name)} differs" for name in node.code)
        for title, names in (("first", node.code_first), ("second", node.code_second)):
            if names:
                yield f"  code     only the {title} stands on {', '.join(map(_file, names))}"
        yield from (f"  value    {difference}" for difference in node.value or ("identical",))
    if found.identical:
        yield f"identical: {', '.join(found.identical)}"
    for title, names in (("first", found.only_first), ("second", found.only_second)):
        if names:
            yield f"only the {title} has: {', '.join(names)}"
    if found.versions:
        yield "versions: " + ", ".join(f"{n} {a or 'none'} -> {b or 'none'}" for n, (a, b) in found.versions.items())
    if found.metrics:
        width = max(len(name) for name in found.metrics)
        yield f"{'':<{width}}  {'first':>12}  {'second':>12}  {'difference':>12}"
        for name, (x, y) in found.metrics.items():
            change = "" if x is None or y is None else f"{y - x:>12.6g}" if x != y else f"{'0':>12}"
            yield f"{name:<{width}}  {_figure(x):>12}  {_figure(y):>12}  {change}".rstrip()


def _file(module: str) -> str:
    return f"{module.replace('.', '/')}.py"


def _figure(number: float | None) -> str:
    return "" if number is None else f"{number:.6g}"


def _short(value: Any) -> str:
    text = json.dumps(value, default=str)
    return text if len(text) <= 100 else text[:97] + "..."


def _finite(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
