"""Draw flash_tradeoff.png: ``python docs/images/flash_tradeoff.py TABLE``, with the ``table.csv`` of a sweep."""

from __future__ import annotations

import csv
import sys
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from pipeline.report.charts import chart_style, round_ticks

FIGURES = {"orientation_error_mean_deg": "orientation error, mean (°)", "masked_share_percent": "unlit (%)"}
COLOURS = {"1x1": "tab:green", "6x4": "tab:orange", "10x8": "tab:blue"}
LOOKS = {"threshold": ("s", ":"), "lobe": ("o", "-")}


def main() -> None:
    """Draw both figures of every paper over the seconds, the sheets in one panel."""
    with Path(sys.argv[1]).open() as table:
        rows = list(csv.DictReader(table))
    papers = list(dict.fromkeys(row["paper"] for row in rows))
    with chart_style():
        figure = Figure(figsize=(9.0, 5.2), layout="constrained")
        grid = figure.subplots(len(FIGURES), len(papers), sharex=True, sharey="row")
        for line, (name, label) in zip(grid, FIGURES.items(), strict=True):
            for axes, paper in zip(line, papers, strict=True):
                for sheet, colour in COLOURS.items():
                    for method, look in LOOKS.items():
                        here = [
                            row for row in rows if (row["paper"], row["sheet"], row["method"]) == (paper, sheet, method)
                        ]
                        draw(axes, here, name, colour, look)
                axes.set_xscale("log")
                round_ticks(axes.xaxis, 30)
                if name == "orientation_error_mean_deg":
                    axes.set_title(paper)
                    axes.set_yscale("log")
                    round_ticks(axes.yaxis, 30)
                else:
                    axes.set_xlabel("brackets to map (s)")
            line[0].set_ylabel(label)
        keys = [(f"{sheet} tiles", colour, ("", "-")) for sheet, colour in COLOURS.items()]
        keys += [(method, "0.4", look) for method, look in LOOKS.items()]
        handles = [axes.plot([], [], marker=m, linestyle=line, color=c, label=text)[0] for text, c, (m, line) in keys]
        figure.legend(handles=handles, loc="outside upper center", ncols=len(keys), frameon=False)
        figure.savefig(Path(__file__).with_suffix(".png"), dpi=110, metadata={"Software": None})


def draw(axes: Any, rows: list[dict[str, str]], name: str, colour: str, look: tuple[str, str]) -> None:
    """One sheet read by one method: a line through its numbers of photographs."""
    rows = sorted(rows, key=lambda row: int(row["photographs"]))
    places = [(float(row["timed_seconds"]), float(row[name])) for row in rows]
    axes.plot(*zip(*places, strict=True), marker=look[0], linestyle=look[1], markersize=4, linewidth=0.8, color=colour)
    for row, place in zip(rows, places, strict=True):
        axes.annotate(row["photographs"], place, xytext=(3, 3), textcoords="offset points", fontsize=6)


if __name__ == "__main__":
    main()
