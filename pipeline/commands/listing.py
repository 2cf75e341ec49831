"""What there is, and the manual of each stage and device."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from pipeline.codebase.source import Sources
from pipeline.codebase.syntax import REQUIRED
from pipeline.errors import InputError, PipelineError, nearest
from pipeline.graph.catalog import Catalog, Entry, is_device
from pipeline.graph.config import options
from pipeline.runs import MANIFEST, open_run

Rows = Iterator[tuple[str, str]]


@dataclass(frozen=True)
class Places:
    """Where to look: folders of YAML files besides ours, and the folder of the runs."""

    folders: Sequence[Path] = ()
    runs: Path = Path("runs")


def _options(group: str, places: Places) -> Rows:
    for name, path in options(group, places.folders).items():
        yield name, _first_comment(path)


def _stages(places: Places) -> Rows:
    for name, entry in sorted(Catalog(Sources()).stages.items()):
        yield name, entry.summary


def _devices(places: Places) -> Rows:
    for name, entry in sorted(Catalog(Sources()).devices.items()):
        if is_device(entry) and not entry.signature.fault:
            yield name, entry.summary


def _runs(places: Places) -> Rows:
    """Runs, the latest first, with their state and what was set."""
    found = []
    for path in places.runs.glob(f"*/*/{MANIFEST}"):
        try:
            run = open_run(path.parent)
        except PipelineError as error:
            found.append(("", str(path.parent), f"cannot be read: {error}"))
            continue
        words = " ".join(o for o in run.overrides if not o.startswith("experiment="))
        state = "failed" if run.failed else "done"
        found.append((run.finished, str(path.parent), f"{run.finished}  {state:<6}  {words}"))
    for _, path_text, line in sorted(found, reverse=True):
        yield path_text, line


LISTS: dict[str, Callable[[Places], Rows]] = {
    "experiments": partial(_options, "experiment"),
    "maps": partial(_options, "maps"),
    "surfaces": partial(_options, "surface"),
    "rigs": partial(_options, "rig"),
    "executors": partial(_options, "executor"),
    "stages": _stages,
    "devices": _devices,
    "runs": _runs,
}


def manual(name: str, places: Places | None = None) -> str:
    """The manual of a stage or device, or the YAML of an experiment, of maps, a surface, a rig or an executor.

    Raises
    ------
    InputError
        There is nothing of that name.
    """
    places = places or Places()
    catalog = Catalog(Sources())
    everything = {**catalog.devices, **catalog.stages}
    files: dict[str, Path] = {}
    for group in ("executor", "rig", "maps", "surface", "experiment"):
        files |= options(group, places.folders)
    if name not in everything and name in files:
        return f"# {files[name]}\n{files[name].read_text().rstrip()}"
    if name not in everything:
        raise InputError(
            f"there is no stage, device, experiment, maps, surface or rig '{name}'",
            where="command line",
            hint=nearest(name, [*(n for n, e in everything.items() if not e.module.endswith(".protocols")), *files]),
        )
    entry = everything[name]
    if entry.signature.fault:
        raise InputError(f"'{name}' cannot be used: {entry.signature.fault}", where=f"{entry.module}.py")
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
