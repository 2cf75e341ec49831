"""Names of figures of merit for people: the unit comes off the end of the name."""

from __future__ import annotations

from dataclasses import dataclass

UNITS = {
    "deg": "°",
    "rad": "rad",
    "percent": "%",
    "um": "µm",
    "nm": "nm",
    "mm": "mm",
    "px": "px",
    "s": "s",
    "mb": "MB",
}


@dataclass(frozen=True)
class Labelled:
    """A figure of merit with its label and unit."""

    name: str
    label: str
    text: str
    unit: str


def labelled(name: str, value: float) -> Labelled:
    """Label a figure: ``orientation_error_mean_deg`` becomes "orientation error, mean" in degrees."""
    words = name.rsplit(".", maxsplit=1)[-1].split("_")
    unit = UNITS.get(words[-1], "")
    if unit:
        words = words[:-1]
    if len(words) > 1 and words[-1] in {"mean", "median", "std", "p95", "max"}:
        last = {"std": "standard deviation", "p95": "95th percentile"}.get(words[-1], words[-1])
        label = " ".join(words[:-1]) + ", " + last
    else:
        label = " ".join(words)
    node = name.rpartition(".")[0]
    return Labelled(name, f"{label} ({node})" if node else label, f"{value:.4g}", unit)
