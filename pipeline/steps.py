"""How a capture takes photographs one by one, so that those it has are kept if a later one fails."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Protocol, TypeVar

T = TypeVar("T")


class Keeper(Protocol):
    """Keeps what the steps of a capture took."""

    def step(self, index: int, take: Callable[[], T]) -> T:
        """The value of a step: as it was kept, or taken now and kept."""


_keeper: ContextVar[Keeper | None] = ContextVar("keeper", default=None)


def step(index: int, take: Callable[[], T]) -> T:
    """Take what a capture takes in one step, unless an earlier attempt at the same capture has kept it.

    Parameters
    ----------
    index : int
        Number of the step.
    take : callable
        Takes it; its value is one of :mod:`pipeline.data`.
    """
    keeper = _keeper.get()
    return take() if keeper is None else keeper.step(index, take)


@contextmanager
def keeping(keeper: Keeper | None) -> Iterator[None]:
    """Let a keeper keep the steps of the capture inside the block."""
    token = _keeper.set(keeper)
    try:
        yield
    finally:
        _keeper.reset(token)
