"""Threads inside a stage, sharing the cores with the scheduler that runs the stages."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar

_budget: ContextVar[int | None] = ContextVar("thread_budget", default=None)
_meter: ContextVar[list[float] | None] = ContextVar("cpu_meter", default=None)


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def threads() -> int:
    """Threads the current stage may use."""
    return _budget.get() or cores()


@contextmanager
def thread_budget(count: int) -> Iterator[None]:
    """Limit :func:`threads` to ``count`` inside the block."""
    token = _budget.set(max(1, count))
    try:
        yield
    finally:
        _budget.reset(token)


@contextmanager
def cpu_meter() -> Iterator[Callable[[], float]]:
    """Measure the CPU seconds of this thread and of the threads that :func:`over_rows` starts inside the block."""
    helpers: list[float] = []
    token = _meter.set(helpers)
    start = time.thread_time()
    try:
        yield lambda: time.thread_time() - start + sum(helpers)
    finally:
        _meter.reset(token)


def over_rows(kernel: Callable[[int, int], None], rows: int, *, tile: int = 64) -> None:
    """Call ``kernel(start, stop)`` for row tiles that cover ``range(rows)``.

    The kernel must release the interpreter lock (numba ``nogil=True``, NumPy, OpenCV) and write only its own rows.
    """
    tiles = [(start, min(start + tile, rows)) for start in range(0, rows, tile)]
    count = min(threads(), len(tiles))
    if count <= 1:
        for start, stop in tiles:
            kernel(start, stop)
        return

    def timed(span: tuple[int, int]) -> float:
        start = time.thread_time()
        kernel(*span)
        return time.thread_time() - start

    with ThreadPoolExecutor(count) as pool:
        seconds = sum(pool.map(timed, tiles))
    meter = _meter.get()
    if meter is not None:
        meter.append(seconds)
