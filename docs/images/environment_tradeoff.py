"""Draw environment_tradeoff.png: ``python docs/images/environment_tradeoff.py TABLE``, with a sweep's ``table.csv``."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

from matplotlib.figure import Figure

from pipeline.report.charts import chart_style, round_ticks

EVALUATORS = {"sum": ("s", "tab:blue"), "ordered": ("o", "tab:green"), "low_rank": ("^", "tab:orange")}
NAMES = {"20_nm": "20 nm", "03": "0.003", "1": "0.01", "3": "0.03", "10": "0.1"}


def main() -> None:
    """Draw the error of every method over its seconds, a panel for each probe."""
    with Path(sys.argv[1]).open() as table:
        rows = list(csv.DictReader(table))
    probes = list(dict.fromkeys(row["environment"] for row in rows))
    with chart_style():
        figure = Figure(figsize=(9.0, 3.6), layout="constrained")
        panels = figure.subplots(1, len(probes), sharey=True, squeeze=False)[0]
        for axes, probe in zip(panels, probes, strict=True):
            for evaluator, (marker, colour) in EVALUATORS.items():
                here = [row for row in rows if row["environment"] == probe and row["method"].startswith(evaluator)]
                places = [(float(row["rendering_seconds"]), float(row["picture_error_rms_percent"])) for row in here]
                label = evaluator.replace("_", " ") if probe == probes[0] else None
                axes.scatter(*zip(*places, strict=True), s=20, marker=marker, color=colour, label=label)
                shift = (4, -8) if evaluator == "sum" else (4, 3)
                for row, place in zip(here, places, strict=True):
                    text = named(evaluator, row["method"])
                    axes.annotate(text, place, xytext=shift, textcoords="offset points", fontsize=6)
            axes.set(title=probe, xlabel="rendering (s)", xscale="log", yscale="log")
            round_ticks(axes.xaxis, 30)
            round_ticks(axes.yaxis, 30)
        panels[0].set_ylabel("error, root mean square (%)")
        figure.legend(loc="outside upper center", ncols=len(EVALUATORS), frameon=False)
        figure.savefig(Path(__file__).with_suffix(".png"), dpi=110, metadata={"Software": None})


def named(evaluator: str, method: str) -> str:
    """Step or tolerance of a method of the study."""
    value = method.removeprefix(f"{evaluator}_")
    return f"{value} nm" if evaluator == "sum" else NAMES[value]


if __name__ == "__main__":
    main()
