"""Draw flash_limits.png: ``python docs/images/flash_limits.py TILES SMALL``.

They are the ``table.csv`` of the sweeps limits_flash and limits_flash_small.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from pipeline.report.charts import chart_style, round_ticks

LOOKS = {
    "error_mean_deg": ("mean error", "o", "-"),
    "orientation_error_median_deg": ("median error", "s", "--"),
    "stated_error_median_deg": ("stated, median", "", ":"),
}
COLOURS = ("tab:orange", "tab:blue")


def main() -> None:
    """Errors and what maps state of them: over the width of the picked tile, and over the number of tiles."""
    with chart_style():
        figure = Figure(figsize=(8.0, 3.2), layout="constrained")
        left, right = figure.subplots(1, 2, sharey=True)
        draw(left, Path(sys.argv[1]), "graph.tiles.motion", {"translation": "translation", "auto": "auto"}, "wide")
        draw(
            right,
            Path(sys.argv[2]),
            "graph.fit.photographs",
            {"1": "one photograph", "5": "five photographs"},
            "sheet",
        )
        left.set_xlabel("tile picked too wide by (%)")
        right.set_xlabel("tiles")
        right.set_xscale("log")
        right.invert_xaxis()
        round_ticks(right.xaxis, 100)
        left.set_yscale("log")
        round_ticks(left.yaxis, 100)
        left.set_ylabel("orientation (°)")
        handles = [
            left.plot([], [], marker=marker, linestyle=line, color="0.4", label=text)[0]
            for text, marker, line in LOOKS.values()
        ]
        figure.legend(handles=handles, loc="outside upper center", ncols=len(handles), frameon=False)
        figure.savefig(Path(__file__).with_suffix(".png"), dpi=110, metadata={"Software": None})


def draw(axes: Axes, table: Path, setting: str, names: dict[str, str], over: str) -> None:
    """One line for each figure and value of a setting, over the number at the end of another's name."""
    with table.open() as lines:
        rows = list(csv.DictReader(lines))
    for colour, (value, name) in zip(COLOURS, names.items(), strict=True):
        here = sorted((row for row in rows if row[setting] == value), key=lambda row: number(row[over]))
        for figure, (_, marker, line) in LOOKS.items():
            points = [(number(row[over]), float(row[figure])) for row in here]
            axes.plot(*zip(*points, strict=True), marker=marker, linestyle=line, markersize=3.5, color=colour)
        axes.plot([], [], color=colour, label=name)
    axes.legend(frameon=False)


def number(name: str) -> int:
    """What stands behind the last underscore."""
    return int(name.rsplit("_", 1)[1])


if __name__ == "__main__":
    main()
