"""What can go from a store: all that no run in the runs' folder needs."""

from __future__ import annotations

import shutil
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.errors import InputError
from pipeline.runs import MANIFEST, open_run
from pipeline.storage.locks import alone
from pipeline.storage.store import Store


@dataclass(frozen=True)
class Waste:
    """What no kept run needs.

    Attributes
    ----------
    paths : dict of Path to str
        Folders and files, and why each can go.
    size : dict of Path to int
        Bytes of each.
    kept_runs : int
        Runs whose values stay.
    captures : tuple of Path
        Photographs of captures that failed half way; these are never removed.
    """

    paths: dict[Path, str] = field(default_factory=dict)
    size: dict[Path, int] = field(default_factory=dict)
    kept_runs: int = 0
    captures: tuple[Path, ...] = ()

    @property
    def bytes(self) -> int:
        """Bytes of all."""
        return sum(self.size.values())


def find_waste(runs: Path, store: Store) -> Waste:
    """Find what can go from a store: values and recipes that no run needs, damaged and half-written ones.

    Parameters
    ----------
    runs : Path
        Folder of the runs that are kept; deleting a run's folder gives up its values.
    store : Store
        The store.

    Raises
    ------
    PipelineError
        A run's manifest cannot be read, so that what it needs is not known.
    """
    keys: set[str] = set()
    artifacts: set[str] = set()
    listings: set[str] = set()
    kept = 0
    for manifest in sorted(runs.glob(f"*/*/{MANIFEST}")):
        run = open_run(manifest.parent)
        kept += 1
        listings.add(run.environment)
        for node in run.nodes.values():
            keys.add(node.key)
            artifacts.add(node.artifact)
            if node.key and (claimed := run.store.record(node.key)) is not None:
                listings |= {claimed.code, claimed.versions}
    sources = _captured(store, keys)
    keys |= set(sources)
    artifacts |= set(sources.values())
    listings |= {name for key in keys if (r := store.record(key)) for name in (r.code, r.versions)}
    waste = Waste(kept_runs=kept, captures=tuple(sorted((store.root / "captures").glob("*"))))
    for path in _children(store.root / "objects"):
        if path.name.startswith("."):
            _add(waste, path, "half-written")
        for folder in _children(path):
            if folder.name not in artifacts:
                _add(waste, folder, "needed by no run")
    for path in (store.root / "recipes").glob("*/*"):
        if path.suffix != ".json":
            _add(waste, path, "half-written")
        elif path.stem not in keys:
            _add(waste, path, "needed by no run")
    for path in _children(store.root / "damaged"):
        _add(waste, path, "damaged")
    for path in _children(store.root / "provenance"):
        if path.stem not in listings:
            _add(waste, path, "needed by no run")
    return waste


def remove(runs: Path, store: Store) -> Waste:
    """Remove what can go, while nobody uses the store.

    Raises
    ------
    InputError
        A run is going on.
    """
    try:
        with alone(store.root / "in-use", wait=False):
            waste = find_waste(runs, store)
            for path in waste.paths:
                if path.is_dir():
                    shutil.rmtree(path, ignore_errors=True)
                else:
                    path.unlink(missing_ok=True)
            return waste
    except BlockingIOError:
        raise InputError(
            f"the store {store.root} is in use", expected="no run going on while its store is cleaned"
        ) from None


def _captured(store: Store, keys: set[str]) -> dict[str, str]:
    """Other recipes than these whose values real devices captured: they stay, since they cannot be computed again."""
    others = (path.stem for path in (store.root / "recipes").glob("*/*.json") if path.stem not in keys)
    records = (store.record(key) for key in others)
    return {record.key: record.artifact for record in records if record is not None and record.captured}


def _add(waste: Waste, path: Path, why: str) -> None:
    waste.paths[path] = why
    waste.size[path] = _bytes(path)


def _bytes(path: Path) -> int:
    files: Iterable[Path] = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in files if file.is_file())


def _children(folder: Path) -> Iterator[Path]:
    return iter(sorted(folder.iterdir())) if folder.is_dir() else iter(())
