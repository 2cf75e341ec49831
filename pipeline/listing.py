"""What there is, and the manual of each stage and device."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from pathlib import Path

from pipeline.catalog import Catalog, Entry
from pipeline.config import options
from pipeline.errors import InputError, PipelineError, nearest
from pipeline.runs import MANIFEST, open_run
from pipeline.source import REQUIRED, Sources


def _experiments() -> Iterator[tuple[str, str]]:
    for name, path in options("experiment").items():
        yield name, _first_comment(path)


def _rigs() -> Iterator[tuple[str, str]]:
    for name, path in options("rig").items():
        yield name, _first_comment(path)


def _stages() -> Iterator[tuple[str, str]]:
    for name, entry in sorted(Catalog(Sources()).stages.items()):
        yield name, entry.summary


def _devices() -> Iterator[tuple[str, str]]:
    for name, entry in sorted(Catalog(Sources()).devices.items()):
        if not entry.module.endswith(".protocols") and not entry.signature.fault:
            yield name, entry.summary


def _runs() -> Iterator[tuple[str, str]]:
    for path in sorted(Path("runs").glob(f"*/*/{MANIFEST}")):
        try:
            run = open_run(path.parent)
        except PipelineError as error:
            yield str(path.parent), f"cannot be read: {error}"
            continue
        yield str(path.parent), f"{run.finished}  {' '.join(o for o in run.overrides if 'experiment=' not in o)}"


LISTS: dict[str, Callable[[], Iterator[tuple[str, str]]]] = {
    "experiments": _experiments,
    "rigs": _rigs,
    "stages": _stages,
    "devices": _devices,
    "runs": _runs,
}


def manual(name: str) -> str:
    """The manual of a stage or device: signature as YAML sees it, and its docstring.

    Raises
    ------
    InputError
        There is no stage and no device of that name.
    """
    catalog = Catalog(Sources())
    everything = {**catalog.devices, **catalog.stages}
    if name not in everything:
        raise InputError(f"there is no stage or device '{name}'", where="command line", hint=nearest(name, everything))
    entry = everything[name]
    kind = "device" if entry.signature.is_class else "stage"
    lines = [f"{kind} {name}  ({entry.module})", "", inspect.cleandoc(entry.signature.doc), ""]
    lines += _table("inputs", entry, settings=False) + _table("settings", entry, settings=True)
    if kind == "stage":
        lines += [f"gives {entry.type}"]
    return "\n".join(lines)


def _table(title: str, entry: Entry, *, settings: bool) -> list[str]:
    if entry.signature.is_class:
        rows = {**entry.inputs, **entry.settings} if settings else {}
    else:
        rows = entry.settings if settings else entry.inputs
    if not rows:
        return []
    lines = [f"{title}:"]
    for name, (parameter, annotation) in rows.items():
        default = "" if parameter.default == REQUIRED else f" = {_yaml(parameter.default)}"
        lines.append(f"  {name}: {annotation}{default}")
    return [*lines, ""]


def _yaml(value: object) -> str:
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else repr(value)


def _first_comment(path: Path) -> str:
    first = path.read_text().split("\n", 1)[0]
    if first.startswith("# @package"):
        first = next((line for line in path.read_text().splitlines()[1:] if line.startswith("#")), "")
    return first.lstrip("# ")
