from __future__ import annotations

from pathlib import Path
from typing import Any

from pipeline.graph.studies import Maps
from pipeline.report.sweep_page import write_sweep
from pipeline.sweep_results import Sweep

FIGURES = [f"spread_{i}_deg" for i in range(8)]


class MadeUpSweep(Sweep):
    """A sweep over two settings with eight figures, of which the last two are mapped."""

    @property
    def swept(self) -> list[str]:
        return ["film_deg", "phase_deg"]

    @property
    def metrics(self) -> list[str]:
        return FIGURES

    def table(self) -> list[dict[str, Any]]:
        return [
            {"film_deg": str(f), "phase_deg": str(p)}
            | {name: float(f + p) if i else 7.5 for i, name in enumerate(FIGURES)}
            | {"seconds": 0.1, "state": "done", "run": "runs/made_up/0"}
            for f in (0, 3)
            for p in (0, 45)
        ]


def written(folder: Path, limit: float | dict[str, float] | None = None) -> tuple[str, str]:
    write_sweep(MadeUpSweep(folder, "made up", maps=Maps("film_deg", "phase_deg", tuple(FIGURES[-2:]), limit)))
    return (folder / "table.txt").read_text(), (folder / "report.html").read_text()


def test_the_table_for_a_terminal_has_the_figures_that_are_charted(tmp_path: Path) -> None:
    head = written(tmp_path)[0].splitlines()[0].split()
    assert head == ["film_deg", "phase_deg", *FIGURES[-2:], *FIGURES[:4], "seconds", "state"]


def test_a_figure_that_does_not_change_is_told_and_not_drawn(tmp_path: Path) -> None:
    page = written(tmp_path)[1]
    assert "The same at every point: spread 0 7.5°." in page
    assert ">spread 0 (°)</text>" not in page
    assert ">spread 1 (°)</text>" in page


def test_the_limit_of_each_map_is_told_with_its_unit(tmp_path: Path) -> None:
    page = written(tmp_path, {FIGURES[-1]: 10.0})[1]
    assert page.count("Red line: 10°.") == 1
    assert "All are below 100°." in written(tmp_path, 100.0)[1]
