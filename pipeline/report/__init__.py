"""The report of a run, one HTML file, and the files a person opens; both by the types of the values."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pipeline.runs import Run


def write(run: Run) -> Path:
    """Write ``report.html`` into the run's folder and return its path."""
    from pipeline.files import write_text
    from pipeline.report.page import page

    write_text(run.report, page(run))
    return run.report


def write_outputs(run: Run) -> list[Path]:
    """Write EXR, PNG and CSV files into ``outputs/`` of the run's folder and return their paths."""
    from pipeline.report.outputs import write_values

    return write_values(run)
