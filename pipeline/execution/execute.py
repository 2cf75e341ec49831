"""A plan on dask: tasks exchange digests, data stays in the store; what fails blocks only what waits for it."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

from pipeline.errors import InputError, InputErrors
from pipeline.execution.executors import BENCH, Executor, TaskName
from pipeline.execution.gate import Gate
from pipeline.execution.outcome import Outcome
from pipeline.execution.plan import Plan, Task, inputs_of
from pipeline.execution.workbench import Workbench, build_device, companion
from pipeline.graph.annotations import Annotation
from pipeline.graph.checks import PROTOCOLS
from pipeline.graph.nodes import DeviceRecipe, Node


def check_before_running(plan: Plan) -> None:
    """Let stages that may run, and their devices, find what would make them fail, before anything runs.

    A device may have a method ``check()``; a stage ``name`` may have a function ``_check_name`` beside it that takes
    its settings and, by the names of the inputs, what is foreseen of their values: what a function ``_foresee_name``
    beside the stage that gives them makes of that stage's settings.

    Raises
    ------
    InputErrors
        All that was found.
    """
    problems: list[InputError] = []
    for step in plan.to_run.values():
        node = step.task.node
        try:
            devices = {name: build_device(v) for name, v in node.settings.items() if isinstance(v, DeviceRecipe)}
            before = len(problems)
            for name, device in devices.items():
                problems += _lacking(device, node.entry.settings[name][1], f"{node.path}.{name}")
                if hasattr(device, "check"):
                    _collect(device.check, f"{node.path}.{name}", problems)
            check = companion(node, "_check_")
            if check is not None and len(problems) == before:
                inputs = _foreseen_inputs(check, node, plan)
                _collect(partial(check, **{**node.settings, **devices, **inputs}), _place(node, inputs, plan), problems)
        except InputError as error:
            problems.append(error.at(node.path))
    if problems:
        raise InputErrors(problems)


def _foreseen_inputs(check: Callable[..., None], node: Node, plan: Plan) -> dict[str, Mapping[str, Any]]:
    """What is foreseen of each input of one value that a check asks for; nothing of a stage that foresees nothing."""
    wanted = {name for name in inspect.signature(check).parameters if node.inputs.get(name) and name not in node.lists}
    found = {}
    for name in sorted(wanted):
        (upstream,) = node.inputs[name] or ()
        giver = plan.steps[upstream].task.node
        foresee = companion(giver, "_foresee_")
        found[name] = {} if foresee is None else foresee(**giver.settings)
    return found


def _place(node: Node, inputs: Mapping[str, object], plan: Plan) -> str:
    """Where a check looked: at the node, and at the nodes that give the inputs which it asked for."""
    givers = {name: plan.steps[upstream].task.node for name in inputs for upstream in node.inputs[name] or ()}
    given = [f"{name} from {giver.path}" for name, giver in givers.items()]
    return f"{node.path} ({', '.join(given)})" if given else node.path


def _lacking(device: object, annotation: Annotation, place: str) -> list[InputError]:
    """An error if a device is not what the stage asks for."""
    for full_name in annotation.classes():
        if not full_name.startswith(PROTOCOLS):
            continue
        protocol = getattr(importlib.import_module(PROTOCOLS.rstrip(".")), full_name.rpartition(".")[2])
        members = {*vars(protocol), *getattr(protocol, "__annotations__", {})}
        missing = [m for m in sorted(members) if not m.startswith("_") and not _has(device, m)]
        if missing:
            kind = type(device).__name__
            what = f"a {kind} is no {protocol.__name__}: it lacks {', '.join(missing)}"
            return [InputError(what, where=place, expected=str(annotation))]
    return []


def _has(device: object, member: str) -> bool:
    return hasattr(type(device), member) or member in getattr(device, "__dict__", {})


def _collect(check: Callable[[], None], place: str, problems: list[InputError]) -> None:
    try:
        check()
    except InputError as error:
        problems.append(error.at(place))
    except InputErrors as several:
        problems += [error.at(place) for error in several.errors]


def execute(plan: Plan, workbench: Workbench, executor: Executor) -> dict[str, Outcome]:
    """Run what the plan leaves to run; results are in the store when this returns.

    Parameters
    ----------
    plan : Plan
        Steps in order.
    workbench : Workbench
        Store, listener and provenance.
    executor : Executor
        Runs a dask graph.

    Returns
    -------
    dict of str to Outcome
        How each node ended, cached ones included, in the plan's order.
    """
    outcomes: dict[str, Outcome] = {}
    for name, step in plan.steps.items():
        if step.state == "cached":
            outcomes[name] = Outcome(name, "cached", step.record, step.reason)
            workbench.listener.ended(outcomes[name])
    to_run = plan.to_run
    if to_run:
        if any(step.task.node.needs for step in to_run.values()):
            workbench = replace(workbench, gate=Gate.new(executor.memory_gb))
        graph: dict[TaskName, Any] = {}
        for name, step in to_run.items():
            upstream = step.task.node.upstream()
            known = {n: outcomes[n].artifact for n in upstream if n in outcomes}
            waits_for = [_task_name(n) for n in upstream if n in to_run]
            graph[_task_name(name)] = (Workbench.carry_out, BENCH, step.task, step.reason, known, waits_for)
        ended = executor.run(graph, workbench)
        for name, step in to_run.items():
            outcomes[name] = ended.get(name) or _finished(step.task, outcomes, workbench) or _lost(name, plan, ended)
    return {name: outcomes[name] for name in plan.steps}


def _finished(task: Task, outcomes: Mapping[str, Outcome], workbench: Workbench) -> Outcome | None:
    """How a node ended whose worker finished it and died before it could say so."""
    before = [outcomes[upstream] for upstream in task.node.upstream()]
    if any(outcome.record is None for outcome in before):
        return None
    inputs = inputs_of(task.node, {outcome.name: outcome.artifact for outcome in before})
    record = workbench.store.find(task.key(inputs))
    return None if record is None else Outcome(task.node.name, "ran", record, "its worker died after it")


def _lost(name: str, plan: Plan, ended: dict[str, Outcome]) -> Outcome:
    """What became of a node of which nothing was heard because a worker process died."""
    lost = {n for n in plan.to_run if n not in ended}
    causes: dict[str, None] = {}
    waiting = [name]
    while waiting:
        for upstream in plan.steps[waiting.pop()].task.node.upstream():
            if upstream in lost:
                waiting.append(upstream)
            elif upstream in ended and ended[upstream].status in {"failed", "blocked"}:
                causes |= dict.fromkeys(ended[upstream].blocked_by or (upstream,))
    return Outcome(name, "blocked", blocked_by=tuple(causes) or ("a process that died",))


def _task_name(name: str) -> TaskName:
    """A key for dask; a pair, since dask would take any text that equals a key for a reference to it."""
    return ("node", name)
