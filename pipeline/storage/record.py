"""What is known of a result: what it was made of, and what making it took."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

FORMAT = 3


@dataclass(frozen=True)
class Record:
    """What is known of one result.

    Attributes
    ----------
    key : str
        Digest of the recipe.
    artifact : str
        Digest of the value.
    type : str
        Name of the value's class.
    stage : str
        Name of the stage.
    code : str
        Digest under which the store keeps the code's listing: per module, the digests of its code and of its text.
    settings : dict
        Settings as they entered the key.
    inputs : dict
        Per parameter, the digests of the values that went in.
    seconds, cpu_seconds, peak_mb : float
        Wall time, CPU time of the stage's own threads, and the process' peak memory while it ran.
    host, finished, commit : str
        Where, when (ISO, UTC) and from which commit.
    versions : str
        Digest under which the store keeps the versions of the libraries at hand.
    warnings, notes : tuple of str
        What the stage said.
    captured : bool
        Whether real devices took it, so that it cannot be computed again.
    """

    key: str
    artifact: str
    type: str
    stage: str
    code: str
    settings: Mapping[str, Any]
    inputs: Mapping[str, Any]
    seconds: float = 0.0
    cpu_seconds: float = 0.0
    peak_mb: float = 0.0
    host: str = ""
    finished: str = ""
    commit: str = ""
    versions: str = ""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    captured: bool = False


_NAMES = tuple(f.name for f in fields(Record))


def record_content(record: Record) -> dict[str, Any]:
    """A record as plain values."""
    return {"format": FORMAT, **{name: getattr(record, name) for name in _NAMES}}


def record_of(content: Any, key: str) -> Record | None:
    """The record that plain values hold; None where they hold none, or that of another key."""
    try:
        if content["format"] != FORMAT or content["key"] != key:
            return None
        found = Record(**{name: content[name] for name in _NAMES})
        texts = (found.artifact, found.type, found.stage, found.code, found.versions, found.host, found.finished)
        if not all(isinstance(text, str) for text in texts) or not isinstance(found.settings, Mapping):
            return None
        return Record(
            **{**vars(found), "warnings": tuple(map(str, found.warnings)), "notes": tuple(map(str, found.notes))}
        )
    except (KeyError, TypeError, AttributeError):
        return None
