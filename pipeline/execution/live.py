"""How a run is shown while it goes on: live bars on a terminal, a plain log elsewhere."""

from __future__ import annotations

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from rich.progress import Progress, TaskID

    from pipeline.execution.outcome import Listener, Outcome


class Display(Protocol):
    """A listener that is open while a run goes on."""

    def __enter__(self) -> Listener: ...

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def display(*, quiet: bool, notes: bool = True) -> Display:
    """Choose the display that fits the terminal; ``notes`` are what stages say beside warnings."""
    if quiet:
        return PlainLog(quiet=True)
    return LiveBars(notes=notes) if sys.stderr.isatty() else PlainLog(notes=notes)


class PlainLog:
    """One line for each stage that runs, with its seconds, and its warnings."""

    def __init__(self, *, quiet: bool = False, notes: bool = True) -> None:
        self.quiet, self.notes = quiet, notes

    def __enter__(self) -> PlainLog:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        return None

    def started(self, name: str) -> None:
        """Say nothing; the line comes when the stage has ended."""

    def advanced(self, name: str, done: int, total: int) -> None:
        """Say nothing."""

    def ended(self, outcome: Outcome) -> None:
        """Print how a stage ended; of cached ones only the warnings."""
        if self.quiet:
            return
        if outcome.status != "cached":
            print(line_of(outcome), file=sys.stderr, flush=True)
        for line in said_lines(outcome, notes=self.notes):
            print(line, file=sys.stderr, flush=True)


class LiveBars:
    """A bar for each running stage, above which finished ones scroll away."""

    def __init__(self, *, notes: bool = True) -> None:
        self.notes = notes

    def __enter__(self) -> LiveBars:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        self._progress: Progress = Progress(
            SpinnerColumn(),
            TextColumn("{task.description}", markup=False),
            BarColumn(bar_width=30),
            TimeElapsedColumn(),
            console=Console(stderr=True),
            transient=True,
        )
        self._bars: dict[str, TaskID] = {}
        self._shown = False
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._shown:
            self._progress.stop()

    def started(self, name: str) -> None:
        """Show a bar."""
        if not self._shown:
            self._progress.start()
            self._shown = True
        self._bars[name] = self._progress.add_task(name, total=None)

    def advanced(self, name: str, done: int, total: int) -> None:
        """Move a bar."""
        if name in self._bars:
            self._progress.update(self._bars[name], completed=done, total=total)

    def ended(self, outcome: Outcome) -> None:
        """Replace the bar by a line."""
        from rich.text import Text

        if outcome.name in self._bars:
            self._progress.remove_task(self._bars.pop(outcome.name))
        if outcome.status != "cached":
            colour = {"ran": "green", "failed": "red", "blocked": "yellow"}[outcome.status]
            self._progress.console.print(Text(line_of(outcome), style=colour))
        for line in said_lines(outcome, notes=self.notes):
            self._progress.console.print(Text(line, style="yellow"))


class Counter:
    """Counts how nodes ended, and passes everything on."""

    def __init__(self, listener: Listener) -> None:
        self.counts = dict.fromkeys(("ran", "cached", "failed", "blocked"), 0)
        self.started = listener.started
        self.advanced = listener.advanced
        self._ended = listener.ended

    def ended(self, outcome: Outcome) -> None:
        """Count an outcome."""
        self.counts[outcome.status] += 1
        self._ended(outcome)

    def summary(self) -> str:
        """All counts in words."""
        words = f"{self.counts['ran']} stages run, {self.counts['cached']} from the store"
        return words + "".join(f", {self.counts[s]} {s}" for s in ("failed", "blocked") if self.counts[s])


def line_of(outcome: Outcome) -> str:
    """One line on how a node ended."""
    seconds = f"{outcome.record.seconds:7.2f} s" if outcome.record else " " * 9
    tail = f"waits for {', '.join(outcome.blocked_by)}" if outcome.status == "blocked" else outcome.reason
    return f"{outcome.status:>8}  {seconds}  {outcome.name}" + (f"  ({tail})" if tail else "")


def said_lines(outcome: Outcome, *, notes: bool) -> list[str]:
    """What the stage said while it ran; of a cached one what it warned of when it was computed."""
    if outcome.record is None:
        return []
    cached = outcome.status == "cached"
    place = f" ({outcome.name}, from the store)" if cached else ""
    beside = [f"          {text}" for text in outcome.record.notes] if notes and not cached else []
    return [*beside, *(f"          warning{place}: {text}" for text in outcome.record.warnings)]
