"""A plan on dask: tasks exchange digests, data stays in the store; what fails blocks only what waits for it."""

from __future__ import annotations

import importlib
import logging
import os
import platform
import threading
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from contextlib import ExitStack
from contextvars import ContextVar
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from typing import Any, Literal, Protocol

from pipeline.errors import InputError, InputErrors, PipelineError
from pipeline.graph import DeviceRecipe, Node
from pipeline.parallel import cores, cpu_meter, thread_budget
from pipeline.plan import Inputs, Plan, Task, inputs_of
from pipeline.progress import listening
from pipeline.store import Record, Store
from pipeline.usage import PeakMemory

Status = Literal["ran", "cached", "failed", "blocked"]


@dataclass(frozen=True)
class Outcome:
    """How one node ended.

    Attributes
    ----------
    name : str
        The node.
    status : {"ran", "cached", "failed", "blocked"}
        What became of it.
    record : Record or None
        Where its value is and what it took.
    reason : str
        Why it ran, or why it did not have to.
    error : str
        Traceback of a failed stage.
    blocked_by : tuple of str
        Failed nodes that it waited for.
    """

    name: str
    status: Status
    record: Record | None = None
    reason: str = ""
    error: str = ""
    blocked_by: tuple[str, ...] = ()


class Listener(Protocol):
    """Hears how a run goes on; called from the threads of the stages."""

    def started(self, name: str) -> None:
        """Note that a stage has begun."""

    def advanced(self, name: str, done: int, total: int) -> None:
        """Note that a stage has come further."""

    def ended(self, outcome: Outcome) -> None:
        """Note that a node is done with, one way or another."""


TaskName = tuple[str, str]
Scheduler = Callable[[dict[TaskName, Any], list[TaskName]], Iterable[Outcome]]


def scheduler(settings: Mapping[str, Any]) -> Scheduler:
    """Choose the dask scheduler that an executor's settings ask for.

    Raises
    ------
    InputError
        There is no such kind of executor, or its number of workers is none.
    """
    kind = settings.get("kind", "threads")
    workers = settings.get("workers") or cores()
    if not isinstance(workers, int) or workers < 1:
        raise InputError(f"executor.workers is {workers!r}", expected="a whole number from 1, or null")
    if kind == "serial":
        from dask.local import get_sync

        return get_sync
    if kind == "threads":
        from dask.threaded import get

        return lambda graph, names: get(graph, names, num_workers=workers)
    raise InputError(f"there is no executor of kind '{kind}'", where="executor.kind", expected="threads or serial")


def check_before_running(plan: Plan) -> None:
    """Let stages that may run, and their devices, find what would make them fail, before anything runs.

    A device may have a method ``check()``; a stage ``name`` may have a function ``_check_name`` beside it that takes
    its settings.

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
                if hasattr(device, "check"):
                    _collect(device.check, f"{node.path}.{name}", problems)
            check = _companion(node, "_check_")
            if check is not None and len(problems) == before:
                _collect(partial(check, **{**node.settings, **devices}), node.path, problems)
        except InputError as error:
            problems.append(error.at(node.path))
    if problems:
        raise InputErrors(problems)


def _companion(node: Node, prefix: str) -> Callable[..., None] | None:
    module = importlib.import_module(node.entry.module)
    return getattr(module, prefix + node.entry.signature.name, None)


def _collect(check: Callable[[], None], place: str, problems: list[InputError]) -> None:
    try:
        check()
    except InputError as error:
        problems.append(error.at(place))
    except InputErrors as several:
        problems += [error.at(place) for error in several.errors]


def execute(
    plan: Plan,
    store: Store,
    listener: Listener,
    *,
    run_graph: Scheduler,
    provenance: Mapping[str, Any],
) -> dict[str, Outcome]:
    """Run what the plan leaves to run; results are in the store when this returns.

    Parameters
    ----------
    plan : Plan
        Steps in order.
    store : Store
        Where values are read and kept.
    listener : Listener
        Hears of every step.
    run_graph : Scheduler
        Runs a dask graph.
    provenance : dict
        Host, commit and versions, for the records.

    Returns
    -------
    dict of str to Outcome
        How each node ended, cached ones included, in the plan's order.
    """
    outcomes: dict[str, Outcome] = {}
    for name, step in plan.steps.items():
        if step.state == "cached":
            outcomes[name] = Outcome(name, "cached", step.record, step.reason)
            listener.ended(outcomes[name])
    if plan.to_run:
        bench = _Bench(store, listener, provenance)
        graph: dict[TaskName, Any] = {}
        for name, step in plan.to_run.items():
            waits_for = [n for n in step.task.node.upstream() if n in plan.to_run]
            known = {n: _artifact_of(outcomes[n]) for n in step.task.node.upstream() if n in outcomes}
            waited = [_task_name(n) for n in waits_for]
            graph[_task_name(name)] = (bench.run, step.task, step.reason, known, waited)
        with _collecting_messages():
            results = run_graph(graph, list(graph))
        outcomes |= {outcome.name: outcome for outcome in results}
    return {name: outcomes[name] for name in plan.steps}


def call_stage(node: Node, values: Mapping[str, Any]) -> Any:
    """Call a node's stage on its inputs' values."""
    module = importlib.import_module(node.entry.module)
    function = getattr(module, node.entry.signature.name)
    settings = {
        name: build_device(value) if isinstance(value, DeviceRecipe) else value for name, value in node.settings.items()
    }
    return function(*(values[name] for name in node.inputs), **settings)


def build_device(recipe: DeviceRecipe) -> Any:
    """Build a device and those inside it; nothing is opened yet.

    Raises
    ------
    InputError
        A device's class lacks what the stage asks of it, or refuses its settings.
    """
    module = importlib.import_module(recipe.entry.module)
    kind = getattr(module, recipe.entry.signature.name)
    settings = {
        name: build_device(value) if isinstance(value, DeviceRecipe) else value
        for name, value in recipe.settings.items()
    }
    try:
        return kind(**settings)
    except ValueError as error:
        raise InputError(f"{recipe.entry.name}: {error}") from error


class _Bench:
    """Runs tasks on one store, and knows how many run at once."""

    def __init__(self, store: Store, listener: Listener, provenance: Mapping[str, Any]) -> None:
        self.store = store
        self.listener = listener
        self.provenance = provenance
        self._active = 0
        self._lock = threading.Lock()

    def run(self, task: Task, reason: str, known: Mapping[str, str], upstream: list[Outcome]) -> Outcome:
        node = task.node
        failed = [o for o in upstream if o.status in {"failed", "blocked"}]
        if failed:
            causes = dict.fromkeys(n for o in failed for n in (o.blocked_by or (o.name,)))
            outcome = Outcome(node.name, "blocked", blocked_by=tuple(causes))
        else:
            artifacts = {**known, **{o.name: _artifact_of(o) for o in upstream}}
            outcome = self._run(task, reason, inputs_of(node, artifacts), any(o.status == "ran" for o in upstream))
        self.listener.ended(outcome)
        return outcome

    def _run(self, task: Task, reason: str, inputs: Inputs, rippled: bool) -> Outcome:
        name = task.node.name
        try:
            key = task.key(inputs)
            with self.store.lock(key):
                record = self.store.find(key)
                if record is not None and self.store.sound(record.artifact):
                    same = "its inputs came out as before" if rippled else "computed by another run meanwhile"
                    return Outcome(name, "cached", record, same)
                self.listener.started(name)
                record = self._compute(task, key, inputs)
            return Outcome(name, "ran", record, _ran_reason(reason))
        except PipelineError as error:
            return Outcome(name, "failed", reason=_ran_reason(reason), error=str(error))
        except Exception:
            return Outcome(name, "failed", reason=_ran_reason(reason), error=traceback.format_exc())

    def _compute(self, task: Task, key: str, inputs: Inputs) -> Record:
        values = {parameter: self._load(item) for parameter, item in inputs.items()}
        said = _Messages()
        with ExitStack() as stack:
            stack.enter_context(self._share_of_cores())
            stack.enter_context(said)
            stack.enter_context(listening(lambda done, total: self.listener.advanced(task.node.name, done, total)))
            memory = stack.enter_context(PeakMemory())
            cpu_seconds = stack.enter_context(cpu_meter())
            start = time.perf_counter()
            value = call_stage(task.node, values)
            seconds = time.perf_counter() - start
            cpu = cpu_seconds()
        record = Record(
            key=key,
            artifact=self.store.put(value, sync=task.node.is_source),
            type=type(value).__name__,
            stage=task.node.entry.name,
            code=task.code,
            settings=task.settings,
            inputs=inputs,
            seconds=round(seconds, 4),
            cpu_seconds=round(cpu, 4),
            peak_mb=round(memory.peak_mb, 1),
            host=platform.node(),
            finished=datetime.now(UTC).isoformat(timespec="seconds"),
            commit=self.provenance["commit"],
            versions=self.provenance["versions"],
            warnings=tuple(said.warnings),
            notes=tuple(said.notes),
        )
        self.store.keep(record)
        return record

    def _load(self, item: str | tuple[str, ...] | None) -> Any:
        if isinstance(item, tuple):
            return [self.store.get(artifact) for artifact in item]
        return None if item is None else self.store.get(item)

    def _share_of_cores(self) -> ExitStack:
        """Give a stage the cores that its neighbours leave."""
        stack = ExitStack()
        with self._lock:
            self._active += 1
            stack.enter_context(thread_budget(cores() // self._active))

        def leave() -> None:
            with self._lock:
                self._active -= 1

        stack.callback(leave)
        return stack


def _task_name(name: str) -> TaskName:
    """A key for dask; a pair, since dask would take any text that equals a key for a reference to it."""
    return ("node", name)


def _artifact_of(outcome: Outcome) -> str:
    assert outcome.record is not None
    return outcome.record.artifact


def _ran_reason(reason: str) -> str:
    return reason if not reason.startswith("if ") else reason.removeprefix("if ").replace("changes", "changed")


_said: ContextVar[_Messages | None] = ContextVar("messages", default=None)


class _Messages:
    """What a stage logs while it runs."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.notes: list[str] = []

    def __enter__(self) -> _Messages:
        self._token = _said.set(self)
        return self

    def __exit__(self, *_: object) -> None:
        _said.reset(self._token)


class _collecting_messages(logging.Handler):  # noqa: N801 - used as a context manager
    """Hands log records to the stage that is running in the thread that logs."""

    def emit(self, record: logging.LogRecord) -> None:
        said = _said.get()
        if said is not None and record.levelno >= logging.INFO:
            (said.warnings if record.levelno >= logging.WARNING else said.notes).append(record.getMessage())

    def __enter__(self) -> None:
        self._logger = logging.getLogger("pipeline")
        self._before = (self._logger.level, self._logger.propagate)
        self._logger.setLevel(logging.INFO)
        self._logger.propagate = bool(os.environ.get("OPTIBENCH_LOG"))
        self._logger.addHandler(self)

    def __exit__(self, *_: object) -> None:
        self._logger.removeHandler(self)
        self._logger.level, self._logger.propagate = self._before
