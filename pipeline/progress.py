"""How a long stage says how far it is."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

Listener = Callable[[int, int], None]

_listener: ContextVar[Listener | None] = ContextVar("progress_listener", default=None)
_stopping = threading.Event()


class Stopped(Exception):
    """Raised inside a stage when its run is interrupted, so that what it holds is let go."""


def stop() -> None:
    """Ask all stages of this process to stop where they next say how far they are."""
    _stopping.set()


def go_on() -> None:
    """Let stages run again."""
    _stopping.clear()


def check() -> None:
    """Raise :class:`Stopped` if stages are asked to stop."""
    if _stopping.is_set():
        raise Stopped


def advance(done: int, total: int) -> None:
    """Say that ``done`` of ``total`` steps of the current stage are finished.

    Raises
    ------
    Stopped
        The run was interrupted.
    """
    check()
    listener = _listener.get()
    if listener is not None:
        listener(done, total)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Send the calls of :func:`advance` inside the block to ``listener``."""
    token = _listener.set(listener)
    try:
        yield
    finally:
        _listener.reset(token)
