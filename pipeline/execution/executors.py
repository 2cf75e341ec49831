"""Who runs the graph: threads of this process, other processes, or a dask cluster."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol

from pipeline.errors import InputError, PipelineError, nearest
from pipeline.execution.outcome import Listener, Outcome
from pipeline.execution.relays import heard, listening, relayed
from pipeline.execution.workbench import Workbench
from pipeline.parallel import cores
from pipeline.progress import go_on, stop

TaskName = tuple[str, str]
BENCH: TaskName = ("bench", "")
"""Where a graph holds the workbench that all its tasks share."""

DIED = "the process that ran it died; it may have been killed, or have run out of memory"

TaskGraph = dict[TaskName, Any]


class Executor(Protocol):
    """Runs a dask graph of tasks.

    Attributes
    ----------
    memory_gb : float or None
        Memory of a machine that stages may use together; None for all of it.
    """

    memory_gb: float | None

    def run(self, graph: TaskGraph, workbench: Workbench) -> dict[str, Outcome]:
        """Run all tasks, tell the workbench's listener how they go, and return how each ended that did."""


def executor_of(settings: Mapping[str, Any], log: Callable[[str], None] = lambda text: None) -> Executor:
    """The executor that an executor's settings ask for.

    Parameters
    ----------
    settings : mapping
        The section ``executor`` of a configuration.
    log : callable
        Is told what the user may want to know, such as the address of a dashboard.

    Raises
    ------
    InputError
        There is no such kind of executor, or a setting of it is impossible.
    """
    kinds = {"threads": _threads, "serial": _serial, "processes": _processes, "distributed": _distributed}
    rest = dict(settings)
    kind = rest.pop("kind", "threads")
    if kind not in kinds:
        raise InputError(
            f"there is no executor of kind '{kind}'",
            where="executor.kind",
            expected=", ".join(kinds),
            hint=nearest(str(kind), kinds),
        )
    workers = rest.pop("workers", None)
    if workers is not None and (not isinstance(workers, int) or isinstance(workers, bool) or workers < 1):
        raise InputError(f"workers is {workers!r}", where="executor.workers", expected="a whole number from 1, or null")
    memory_gb = rest.pop("memory_gb", None)
    if memory_gb is not None and (isinstance(memory_gb, bool | str) or not memory_gb > 0):
        raise InputError(f"memory_gb is {memory_gb!r}", where="executor.memory_gb", expected="a number, or null")
    known = {"distributed": ("address", "dashboard")}.get(kind, ())
    for name in rest:
        if name not in known:
            expected = ["kind", "workers", "memory_gb", *known]
            raise InputError(
                f"an executor of kind '{kind}' has no setting '{name}'",
                where=f"executor.{name}",
                expected="a name from: " + ", ".join(expected),
                hint=nearest(name, expected),
            )
    made = kinds[kind](workers, rest, log)
    made.memory_gb = None if memory_gb is None else float(memory_gb)
    return made


@dataclass
class InThisProcess:
    """Runs tasks on threads of this process, or one after the other where it has one worker."""

    workers: int
    memory_gb: float | None = None

    def run(self, graph: TaskGraph, workbench: Workbench) -> dict[str, Outcome]:
        """Run all tasks."""
        from dask.local import get_sync
        from dask.threaded import get

        names = list(graph)
        whole = {BENCH: workbench, **graph}
        with heard(workbench.listener) as ended:
            if self.workers == 1:
                get_sync(whole, names)
                return ended
            with ThreadPoolExecutor(self.workers) as pool:
                try:
                    get(whole, names, pool=pool)
                except KeyboardInterrupt:
                    stop()
                    pool.shutdown(cancel_futures=True)
                    raise
                finally:
                    go_on()
        return ended


@dataclass
class InProcesses:
    """Runs tasks in processes of this machine."""

    workers: int
    memory_gb: float | None = None

    def run(self, graph: TaskGraph, workbench: Workbench) -> dict[str, Outcome]:
        """Run all tasks; a task whose process dies has failed."""
        import multiprocessing
        from concurrent.futures import ProcessPoolExecutor
        from concurrent.futures.process import BrokenProcessPool

        from dask.multiprocessing import get

        spawn = multiprocessing.get_context("spawn")
        workers = min(self.workers, len(graph))
        with spawn.Manager() as manager, relayed(manager.Queue(), workbench.listener) as relay:
            bench = replace(workbench, listener=relay, cores=max(1, cores() // workers))
            with heard(workbench.listener) as ended, ProcessPoolExecutor(workers, spawn) as pool:
                try:
                    get({BENCH: bench, **graph}, list(graph), pool=pool, chunksize=1, optimize_graph=False)
                except BrokenProcessPool:
                    for name in relay.running(ended):
                        ended[name] = Outcome(name, "failed", error=DIED)
                        workbench.listener.ended(ended[name])
        return ended


class _Deserted(Exception):
    """A cluster of our own has lost all its workers, and none comes back."""


_ANSWER_S = 10.0
_ATTEMPTS = 3
_DESERTED_S = 60.0


@contextmanager
def _watched(client: Any, futures: list[Any], *, patient: bool) -> Iterator[threading.Event]:
    """Cancel tasks that wait for workers that never come, as dask itself does not; its nannies may give up under load.

    Gives an event that is set where that happened. Workers of somebody else's cluster may well come later, so there
    ``patient`` waits.
    """
    deserted, over = threading.Event(), threading.Event()

    def watch() -> None:
        alive = time.monotonic()
        while not over.wait(1.0):
            if client.scheduler_info()["workers"]:
                alive = time.monotonic()
            elif time.monotonic() - alive > _DESERTED_S:
                deserted.set()
                client.cancel(futures, force=True)
                return

    watcher = threading.Thread(target=watch, daemon=True)
    if not patient:
        watcher.start()
    try:
        yield deserted
    finally:
        over.set()
        if not patient:
            watcher.join()


@dataclass
class OnCluster:
    """Runs tasks on a dask cluster: one of this machine's own, or one at an address."""

    workers: int
    address: str | None
    dashboard: bool
    log: Callable[[str], None]
    memory_gb: float | None = None

    def run(self, graph: TaskGraph, workbench: Workbench) -> dict[str, Outcome]:
        """Run all tasks; those of a worker that dies are run by another one.

        Dask blames all tasks that wait on a worker for its death, and gives up those blamed several times. They get
        another chance one by one, which shows the stage that kills; then the rest goes on. So do all tasks once a
        cluster has lost its workers for good, since a dead worker takes along outcomes that nobody has heard yet.
        """
        ended: dict[str, Outcome] = {}
        left, lost = graph, 0
        while left:
            before = len(ended)
            try:
                with self._client() as client, listening(client, workbench.listener) as relay:
                    away = self.address is not None
                    bench = replace(workbench, listener=relay, cores=None if away else 1, elsewhere=away)
                    while left:
                        part = _first(left) if lost else left
                        self._all(client, part, bench, ended, workbench.listener)
                        left = _remaining(left, ended, f"again after {next(iter(left))[0]}")
            except _Deserted:
                lost = lost + 1 if len(ended) == before else 1
                self.log("all workers are gone; new ones are started")
            left = _remaining(left, ended, f"again after {next(iter(left))[0]}") if left else {}
            if left and lost >= _ATTEMPTS:
                for _, name in _first(left):
                    ended[name] = Outcome(name, "failed", error="no worker of the cluster stays alive")
                    workbench.listener.ended(ended[name])
                left = _remaining(left, ended, f"without {next(iter(left))[0]}")
        return ended

    def _all(
        self, client: Any, left: TaskGraph, bench: Workbench, ended: dict[str, Outcome], listener: Listener
    ) -> None:
        """Run tasks, round after round, until each has ended or is known to kill its worker."""
        while left:
            blamed = self._round(client, left, bench, ended, listener)
            for task in [task for task in left if task[1] in blamed]:
                alone = _remaining({task: left[task]}, ended, f"alone after {task[0]}")
                for name, error in self._round(client, alone, bench, ended, listener).items():
                    ended[name] = Outcome(name, "failed", error=f"{DIED} ({error})")
                    listener.ended(ended[name])
            left = _remaining(left, ended, f"after {next(iter(left))[0]}") if blamed else {}

    def _round(
        self, client: Any, graph: TaskGraph, bench: Workbench, ended: dict[str, Outcome], listener: Listener
    ) -> dict[str, str]:
        """Run tasks, note how each ended, and give those that dask blames for deaths of workers, with its words."""
        from dask.distributed import CancelledError, as_completed

        blamed: dict[str, str] = {}
        futures = client.get({BENCH: bench, **graph}, list(graph), sync=False)
        names = {future.key: name for future, (_, name) in zip(futures, graph, strict=True)}
        with _watched(client, futures, patient=self.address is not None) as deserted:
            for future in as_completed(futures):
                try:
                    finished: Outcome | None = future.result() if future.status == "finished" else None
                except CancelledError:
                    finished = None
                if finished is not None:
                    ended[finished.name] = finished
                    listener.ended(finished)
                    continue
                if deserted.is_set():
                    raise _Deserted
                error = future.exception()
                if type(error).__name__ == "KilledWorker" and repr(names[future.key]) in str(error):
                    blamed[names[future.key]] = str(error)
        return blamed

    @contextmanager
    def _client(self) -> Iterator[Any]:
        from dask.distributed import Client, LocalCluster

        if self.address:
            try:
                client = Client(self.address, timeout=_ANSWER_S)
            except (OSError, ValueError) as error:
                raise InputError(
                    f"no dask scheduler answers at {self.address}: {error}",
                    where="executor.address",
                    expected="the address that dask-scheduler printed, such as tcp://10.0.0.5:8786",
                ) from None
            with client:
                self._show(client)
                yield client
            return
        with (
            LocalCluster(
                n_workers=self.workers,
                threads_per_worker=1,
                memory_limit=0,
                dashboard_address=":0",
                silence_logs=50,
            ) as cluster,
            Client(cluster) as client,
        ):
            self._show(client)
            yield client

    def _show(self, client: Any) -> None:
        from importlib.util import find_spec

        if self.dashboard and find_spec("bokeh") is not None:
            self.log(f"dashboard: {client.dashboard_link}")


def _first(graph: TaskGraph) -> TaskGraph:
    """The first task that waits for no other one."""
    ready = (name for name, task in graph.items() if all(isinstance(upstream, Outcome) for upstream in task[-1]))
    first = next(ready)
    return {first: graph[first]}


def _remaining(graph: TaskGraph, ended: Mapping[str, Outcome], kind: str) -> TaskGraph:
    """The tasks that have not ended, under names that dask has not heard, with the outcomes of those that have."""

    def now(upstream: Any) -> Any:
        if isinstance(upstream, Outcome):
            return upstream
        return ended.get(upstream[1], (kind, upstream[1]))

    return {
        (kind, name): (*task, [now(upstream) for upstream in waits_for])
        for (_, name), (*task, waits_for) in graph.items()
        if name not in ended
    }


def _threads(workers: int | None, settings: Mapping[str, Any], log: Callable[[str], None]) -> Executor:
    return InThisProcess(workers or cores())


def _serial(workers: int | None, settings: Mapping[str, Any], log: Callable[[str], None]) -> Executor:
    return InThisProcess(1)


def _processes(workers: int | None, settings: Mapping[str, Any], log: Callable[[str], None]) -> Executor:
    return InProcesses(workers or cores())


def _distributed(workers: int | None, settings: Mapping[str, Any], log: Callable[[str], None]) -> Executor:
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise InputError(
            "the executor 'distributed' needs the package of that name",
            where="executor.kind",
            expected="pip install distributed",
        ) from None
    return OnCluster(workers or cores(), settings.get("address"), bool(settings.get("dashboard", True)), log)


__all__ = ["BENCH", "Executor", "PipelineError", "executor_of"]
