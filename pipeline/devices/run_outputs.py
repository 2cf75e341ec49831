"""The maps that another experiment's run left in its folder."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pipeline.errors import InputError, nearest

MANIFEST = "manifest.json"


def output_of(folder: Path, kind: str, node: str, usual: str) -> tuple[Path, str]:
    """The EXR file of a node of a run, and the node's name.

    Parameters
    ----------
    folder : Path
        The run's, such as ``runs/polarization_logo/3f2a91c0``.
    kind : str
        Name of the class of its value.
    node : str
        Which; empty: the last of that kind, which no other of that kind was made from, or ``usual`` where there are
        several.
    usual : str
        Name of the node that most experiments give such a value.

    Raises
    ------
    InputError
        There is no run, no such node or value in it, or several and nothing says which.
    """
    nodes = _nodes(folder)
    of_kind = {name: entry for name, entry in nodes.items() if entry["type"] == kind and entry["artifact"]}
    if node and node not in nodes:
        raise InputError(f"the run has no node '{node}'", where=str(folder), hint=nearest(node, of_kind or nodes))
    chosen = node or _last(of_kind, usual, folder, kind)
    file = folder / "outputs" / f"{chosen}.exr"
    if not file.is_file():
        what = f"the run has no {file.relative_to(folder)}"
        right = f"a node that gives a map: {', '.join(of_kind) or 'it has none'}"
        raise InputError(what, where=str(folder), expected=right, hint="running it again writes what is missing")
    return file, chosen


def _nodes(folder: Path) -> dict[str, dict[str, Any]]:
    try:
        listed = json.loads((folder / MANIFEST).read_text())["nodes"]
        nodes = {str(entry["name"]): entry for entry in listed}
        for name, entry in nodes.items():
            if not name.isidentifier():
                raise ValueError(name)
            entry["type"], entry["artifact"], entry["inputs"] = entry["type"], entry["artifact"], dict(entry["inputs"])
    except FileNotFoundError:
        right = "a file, or the folder of a run such as runs/polarization_logo/3f2a91c0"
        raise InputError(
            f"there is no run in {folder.name}: it has no {MANIFEST}", where=str(folder), expected=right
        ) from None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{MANIFEST} cannot be read: {error!r}", where=str(folder)) from None
    return nodes


def _last(of_kind: dict[str, dict[str, Any]], usual: str, folder: Path, kind: str) -> str:
    used = {name for entry in of_kind.values() for names in entry["inputs"].values() for name in names}
    last = [name for name in of_kind if name not in used]
    if len(last) == 1:
        return last[0]
    if usual in of_kind:
        return usual
    if not last:
        raise InputError(f"the run has no {kind}", where=str(folder), expected="a run that fits or draws one")
    raise InputError(
        f"several nodes of the run give a {kind}", where="node", expected="the name of one: " + ", ".join(last)
    )
