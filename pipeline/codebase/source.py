"""What the source code says, read without running it: signatures, imports, and a digest that ignores prose.

A module is known by its syntax tree without comments and docstrings. A stage's code is its module and every module of
ours that this one imports, directly or not, so that an edit to a helper counts and a reworded docstring does not.
"""

from __future__ import annotations

import importlib.util
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

from pipeline.codebase.syntax import Parameter, Signature, parse
from pipeline.errors import InputError
from pipeline.storage.files import settled, stamp
from pipeline.storage.keys import digest, digest_bytes
from pipeline.storage.sealed import sealed, unsealed

ROOT = "pipeline"
DATA_SUFFIXES = (".csv", ".dat", ".eds", ".h5", ".json", ".npy", ".npz", ".toml", ".txt", ".xml", ".yaml", ".zip")
_CACHE_FORMAT = 7


@dataclass(frozen=True)
class ModuleSource:
    """What one source file says."""

    name: str
    path: Path
    text_digest: str
    code_digest: str
    imports: tuple[str, ...]
    names: dict[str, str]
    signatures: dict[str, Signature]


def declared(group: str) -> list[str]:
    """Packages that installed distributions declare under an entry-point group."""
    return list(_declared(group, tuple(sys.path)))


@cache
def _declared(group: str, places: tuple[str, ...]) -> list[str]:
    """The same, found once for each list of places where Python looks for packages."""
    return sorted({point.value for point in entry_points(group=group)} - {group})


@dataclass(frozen=True)
class Code:
    """The code that a stage stands on.

    Attributes
    ----------
    modules : dict of str to (str, str)
        Per module, the digest of its code and that of its text with comments and docstrings.
    digest : str
        Digest of the code alone, which enters recipe keys.
    listing : str
        Digest of ``modules``, which records refer to.
    """

    modules: Mapping[str, tuple[str, str]]
    digest: str
    listing: str


class Sources:
    """Reads modules of ours; remembers by the digest of their text what parsing them gave.

    Parameters
    ----------
    memory : Path, optional
        File that keeps what was parsed for the next process.
    """

    def __init__(self, memory: Path | None = None) -> None:
        self._memory = memory
        self._modules: dict[str, ModuleSource | None] = {}
        self._codes: dict[frozenset[str], Code] = {}
        self._fresh = False
        self._parsed, self._stamps = _remembered(memory)

    @cached_property
    def packages(self) -> dict[str, Path]:
        """Folders of the packages whose code is ours: this one, and those that offer stages or devices."""
        names = {ROOT}
        for group in ("pipeline.stages", "pipeline.devices"):
            names |= {package.split(".")[0] for package in declared(group)}
        found = {}
        for name in sorted(names):
            spec = importlib.util.find_spec(name)
            if spec is not None and spec.submodule_search_locations:
                found[name] = Path(next(iter(spec.submodule_search_locations)))
        return found

    def file_of(self, module: str) -> Path | None:
        """Source file of a module of ours, or None."""
        root, *rest = module.split(".")
        folder = self.packages.get(root)
        if folder is None:
            return None
        base = folder.joinpath(*rest)
        for path in (base / "__init__.py", base.with_name(base.name + ".py")):
            if path.is_file():
                return path
        return None

    def folder_of(self, package: str) -> Path | None:
        """Folder of a package of ours, whether or not it has an ``__init__.py``, or None."""
        root, *rest = package.split(".")
        folder = self.packages.get(root)
        found = folder.joinpath(*rest) if folder else None
        return found if found is not None and found.is_dir() else None

    def module(self, name: str) -> ModuleSource | None:
        """What the module's file says, or None where there is no such module of ours."""
        if name not in self._modules:
            path = self.file_of(name)
            self._modules[name] = None if path is None else self._read(name, path)
        return self._modules[name]

    def modules_in(self, package: str) -> Iterator[ModuleSource]:
        """The modules directly inside a package, by name; those whose names begin with an underscore are its own."""
        folder = self.folder_of(package)
        if folder is None:
            return
        for file in sorted(folder.glob("*.py")):
            if not file.name.startswith("_") and (module := self.module(f"{package}.{file.stem}")):
                yield module

    def subpackages(self, package: str) -> Iterator[str]:
        """Names of the packages directly inside a package."""
        parent = self.folder_of(package)
        if parent is not None:
            for folder in sorted(parent.iterdir()):
                if folder.is_dir() and not folder.name.startswith(("_", ".")):
                    yield f"{package}.{folder.name}"

    def closure(self, names: Iterable[str]) -> dict[str, ModuleSource]:
        """The named modules and all modules of ours that they import, directly or not, sorted by name."""
        found: dict[str, ModuleSource] = {}
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name in found or name == ROOT:
                continue
            module = self.module(name)
            if module is None:
                continue
            found[name] = module
            waiting += module.imports
            waiting.append(name.rpartition(".")[0])
        return dict(sorted(found.items()))

    def code(self, modules: frozenset[str]) -> Code:
        """The code of the named modules and of all that they import."""
        if modules not in self._codes:
            pairs = {name: (m.code_digest, m.text_digest) for name, m in self.closure(modules).items()}
            self._codes[modules] = Code(pairs, digest({name: code for name, (code, _) in pairs.items()}), digest(pairs))
        return self._codes[modules]

    def remember(self) -> None:
        """Keep what was parsed for the next process."""
        if self._memory is None or not self._fresh:
            return
        from pipeline.storage.files import write_text

        current = {m.text_digest + " " + m.name for m in self._modules.values() if m}
        kept = {key: value for key, value in self._parsed.items() if key in current}
        content = {"format": _CACHE_FORMAT, "modules": kept, "stamps": self._stamps}
        write_text(self._memory, sealed(json.dumps(content)))
        self._fresh = False

    def _read(self, name: str, path: Path) -> ModuleSource:
        beside = sorted(companions(path))
        files = [str(p) for p in (path, *beside)]
        stamps = [stamp(p) for p in (path, *beside)]
        known = self._stamps.get(name)
        if known is not None and known[0] == [files, stamps] and known[1] in self._parsed:
            key, code_digest = known[1], known[2]
        else:
            text = path.read_bytes()
            key = f"{digest_bytes(text)} {name}"
            if key not in self._parsed:
                try:
                    self._parsed[key] = parse(name, text, is_package=path.name == "__init__.py")
                except (SyntaxError, ValueError) as error:
                    line = getattr(error, "lineno", None)
                    raise InputError(
                        f"a file of code cannot be read: {getattr(error, 'msg', error)}",
                        where=f"{path}, line {line}" if line else str(path),
                        expected="Python",
                    ) from None
            code_digest = self._parsed[key]["code_digest"]
            for companion in beside:
                code_digest = digest_bytes(f"{code_digest} {companion.name} ".encode() + companion.read_bytes())
            if settled(stamps):
                self._stamps[name] = [[files, stamps], key, code_digest]
            self._fresh = True
        parsed = self._parsed[key]
        return ModuleSource(
            name=name,
            path=path,
            text_digest=key.partition(" ")[0],
            code_digest=code_digest,
            imports=tuple(parsed["imports"]),
            names=parsed["names"],
            signatures={
                entry["name"]: Signature(**{**entry, "parameters": tuple(Parameter(**p) for p in entry["parameters"])})
                for entry in parsed["signatures"]
            },
        )


def companions(path: Path) -> list[Path]:
    """Data files that belong to a module: those with its stem and a suffix of data."""
    beside = (path.with_suffix(suffix) for suffix in DATA_SUFFIXES)
    return [file for file in beside if file.is_file()]


def _remembered(memory: Path | None) -> tuple[dict[str, dict[str, Any]], dict[str, list[Any]]]:
    if memory is None:
        return {}, {}
    try:
        content = unsealed(memory.read_bytes())
        if content["format"] != _CACHE_FORMAT:
            return {}, {}
        return content["modules"], content["stamps"]
    except (OSError, ValueError, KeyError):
        return {}, {}
