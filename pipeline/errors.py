"""The errors that a user can mend, each saying what, where, and what was expected."""

from __future__ import annotations

import difflib
from collections.abc import Iterable


class PipelineError(Exception):
    """Anything the bench reports to its user without a traceback."""


class InputError(PipelineError):
    """Wrong input, found before any stage runs.

    Parameters
    ----------
    what : str
        What is wrong, in one clause.
    where : str, optional
        File, YAML path or command-line override.
    expected : str, optional
        What would have been right.
    hint : str, optional
        The nearest right name, or what to do.
    """

    def __init__(self, what: str, *, where: str = "", expected: str = "", hint: str = "") -> None:
        self.what = what
        self.where = where
        self.expected = expected
        self.hint = hint
        super().__init__(what, where, expected, hint)

    def __str__(self) -> str:
        lines = [self.what]
        if self.where:
            lines.append(f"  where:    {self.where}")
        if self.expected:
            lines.append(f"  expected: {self.expected}")
        if self.hint:
            lines.append(f"  hint:     {self.hint}")
        return "\n".join(lines)

    def at(self, where: str) -> InputError:
        """The same error with its place named more fully."""
        place = f"{where}: {self.where}" if self.where else where
        return InputError(self.what, where=place, expected=self.expected, hint=self.hint)


class InputErrors(PipelineError):
    """Several input errors of one experiment, reported together, each once."""

    def __init__(self, errors: Iterable[InputError]) -> None:
        self.errors = tuple({str(error): error for error in errors}.values())
        super().__init__(self.errors)

    def __str__(self) -> str:
        return "\nerror: ".join(str(error) for error in self.errors)


class DeviceError(PipelineError):
    """A device failed; names the device and the cause."""


def closest(name: str, names: Iterable[str]) -> str:
    """A hint that names the closest of ``names``, empty when none is close."""
    close = difflib.get_close_matches(name, sorted(names), n=1, cutoff=0.55)
    return f"did you mean '{close[0]}'?" if close else ""


def nearest(name: str, names: Iterable[str]) -> str:
    """A hint that names the closest of ``names``, or lists them when none is close."""
    candidates = sorted(names)
    if not candidates:
        return ""
    shown = ", ".join(candidates[:12]) + (", ..." if len(candidates) > 12 else "")
    return closest(name, candidates) or f"there is: {shown}"
