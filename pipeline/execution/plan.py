"""What would run, and why: recipe keys, what the store already holds, and the reason in words for everything else."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

from pipeline.codebase.source import Code, Sources
from pipeline.errors import InputError, InputErrors
from pipeline.graph.nodes import DeviceRecipe, Graph, Node
from pipeline.storage.files import FileDigests
from pipeline.storage.keys import Digest, digest
from pipeline.storage.record import Record
from pipeline.storage.store import Store

Inputs = Mapping[str, str | tuple[str, ...] | None]


@dataclass(frozen=True)
class Task:
    """One node made ready to run anywhere: nothing is left to look up but the digests of its inputs.

    Attributes
    ----------
    node : Node
        Stage, inputs and settings.
    code : Code
        Every module the stage stands on.
    settings : dict
        Settings as they enter the key: files by content, devices by name and settings.
    session : int
        For captures of real devices: which capture this is.
    recapture : bool
        For captures of real devices: whether this is to be a new one.
    forced : bool
        Whether to compute it though the store has it.
    watched : dict of str to (str, str)
        Files and folders that settings name: digest of their content, and the stamp they had when it was taken.
    """

    node: Node
    code: Code
    settings: Mapping[str, Any]
    session: int = 0
    recapture: bool = False
    forced: bool = False
    watched: Mapping[str, tuple[str, str]] = field(default_factory=dict)

    def key(self, inputs: Inputs) -> str:
        """Digest of the recipe, given the digests of the inputs' values."""
        recipe = {
            "stage": self.node.entry.name,
            "settings": self.settings,
            "inputs": {name: _by_content(value) for name, value in inputs.items()},
        }
        if self.node.is_source:
            return digest({**recipe, "session": self.session})
        return digest({**recipe, "code": self.code.digest})


@dataclass(frozen=True)
class Step:
    """What the plan says of one node.

    Attributes
    ----------
    task : Task
        What would run.
    state : {"cached", "run", "depends"}
        In the store; to be run; or to be decided when its inputs are there.
    reason : str
        Why, in words.
    record : Record or None
        What the store holds.
    """

    task: Task
    state: Literal["cached", "run", "depends"]
    reason: str
    record: Record | None = None


@dataclass(frozen=True)
class Plan:
    """Steps in an order in which each follows its inputs."""

    steps: Mapping[str, Step]

    @cached_property
    def to_run(self) -> dict[str, Step]:
        """Steps that are not known to be in the store."""
        return {name: step for name, step in self.steps.items() if step.state != "cached"}


def make_plan(
    graph: Graph,
    sources: Sources,
    store: Store,
    files: FileDigests,
    *,
    last: Mapping[str, str] | None = None,
    recapture: bool = False,
    forced: Mapping[str, str] | None = None,
    taken: Mapping[str, Record] | None = None,
) -> Plan:
    """Find what is in the store and what has to run.

    Parameters
    ----------
    graph : Graph
        Checked nodes.
    sources, store, files
        Where code, results and digests of files are looked up.
    last : dict of str to str, optional
        Recipe key of each node in the last run of this experiment, to compare with.
    recapture : bool
        Whether to take the photographs of real devices anew.
    forced : dict of str to str, optional
        Nodes to compute though the store has them, and why.
    taken : dict of str to Record, optional
        What stands for nodes that cannot be computed here: real devices captured them, or their files are elsewhere.

    Raises
    ------
    InputErrors
        Files or folders that settings name are missing or cannot be read, or a value that was taken over is damaged.
    """
    last, taken = last or {}, taken or {}
    tasks, problems = {}, []
    for node in graph.nodes.values():
        try:
            if node.name in taken:
                if not store.sound(taken[node.name].artifact):
                    raise InputError(f"the value of '{node.name}', which cannot be computed here, is lost or damaged")
                tasks[node.name] = Task(node, _code(node, sources), taken[node.name].settings)
                continue
            task = _task(node, sources, store, files, recapture=recapture)
            tasks[node.name] = replace(task, forced=True) if forced and node.name in forced else task
        except InputError as error:
            problems.append(error)
    if problems:
        raise InputErrors(problems)
    steps: dict[str, Step] = {}
    for name, task in tasks.items():
        if name in taken:
            steps[name] = Step(task, "cached", "taken over: it cannot be computed here", taken[name])
        elif task.forced and forced:
            steps[name] = Step(task, "run", forced[name])
        else:
            steps[name] = _step(task, steps, store, last.get(name))
    _recompute_damaged(steps, store)
    return Plan(steps)


def inputs_of(node: Node, artifacts: Mapping[str, str]) -> Inputs:
    """Digests of a node's inputs by parameter."""
    return {
        parameter: None
        if upstream is None
        else tuple(artifacts[name] for name in upstream)
        if parameter in node.lists
        else artifacts[upstream[0]]
        for parameter, upstream in node.inputs.items()
    }


def _code(node: Node, sources: Sources) -> Code:
    modules = {node.entry.module}
    for device in node.devices():
        modules |= {recipe.entry.module for recipe in device.walk()}
    return sources.code(frozenset(modules))


def _task(node: Node, sources: Sources, store: Store, files: FileDigests, *, recapture: bool) -> Task:
    code = _code(node, sources)
    settings = {}
    watched: dict[str, tuple[str, str]] = {}
    for name, value in node.settings.items():
        try:
            settings[name] = _canonical(value, files, watched)
        except InputError as error:
            raise error.at(f"{node.path}.{name}") from None
    return Task(node, code, settings, recapture=recapture and node.is_source, watched=watched)


def in_session(task: Task, inputs: Inputs, store: Store) -> Task:
    """A capture of real devices as the latest that the store holds with these settings and inputs, or as a new one."""
    if not task.node.is_source:
        return task
    count = 0
    while store.record(replace(task, session=count).key(inputs)) is not None:
        count += 1
    return replace(task, session=count if task.recapture else max(0, count - 1))


def _canonical(value: Any, files: FileDigests, watched: dict[str, tuple[str, str]]) -> Any:
    """A setting as it enters the key."""
    if isinstance(value, Path):
        stamp = files.stamp(value) if value.exists() else ""
        watched[str(value)] = (files.of(value), stamp)
        return {"content": watched[str(value)][0]}
    if isinstance(value, DeviceRecipe):
        inner = {name: _canonical(item, files, watched) for name, item in value.settings.items()}
        return {"device": value.entry.name, **inner}
    if isinstance(value, list):
        return [_canonical(item, files, watched) for item in value]
    if isinstance(value, Mapping):
        return {name: _canonical(item, files, watched) for name, item in value.items()}
    return value


def _by_content(value: str | tuple[str, ...] | None) -> Any:
    if isinstance(value, tuple):
        return [Digest(item) for item in value]
    return None if value is None else Digest(value)


def _step(task: Task, steps: Mapping[str, Step], store: Store, last_key: str | None) -> Step:
    node = task.node
    waiting = [name for name in node.upstream() if steps[name].state != "cached"]
    if waiting:
        return Step(task, "depends", f"if {' or '.join(waiting)} changes" if last_key else "never run")
    artifacts = {name: _artifact(steps[name]) for name in node.upstream()}
    inputs = inputs_of(node, artifacts)
    task = in_session(task, inputs, store)
    key = task.key(inputs)
    record = store.find(key)
    previous = store.record(last_key) if last_key else None
    if record is not None:
        return Step(task, "cached", _kept_reason(task, record, store), record)
    if store.record(key) is not None:
        if node.is_source:
            raise _lost_capture(node)
        return Step(task, "run", "its result is no longer in the store")
    return Step(task, "run", _changed_reason(task, inputs, previous, store))


def _artifact(step: Step) -> str:
    assert step.record is not None
    return step.record.artifact


def _kept_reason(task: Task, record: Record, store: Store) -> str:
    if record.code == task.code.listing:
        return "in the store"
    before = store.provenance(record.code)
    reworded = [
        name
        for name, (code, text) in task.code.modules.items()
        if name in before and before[name][0] == code and before[name][1] != text
    ]
    if reworded:
        return f"in the store; comments, docstrings or tolerances changed in {_listed(reworded)}, the code did not"
    if task.node.is_source and any(before.get(n, ("", ""))[0] != pair[0] for n, pair in task.code.modules.items()):
        return "in the store; the code changed since, but a capture is never taken again unless recapture=true"
    return "in the store"


def _changed_reason(task: Task, inputs: Inputs, previous: Record | None, store: Store) -> str:
    if previous is None:
        return "never run"
    before = store.provenance(previous.code)
    reasons = []
    if previous.stage != task.node.entry.name:
        reasons.append(f"stage changed: {previous.stage} -> {task.node.entry.name}")
    else:
        reasons += _changed_settings(previous.settings, task.settings)
    changed = [n for n, pair in task.code.modules.items() if n in before and before[n][0] != pair[0]]
    if changed:
        reasons.append(f"code changed: {_listed(changed)}")
    if previous.stage == task.node.entry.name:
        imports = sorted(set(task.code.modules) ^ set(before))
        if imports and not reasons:
            reasons.append(f"imports changed: {_listed(imports)}")
    for name, value in inputs.items():
        old = previous.inputs.get(name)
        if (list(old) if isinstance(old, list | tuple) else old) != (
            list(value) if isinstance(value, tuple) else value
        ):
            reasons.append(f"input '{name}' changed")
    return "; ".join(reasons) or "a new capture was asked for"


def _changed_settings(before: Mapping[str, Any], after: Mapping[str, Any], path: str = "") -> list[str]:
    found = []
    for name in sorted({*before, *after}):
        old, new = before.get(name), after.get(name)
        if isinstance(old, Mapping) and isinstance(new, Mapping):
            if old.get("device") != new.get("device"):
                found.append(f"{path}{name} changed: {old.get('device')} -> {new.get('device')}")
            elif "content" in old and "content" in new and old != new:
                found.append(f"files changed: {path}{name}")
            else:
                found += _changed_settings(old, new, f"{path}{name}.")
        elif (list(old) if isinstance(old, tuple) else old) != (list(new) if isinstance(new, tuple) else new):
            found.append(f"{path}{name} changed: {old} -> {new}")
    return found


def _listed(modules: list[str]) -> str:
    return ", ".join(name.replace(".", "/") + ".py" for name in modules)


def _lost_capture(node: Node) -> InputError:
    return InputError(
        f"what real devices captured for '{node.name}' is damaged or gone from the store",
        where=node.path,
        expected="the value as it was captured, from a copy of the store or a bundle",
        hint="recapture=true takes it anew",
    )


def recheck(plan: Plan, store: Store) -> Plan:
    """The plan after every value that it found in the store was read and checked, not only those that stages need."""
    steps = dict(plan.steps)
    _recompute_damaged(steps, store, everything=True)
    return Plan(steps)


def _recompute_damaged(steps: dict[str, Step], store: Store, *, everything: bool = False) -> None:
    """Check the stored values that this run will read; what is damaged is run again."""
    while True:
        read = {
            name
            for step in steps.values()
            if everything or step.state != "cached"
            for name in (*step.task.node.upstream(), *((step.task.node.name,) if everything else ()))
            if steps[name].state == "cached"
        }
        damaged = [name for name in sorted(read) if not store.sound(_artifact(steps[name]))]
        if not damaged:
            return
        for name in damaged:
            if steps[name].task.node.is_source:
                raise _lost_capture(steps[name].task.node)
            steps[name] = Step(steps[name].task, "run", "its stored result is damaged and was set aside")
        for name, step in list(steps.items()):
            waiting = [n for n in step.task.node.upstream() if steps[n].state != "cached"]
            if step.state == "cached" and waiting:
                steps[name] = Step(step.task, "depends", f"if {' or '.join(waiting)} changes")
