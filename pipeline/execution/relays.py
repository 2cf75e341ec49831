"""How a run hears of stages that threads, other processes and the workers of a cluster carry out."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from pipeline.execution.outcome import Listener, Outcome


@contextmanager
def heard(listener: Listener) -> Iterator[dict[str, Outcome]]:
    """Collect the outcomes of a local dask scheduler, and pass them on as they come."""
    from dask.callbacks import Callback

    ended: dict[str, Outcome] = {}

    def after(key: Any, result: Any, graph: Any, state: Any, worker: Any) -> None:
        if isinstance(result, Outcome):
            ended[result.name] = result
            listener.ended(result)

    with Callback(posttask=after):
        yield ended


@dataclass
class Relay:
    """A listener in another process; what it hears is put into a queue that the run's process empties."""

    queue: Any
    begun: set[str] = field(default_factory=set)

    def started(self, name: str) -> None:
        """Pass on that a stage has begun."""
        self.queue.put(("started", name))

    def advanced(self, name: str, done: int, total: int) -> None:
        """Pass on that a stage has come further."""
        self.queue.put(("advanced", name, done, total))

    def ended(self, outcome: Outcome) -> None:
        """Say nothing: the outcome is the task's value, and comes by itself."""

    def running(self, ended: Mapping[str, Outcome]) -> list[str]:
        """Names of the stages that began and of whose end nothing was heard."""
        return sorted(name for name in self.begun if name not in ended)


@contextmanager
def relayed(queue: Any, listener: Listener) -> Iterator[Relay]:
    """A relay for the processes of a pool; a thread empties its queue into the run's own listener."""
    relay = Relay(queue)

    def pump() -> None:
        while (event := queue.get()) is not None:
            if event[0] == "started":
                relay.begun.add(event[1])
                listener.started(event[1])
            else:
                listener.advanced(*event[1:])

    thread = threading.Thread(target=pump, daemon=True)
    thread.start()
    try:
        yield relay
    finally:
        queue.put(None)
        thread.join()


@dataclass
class WorkerEvents:
    """A listener on a worker of a cluster; what it hears goes out as events of a topic."""

    topic: str

    def started(self, name: str) -> None:
        """Pass on that a stage has begun."""
        self._say(["started", name])

    def advanced(self, name: str, done: int, total: int) -> None:
        """Pass on that a stage has come further."""
        self._say(["advanced", name, done, total])

    def ended(self, outcome: Outcome) -> None:
        """Say nothing: the outcome is the task's value, and comes by itself."""

    def _say(self, event: list[Any]) -> None:
        from dask.distributed import get_worker

        get_worker().log_event(self.topic, event)


@contextmanager
def listening(client: Any, listener: Listener) -> Iterator[WorkerEvents]:
    """A listener for the workers of a cluster, whose events reach the run's own listener."""
    from uuid import uuid4

    topic = f"optibench-{uuid4().hex}"

    def heard(event: tuple[float, list[Any]]) -> None:
        kind, *words = event[1]
        (listener.started if kind == "started" else listener.advanced)(*words)

    client.subscribe_topic(topic, heard)
    try:
        yield WorkerEvents(topic)
    finally:
        client.unsubscribe_topic(topic)
