"""Files a person opens, kept as new as the values of the run: what was written, and what has to be written again."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from pipeline.errors import PipelineError
from pipeline.parallel import threads
from pipeline.report import FORMAT, RECORD, is_current
from pipeline.report.naming import labelled
from pipeline.report.pictures import Figure
from pipeline.report.svg import standalone
from pipeline.report.view import RunView
from pipeline.report.writers import WRITERS
from pipeline.storage.files import write_text

CHARTS = ".charts.json"


def write_values(run: RunView) -> list[Path]:
    """Write every value that has a form for people into ``outputs/``, and return all files that lie there.

    A file is written only if it is missing or its value changed since, and removed when its value is no longer of the
    run or cannot be read; files that a person put there are left alone.

    Raises
    ------
    PipelineError
        A file cannot be written.
    """
    folder = run.path / "outputs"
    before = _record(folder)
    with ThreadPoolExecutor(threads()) as pool:
        entries = pool.map(lambda name: _entry(run, name, folder, before.get(name)), run.nodes)
        now = {name: entry for name, entry in zip(run.nodes, entries, strict=True) if entry}
    kept = {file for entry in now.values() for file in entry["files"]}
    for file in {file for entry in before.values() for file in entry["files"]} - kept:
        (folder / file).unlink(missing_ok=True)
    if now != before or not is_current(run.path):
        write_text(folder / RECORD, json.dumps({"format": FORMAT, "nodes": now}, indent=1))
    return [*(folder / file for entry in now.values() for file in entry["files"]), _write_metrics(folder, run)]


def write_charts(folder: Path, figures: Mapping[str, Sequence[Figure]]) -> list[Path]:
    """Write the charts among the figures of each node as ``NODE_TITLE.svg``, with axes, colour bars and a white ground.

    Charts that an earlier report wrote and that are no longer there are removed.

    Raises
    ------
    PipelineError
        A file cannot be written.
    """
    drawn = {
        f"{_plain(name)}_{_plain(figure.title)}.svg": standalone(figure.body)
        for name, of_node in figures.items()
        for figure in of_node
    }
    charts = {file: text for file, text in drawn.items() if text is not None}
    try:
        for file in set(_charts(folder)) - set(charts):
            (folder / file).unlink(missing_ok=True)
        for file, text in charts.items():
            write_text(folder / file, text)
        write_text(folder / CHARTS, json.dumps(sorted(charts)))
    except OSError as error:
        raise PipelineError(f"{folder} cannot be written: {error.strerror}") from None
    return [folder / file for file in charts]


def _charts(folder: Path) -> list[str]:
    """Charts of an earlier report."""
    try:
        return [str(file) for file in json.loads((folder / CHARTS).read_text()) if "/" not in str(file)]
    except (OSError, ValueError, TypeError):
        return []


def _entry(run: RunView, name: str, folder: Path, known: Mapping[str, Any] | None) -> Mapping[str, Any] | None:
    """Write the files of a node where they do not lie there already, and say which they are."""
    node = run.nodes[name]
    writer = WRITERS.get(node.type)
    if writer is None or not node.artifact:
        return None
    if known and known["artifact"] == node.artifact and _lie_there(folder, known["files"]):
        return known
    try:
        value = run.value(name)
    except PipelineError:
        return None
    files = writer(folder / _plain(name), value)
    return {"artifact": node.artifact, "files": {path.name: path.stat().st_size for path in files}}


def _record(folder: Path) -> dict[str, Any]:
    """What was written earlier: for each node its artifact and the sizes of its files."""
    try:
        content = json.loads((folder / RECORD).read_text())
        return dict(content["nodes"]) if content["format"] == FORMAT else {}
    except (OSError, ValueError, KeyError, TypeError):
        return {}


def _lie_there(folder: Path, sizes: dict[str, int]) -> bool:
    try:
        return all((folder / name).stat().st_size == size for name, size in sizes.items())
    except OSError:
        return False


def _plain(name: str) -> str:
    """A node's name as the name of a file, which stays in its folder."""
    return "".join(c if c.isalnum() or c in "-_" else "_" for c in name)


def _write_metrics(folder: Path, run: RunView) -> Path:
    table = io.StringIO()
    rows = csv.writer(table, lineterminator="\n")
    rows.writerow(["name", "value", "unit"])
    rows.writerows((name, repr(float(value)), labelled(name, value).unit) for name, value in run.metrics.items())
    path = folder / "metrics.csv"
    if not path.is_file() or path.read_text() != table.getvalue():
        write_text(path, table.getvalue())
    return path
