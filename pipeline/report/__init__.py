"""The report of a run, one HTML file, and the files a person opens; both by the types of the values."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.report.view import RunView


FORMAT = 7
"""Counts up when the same value is drawn or written differently, so that older reports and files are made anew."""

RECORD = ".written.json"


def is_current(folder: Path) -> bool:
    """Whether the report and files in a run's folder are as this version writes them."""
    try:
        return bool(json.loads((folder / "outputs" / RECORD).read_text())["format"] == FORMAT)
    except (OSError, ValueError, KeyError, TypeError):
        return False


def write(run: RunView) -> Path:
    """Write ``report.html`` into the run's folder, its charts as SVG files into ``outputs/``, and return its path."""
    from pipeline.report.outputs import write_charts
    from pipeline.report.page import draw, page
    from pipeline.storage.files import write_text

    drawing = draw(run)
    write_charts(run.path / "outputs", {section.node.name: section.figures for section in drawing.sections})
    path = run.path / "report.html"
    write_text(path, page(run, drawing))
    return path


def write_outputs(run: RunView) -> list[Path]:
    """Write EXR, PNG and CSV files into ``outputs/`` of the run's folder and return their paths."""
    from pipeline.report.outputs import write_values

    return write_values(run)
