"""One stage carried out again on the inputs that it had, without keeping anything: to look into it, or to time it."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

from pipeline.execution.messages import Messages
from pipeline.execution.plan import inputs_of
from pipeline.execution.workbench import call_stage, input_values
from pipeline.graph.nodes import Node
from pipeline.storage.store import Store


def call_again(node: Node, artifacts: Mapping[str, str], store: Store) -> Callable[[], Any]:
    """A call of a node's stage on inputs from the store.

    Parameters
    ----------
    node : Node
        The node.
    artifacts : dict of str to str
        Digests of the values of its upstream nodes.
    store : Store
        Where these lie.
    """
    return partial(call_stage, node, input_values(store, inputs_of(node, artifacts)))


def least_seconds(node: Node, artifacts: Mapping[str, str], store: Store, repeats: int) -> float:
    """Least wall time of a node's stage over some calls, after one that does not count.

    The first call compiles what has to be compiled and brings the inputs into memory. The least of the others is what
    the stage takes when nothing else disturbs it; what does can only add. It may use all cores, as a stage that runs
    alone.

    Parameters
    ----------
    node, artifacts, store
        As for :func:`call_again`.
    repeats : int
        Calls that count.
    """
    call = call_again(node, artifacts, store)
    seconds = []
    with Messages():
        call()
        for _ in range(repeats):
            start = time.perf_counter()
            call()
            seconds.append(time.perf_counter() - start)
    return min(seconds)
