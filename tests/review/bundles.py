"""Bundles of the toys, and ways to spoil them."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pipeline.storage.sealed import unsealed

Entries = dict[str, bytes]


def entries_of(file: Path) -> Entries:
    with zipfile.ZipFile(file) as bundle:
        return {name: bundle.read(name) for name in bundle.namelist()}


def write_entries(file: Path, entries: Entries) -> Path:
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as bundle:
        for name, data in entries.items():
            bundle.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return file


def changed(file: Path, change: Callable[[Entries], Any]) -> Path:
    """A copy of a bundle with other entries."""
    entries = entries_of(file)
    change(entries)
    return write_entries(file.with_name("spoiled.zip"), entries)


def change_json(entries: Entries, name: str, change: Callable[[dict[str, Any]], Any]) -> None:
    content = unsealed(entries[name])
    change(content)
    entries[name] = json.dumps(content).encode()


def tree(folder: Path) -> dict[str, bytes | None]:
    """Everything below a folder, to see that nothing was written."""
    return {str(p.relative_to(folder)): p.read_bytes() if p.is_file() else None for p in sorted(folder.rglob("*"))}


def first_recipe(entries: Entries) -> str:
    """Name of the first record."""
    return next(name for name in sorted(entries) if "/recipes/" in name)
