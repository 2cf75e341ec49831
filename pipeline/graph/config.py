"""An experiment's configuration, with the place that every value came from, and where configurations lie."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import yaml

LOCAL_SECTIONS = ("paths", "executor", "recapture", "from", "force", "objective", "tradeoff", "maps")
"""Sections that say where and how one machine carries out an experiment and charts a sweep, not what comes out."""


@dataclass(frozen=True)
class Override:
    """One override of the command line: ``graph.fit.prenormalize=false``."""

    text: str
    path: str
    removes: bool = False


@dataclass(frozen=True)
class Configuration:
    """A composed experiment.

    Attributes
    ----------
    experiment : str
        Name of the experiment.
    content : dict
        Everything, resolved to plain values; missing values are the text ``???``.
    raw : dict
        The same before interpolation.
    overrides : tuple of Override
        What the command line changed.
    files : tuple of (Path, str)
        The YAML files it was composed of, later ones winning, and the section that each fills.
    folders : tuple of Path
        Folders of YAML files besides ours.
    words : tuple of str
        The command line, as it was written.
    sweeps : bool
        Whether it asks for a sweep of itself (``hydra.mode: MULTIRUN``).
    memory : Path or None
        File in which the composition may be remembered; None where it may not, or is.
    origin : str
        The bundle or run that it was taken from, instead of YAML files.
    """

    experiment: str
    content: dict[str, Any]
    raw: dict[str, Any]
    overrides: tuple[Override, ...]
    files: tuple[tuple[Path, str], ...]
    folders: tuple[Path, ...] = ()
    words: tuple[str, ...] = ()
    sweeps: bool = False
    memory: Path | None = field(default=None, compare=False, repr=False)
    origin: str = ""
    _trees: dict[Path, yaml.Node | None] = field(default_factory=dict, compare=False, repr=False)

    def written_by_override(self, path: str) -> bool:
        """Whether the command line wrote the value at a dotted path, or something inside it."""
        return any(o.path == path or o.path.startswith(path + ".") for o in self.overrides if not o.removes)

    def where(self, path: str) -> str:
        """Where a value was written, for people: the override, or file, line and YAML path."""
        path = self.followed(path)
        for override in reversed(self.overrides):
            if override.path and (path == override.path or path.startswith(override.path + ".")):
                return f"override {override.text}"
        for file, section in reversed(self.files):
            line = self._line(file, section, path)
            if line is not None:
                return f"{shown(file)}, line {line}: {path}"
        parent = path.rpartition(".")[0]
        if parent:
            return self.where(parent) + f" (for {path})"
        return f"{self.origin}: {path}" if self.origin else path

    def remark(self, path: str) -> str:
        """The comment behind a value in its YAML file, as a hint; empty where there is none."""
        path = self.followed(path)
        for file, section in reversed(self.files):
            line = self._line(file, section, path)
            if line is not None:
                return file.read_text().splitlines()[line - 1].partition(" # ")[2].strip()
        return ""

    def override_inside(self, path: str) -> str:
        """The override that wrote the value at a path, or something inside it."""
        found = [o for o in self.overrides if f"{o.path}.".startswith(f"{path}.") and not o.removes]
        return f"override {found[-1].text}" if found else self.where(path)

    def followed(self, path: str) -> str:
        """The path that an interpolation such as ``${rig}`` on the way leads to."""
        node: Any = self.raw
        parts = path.split(".")
        for index, part in enumerate(parts):
            if not isinstance(node, dict) or part not in node:
                break
            node = node[part]
            if isinstance(node, str) and (match := re.fullmatch(r"\$\{([\w.]+)\}", node)):
                return self.followed(".".join([match[1], *parts[index + 1 :]]))
        return path

    def _line(self, file: Path, section: str, path: str) -> int | None:
        import yaml

        if section and not (path == section or path.startswith(section + ".")):
            return None
        inner = path[len(section) :].lstrip(".") if section else path
        if file not in self._trees:
            self._trees[file] = yaml.compose(file.read_text(), Loader=yaml.SafeLoader)
        node: Any = self._trees[file]
        line = 1 if not inner else None
        for part in inner.split(".") if inner else ():
            if not hasattr(node, "value") or not isinstance(node.value, list):
                return None
            for key, value in (pair for pair in node.value if isinstance(pair, tuple)):
                if key.value == part:
                    node, line = value, key.start_mark.line + 1
                    break
            else:
                return None
        return line


def configs_folder() -> Path:
    """Folder of the YAML files: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parents[1]
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def options(group: str, folders: Sequence[Path] = ()) -> dict[str, Path]:
    """Names and files in a config group."""
    found: dict[str, Path] = {}
    for folder in reversed((configs_folder(), *folders)):
        found |= {path.stem: path for path in (folder / group).glob("*.yaml")}
    return dict(sorted(found.items()))


def option_file(group: str, name: str, folders: Sequence[Path] = ()) -> Path | None:
    """The YAML file of an option, the first that is found."""
    return options(group, folders).get(name)


def groups(folders: Sequence[Path] = ()) -> set[str]:
    """Names of the config groups."""
    found: set[str] = set()
    for folder in (configs_folder(), *folders):
        found |= {path.name for path in folder.iterdir() if path.is_dir()}
    return found


def shown(path: Path) -> str:
    """A path as people read it: relative to where they are, if it lies below."""
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
