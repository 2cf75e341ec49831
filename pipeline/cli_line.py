"""A command line taken apart."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from pipeline.errors import InputError, nearest


@dataclass(frozen=True)
class Line:
    """A command line taken apart.

    Attributes
    ----------
    words : tuple of str
        What is left: overrides, names, files.
    quiet, multirun, json : bool
        Options.
    folders : tuple of Path
        Folders of YAML files besides ours.
    limit_gb : float or None
        What a bundle may unpack to.
    port : int or None
        Where to serve.
    """

    words: tuple[str, ...]
    quiet: bool = False
    multirun: bool = False
    folders: tuple[Path, ...] = ()
    json: bool = False
    limit_gb: float | None = None
    port: int | None = None


def taken_apart(arguments: Sequence[str]) -> Line:
    """Options and words of a command line.

    Raises
    ------
    InputError
        An option is unknown or lacks its value, or there is no word.
    """
    words: list[str] = []
    folders: list[Path] = []
    flags: set[str] = set()
    limit_gb = port = None
    waiting = list(arguments)
    while waiting:
        word = waiting.pop(0)
        if word in {"-q", "--quiet", "-m", "--multirun"}:
            flags.add(word.lstrip("-")[0])
        elif word == "--config-dir" or word.startswith("--config-dir="):
            folder = word.partition("=")[2] or (waiting.pop(0) if waiting else "")
            if not folder:
                raise InputError("--config-dir names no folder", where="command line", expected="--config-dir DIR")
            folders.append(Path(folder))
        elif word == "--json":
            flags.add("json")
        elif word == "--limit-gb" or word.startswith("--limit-gb="):
            limit_gb = _limit(word.partition("=")[2] or (waiting.pop(0) if waiting else ""))
        elif word == "--port" or word.startswith("--port="):
            port = _port(word.partition("=")[2] or (waiting.pop(0) if waiting else ""))
        elif word.startswith("-"):
            known = ["--quiet", "--help", "--multirun", "--config-dir", "--version", "--json", "--limit-gb", "--port"]
            raise InputError(f"there is no option '{word}'", where="command line", hint=nearest(word, known))
        else:
            words.append(word)
    if not words:
        raise InputError("nothing is asked for", where="command line", expected="see python -m pipeline --help")
    return Line(tuple(words), "q" in flags, "m" in flags, tuple(folders), "json" in flags, limit_gb, port)


def _limit(text: str) -> float:
    try:
        if (limit := float(text)) > 0:
            return limit
    except ValueError:
        pass
    raise InputError(f"--limit-gb is {text!r}", where="command line", expected="a number of GB")


def _port(text: str) -> int:
    if text.isdecimal() and int(text) < 65536:
        return int(text)
    raise InputError(f"--port is {text!r}", where="command line", expected="0 to 65535")


def is_override(word: str) -> bool:
    """Whether a word sets something, or takes it away."""
    return "=" in word or word.startswith("~")


def check_overrides(line: Line, commands: Iterable[str]) -> None:
    """Refuse words that set nothing.

    Raises
    ------
    InputError
        The first such word, with the nearest command.
    """
    from pipeline.graph.config import options

    for word in line.words:
        if not is_override(word):
            experiments = options("experiment", line.folders)
            raise InputError(
                f"'{word}' is neither a command nor SETTING=VALUE",
                where="command line",
                expected="see python -m pipeline --help",
                hint=f"did you mean '+experiment={word}'?" if word in experiments else nearest(word, commands),
            )
