"""How a node ended, and who hears of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

from pipeline.storage.record import Record

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

    @property
    def artifact(self) -> str:
        """Digest of its value, which it has unless it failed or was blocked."""
        assert self.record is not None
        return self.record.artifact


class Listener(Protocol):
    """Hears how a run goes on; called from the threads of the stages."""

    def started(self, name: str) -> None:
        """Note that a stage has begun."""

    def advanced(self, name: str, done: int, total: int) -> None:
        """Note that a stage has come further."""

    def ended(self, outcome: Outcome) -> None:
        """Note that a node is done with, one way or another."""


class Silent:
    """A listener that says nothing."""

    def started(self, name: str) -> None:
        """Hear that a stage has begun."""

    def advanced(self, name: str, done: int, total: int) -> None:
        """Hear that a stage has come further."""

    def ended(self, outcome: Outcome) -> None:
        """Hear that a node is done with."""
