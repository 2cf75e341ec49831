"""JSON that somebody else wrote, checked against the form that ours has before it is believed."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.storage.sealed import unsealed

MOST_JSON_BYTES = 64 * 2**20
MOST_YAML_CHARACTERS = 2**20
DEEPEST = 64
"""How deep JSON or YAML may be nested."""

DIGEST = re.compile(r"[0-9a-f]{40}")
NAME = re.compile(r"[^\W\d]\w*")
EXPERIMENT = re.compile(r"\w[\w.+-]*")


def read_json(path: Path, most: int = MOST_JSON_BYTES) -> dict[str, Any]:
    """The object that a JSON file holds, without its seal.

    Raises
    ------
    OSError
        It cannot be read.
    InputError
        It is no JSON object, not what was sealed, or larger or deeper than anything of ours.
    """
    if path.stat().st_size > most:
        raise InputError(f"{path.name} has {path.stat().st_size} bytes", where=str(path), expected=f"at most {most}")
    try:
        content = unsealed(path.read_bytes())
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path.name} cannot be read: {error}", where=str(path)) from None
    if _depth(content) > DEEPEST:
        raise InputError(f"{path.name} is nested deeper than {DEEPEST}", where=str(path))
    return content


def plain_yaml(text: str, where: Path | str) -> Any:
    """What a YAML text holds, where it is as plain as ours: an alias that names another could grow without end.

    Raises
    ------
    InputError
        It is no YAML, not plain, or larger than anything of ours.
    """
    import yaml

    try:
        if len(text) > MOST_YAML_CHARACTERS or any(isinstance(e, yaml.AliasEvent) for e in yaml.parse(text)):
            raise InputError("this YAML is larger than a run's configuration, or has aliases", where=str(where))
        content = yaml.safe_load(text)
    except (yaml.YAMLError, RecursionError, ValueError) as error:
        raise InputError(f"this is no YAML: {' '.join(str(error).split())}", where=str(where)) from None
    if not isinstance(content, dict) or _depth(content) > DEEPEST:
        raise InputError("this YAML holds no configuration", where=str(where))
    return content


class Form:
    """Checks plain values against a form, as JSON brings them.

    A form is a type, a pattern for text, a list of one form, a mapping from ``"*"`` to the form of all members, a
    mapping of names to forms (a name that ends in ``?`` may be missing), or a tuple of alternatives.
    """

    def __init__(self, form: Any, what: str) -> None:
        self.form = form
        self.what = what

    def check(self, value: Any, where: Path | str) -> None:
        """Accept a value.

        Raises
        ------
        InputError
            It has another form; says at which place.
        """
        wrong = _misfit(value, self.form, "")
        if wrong is not None:
            raise InputError(
                f"{self.what} has a wrong '{wrong}'" if wrong else f"this is no {self.what}", where=str(where)
            )


def _misfit(value: Any, form: Any, path: str) -> str | None:
    """Path of the first part that does not fit, or None."""
    if isinstance(form, tuple):
        return None if any(_misfit(value, one, path) is None for one in form) else path
    if isinstance(form, re.Pattern):
        return None if isinstance(value, str) and form.fullmatch(value) else path
    if form is None or isinstance(form, type):
        return None if _is(value, form) else path
    if isinstance(form, list):
        if not isinstance(value, list):
            return path
        return next((w for i, v in enumerate(value) if (w := _misfit(v, form[0], f"{path}[{i}]")) is not None), None)
    if not isinstance(value, dict):
        return path
    if "*" in form:
        pairs = [(name, form["*"]) for name in value]
    else:
        pairs = [(n.rstrip("?"), f) for n, f in form.items() if not n.endswith("?") or n.rstrip("?") in value]
    for name, inner in pairs:
        place = f"{path}.{name}".lstrip(".") if name.isprintable() else path
        wrong = place if name not in value else _misfit(value[name], inner, place)
        if wrong is not None:
            return wrong
    return None


def _is(value: Any, kind: type | None) -> bool:
    if kind is None:
        return value is None
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(value, kind) and (kind is bool or not isinstance(value, bool))


_MAYBE_DIGEST = (re.compile(""), DIGEST)
_MAYBE_NUMBER = (float, None)
_TEXTS = {"*": str}

_NODE = {
    "name": NAME,
    "stage": re.compile(r"[\w.]*"),
    "summary": str,
    "status": re.compile("ran|cached|failed|blocked|absent"),
    "inputs": {"*": [NAME]},
    "settings": dict,
    "written": [str],
    "type": re.compile(r"\w*"),
    "key": _MAYBE_DIGEST,
    "artifact": _MAYBE_DIGEST,
    "seconds": _MAYBE_NUMBER,
    "cpu_seconds": _MAYBE_NUMBER,
    "peak_mb": _MAYBE_NUMBER,
    "host": str,
    "finished": str,
    "warnings": [str],
    "notes": [str],
    "reason": str,
    "error": str,
    "blocked_by": [NAME],
}

_MANIFEST = Form(
    {
        "experiment": EXPERIMENT,
        "digest": re.compile(r"[0-9a-f]{4,40}"),
        "command": str,
        "overrides": [str],
        "description": str,
        "metrics": {"*": float},
        "versions": _TEXTS,
        "commit": str,
        "host": str,
        "finished": str,
        "total_seconds": float,
        "store": str,
        "store_from_here?": str,
        "nodes": [_NODE],
        "raw?": dict,
        "environment?": _MAYBE_DIGEST,
        "claims?": _MAYBE_DIGEST,
    },
    "manifest",
)

_RECORD = Form(
    {
        "key": DIGEST,
        "artifact": DIGEST,
        "type": re.compile(r"\w+"),
        "stage": re.compile(r"[\w.]+"),
        "code": _MAYBE_DIGEST,
        "settings": dict,
        "inputs": {"*": (None, DIGEST, [DIGEST])},
        "seconds": float,
        "cpu_seconds": float,
        "peak_mb": float,
        "host": str,
        "finished": str,
        "commit": str,
        "versions": _MAYBE_DIGEST,
        "warnings": [str],
        "notes": [str],
        "captured": bool,
    },
    "record",
)


def check_manifest(content: Any, where: Path | str) -> None:
    """Accept a run's manifest.

    Raises
    ------
    InputError
        It is none.
    """
    _MANIFEST.check(content, where)


def check_record(content: Any, where: Path | str) -> None:
    """Accept the record of a recipe.

    Raises
    ------
    InputError
        It is none.
    """
    _RECORD.check(content, where)


def _depth(value: Any) -> int:
    deepest, waiting = 0, [(value, 1)]
    while waiting:
        item, depth = waiting.pop()
        deepest = max(deepest, depth)
        if isinstance(item, dict | list):
            waiting += [(inner, depth + 1) for inner in (item.values() if isinstance(item, dict) else item)]
    return deepest
