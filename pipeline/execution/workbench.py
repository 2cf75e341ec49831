"""Where a task is carried out: in this process, in one of a pool, or on a worker of a cluster."""

from __future__ import annotations

import importlib
import platform
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from pipeline.codebase.freshness import check_same
from pipeline.codebase.source import Sources
from pipeline.errors import InputError, PipelineError
from pipeline.execution.gate import Gate
from pipeline.execution.messages import Messages
from pipeline.execution.outcome import Listener, Outcome
from pipeline.execution.plan import Inputs, Task, in_session, inputs_of
from pipeline.execution.usage import PeakMemory
from pipeline.graph.nodes import DeviceRecipe, Node
from pipeline.parallel import cores, cpu_meter, thread_budget
from pipeline.progress import Stopped, check, listening
from pipeline.steps import keeping
from pipeline.storage.files import FileDigests
from pipeline.storage.record import Record
from pipeline.storage.store import Store

_active = 0
_active_guard = threading.Lock()


@dataclass(frozen=True)
class Workbench:
    """What carrying out a task takes; it can be sent to another process.

    Attributes
    ----------
    store : Store
        Where inputs are read and values kept.
    listener : Listener
        Hears how tasks begin and how far they are.
    commit, versions : str
        Of the code, for the records.
    gate : Gate, optional
        Lets tasks through that fit side by side.
    cores : int or None
        Cores that the tasks of this process share; None for all that it may use.
    elsewhere : bool
        Whether it may be on another machine, whose code has to be compared.
    """

    store: Store
    listener: Listener
    commit: str
    versions: str
    gate: Gate | None = None
    cores: int | None = None
    elsewhere: bool = False

    def carry_out(self, task: Task, reason: str, known: Mapping[str, str], upstream: list[Outcome]) -> Outcome:
        """Run a task whose inputs are ready, unless one of them failed or the store has its result by now.

        Parameters
        ----------
        task : Task
            The task.
        reason : str
            Why it runs.
        known : dict of str to str
            Values of upstream nodes that the plan found in the store.
        upstream : list of Outcome
            How the other upstream nodes ended.
        """
        failed = [o for o in upstream if o.status in {"failed", "blocked"}]
        if failed:
            causes = dict.fromkeys(n for o in failed for n in (o.blocked_by or (o.name,)))
            return Outcome(task.node.name, "blocked", blocked_by=tuple(causes))
        artifacts = {**known, **{o.name: o.artifact for o in upstream}}
        rippled = any(o.status == "ran" for o in upstream)
        return self._found_or_run(task, reason, inputs_of(task.node, artifacts), rippled)

    def _found_or_run(self, task: Task, reason: str, inputs: Inputs, rippled: bool) -> Outcome:
        name = task.node.name
        check()
        reason = reason if not reason.startswith("if ") else reason.removeprefix("if ").replace("changes", "changed")
        try:
            task = in_session(task, inputs, self.store)
            key = task.key(inputs)
            with self.store.lock(key):
                record = None if task.forced else self.store.find(key)
                if record is not None and self.store.sound(record.artifact):
                    same = "its inputs came out as before" if rippled else "in the store"
                    return Outcome(name, "cached", record, same)
                with self.gate.passing(task.node.needs) if self.gate else nullcontext():
                    self.listener.started(name)
                    record = self._compute(task, key, inputs)
            return Outcome(name, "ran", record, reason)
        except Stopped:
            return Outcome(name, "failed", reason=reason, error="interrupted")
        except PipelineError as error:
            return Outcome(name, "failed", reason=reason, error=str(error))
        except Exception:
            return Outcome(name, "failed", reason=reason, error=traceback.format_exc())

    def _compute(self, task: Task, key: str, inputs: Inputs) -> Record:
        node = task.node
        if self.elsewhere:
            check_same(task.code, _sources_of_this_process())
        values = input_values(self.store, inputs)
        said = Messages()
        journal = self.store.journal(key) if node.is_source else None
        with (
            keeping(journal),
            _share_of_cores(self.cores or cores()),
            said,
            listening(lambda done, total: self.listener.advanced(node.name, done, total)),
            PeakMemory() as memory,
            cpu_meter() as cpu_seconds,
        ):
            start = time.perf_counter()
            value = call_stage(node, values)
            seconds = time.perf_counter() - start
            cpu = cpu_seconds()
        if journal is not None and journal.recalled:
            said.notes.append(f"{journal.recalled} steps had been taken by an earlier attempt that failed")
        _check_unchanged(task)
        artifact = self.store.put(value, durable=node.is_source)
        if task.forced and (before := self.store.record(key)) is not None and before.artifact != artifact:
            said.warnings.append("computed anew it came out differently: the stage does not always give the same value")
        record = Record(
            key=key,
            artifact=artifact,
            type=type(value).__name__,
            stage=node.entry.name,
            code=self.store.keep_provenance(task.code.modules, task.code.listing),
            settings=task.settings,
            inputs=inputs,
            seconds=round(seconds, 4),
            cpu_seconds=round(cpu, 4),
            peak_mb=round(memory.peak_mb, 1),
            host=platform.node(),
            finished=datetime.now(UTC).isoformat(timespec="seconds"),
            commit=self.commit,
            versions=self.versions,
            warnings=tuple(said.warnings),
            notes=tuple(said.notes),
            captured=node.is_source,
        )
        self.store.keep(record)
        if journal is not None:
            journal.discard()
        return record


def _check_unchanged(task: Task) -> None:
    """Refuse to keep what was made of files that are no longer those of the key."""
    files = FileDigests()
    for name, (content, stamp) in task.watched.items():
        path = Path(name)
        if not path.exists() or (files.stamp(path) != stamp and files.of(path) != content):
            raise InputError(
                f"{path} changed while it was read", where=task.node.path, expected="files that stay as they are"
            )


@cache
def _sources_of_this_process() -> Sources:
    return Sources()


def input_values(store: Store, inputs: Inputs) -> dict[str, Any]:
    """The values that go into a stage, by parameter."""
    values: dict[str, Any] = {}
    for parameter, artifacts in inputs.items():
        if isinstance(artifacts, tuple):
            values[parameter] = [store.get(artifact) for artifact in artifacts]
        else:
            values[parameter] = None if artifacts is None else store.get(artifacts)
    return values


def call_stage(node: Node, values: Mapping[str, Any]) -> Any:
    """Call a node's stage on its inputs' values."""
    module = importlib.import_module(node.entry.module)
    function = getattr(module, node.entry.signature.name)
    settings = {
        name: build_device(value) if isinstance(value, DeviceRecipe) else value for name, value in node.settings.items()
    }
    return function(*(values[name] for name in node.inputs), **settings)


def companion(node: Node, prefix: str) -> Any:
    """What stands beside a node's stage under its name with a prefix, such as ``_check_cosine``; None if nothing."""
    module = importlib.import_module(node.entry.module)
    return getattr(module, prefix + node.entry.signature.name, None)


def build_device(recipe: DeviceRecipe) -> Any:
    """Build a device and those inside it; nothing is opened yet.

    Raises
    ------
    InputError
        A device's class lacks what the stage asks of it, or refuses its settings.
    """
    module = importlib.import_module(recipe.entry.module)
    kind: Callable[..., Any] = getattr(module, recipe.entry.signature.name)
    settings = {
        name: build_device(value) if isinstance(value, DeviceRecipe) else value
        for name, value in recipe.settings.items()
    }
    try:
        return kind(**settings)
    except ValueError as error:
        raise InputError(f"{recipe.entry.name}: {error}") from error


@contextmanager
def _share_of_cores(available: int) -> Iterator[None]:
    """Give a stage the cores that its neighbours in this process leave."""
    global _active  # noqa: PLW0603 - counts the stages of the whole process
    with _active_guard:
        _active += 1
        share = available // _active
    try:
        with thread_budget(share):
            yield
    finally:
        with _active_guard:
            _active -= 1
