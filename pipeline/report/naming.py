"""Figures of merit, times and settings in words: the unit comes off the end of a name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from markupsafe import Markup, escape

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

STATISTICS = {
    "mean": "mean",
    "median": "median",
    "max": "largest",
    "min": "least",
    "std": "standard deviation",
    "rms": "root mean square",
    "p95": "95th percentile",
    "p99": "99th percentile",
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
    node, _, bare = name.rpartition(".")
    words = bare.split("_")
    unit = UNITS.get(words[-1], "") if len(words) > 1 else ""
    if unit:
        words = words[:-1]
    if len(words) > 1 and words[-1] in STATISTICS:
        label = " ".join(words[:-1]) + ", " + STATISTICS[words[-1]]
    else:
        label = " ".join(words)
    return Labelled(name, f"{label} ({node})" if node else label, _number(value), unit)


def setting_label(setting: str) -> str:
    """A setting in words, with its unit: ``graph.misread.scatter_deg`` becomes "misread scatter (°)"."""
    parts = setting.split(".")
    bare = labelled(parts[-1], 0.0)
    words = " ".join([*parts[1:-1], bare.label])
    return f"{words} ({bare.unit})" if bare.unit else words


def with_unit(words: str, unit: str) -> str:
    """A number with its unit: 8°, 0.06 mm; words that are no number stay alone."""
    try:
        float(words)
    except ValueError:
        return words
    return f"{words}{'' if unit in {'', '°'} else ' '}{unit}"


def plain(value: float, digits: int = 4) -> str:
    """A number rounded to so many digits, but never before its point; no exponent from 0.001 to a million."""
    if not math.isfinite(value):
        return "not known" if math.isnan(value) else str(value)
    size = abs(value)
    if size and not 0.001 <= size < 1e6:
        return f"{value:.{digits}g}"
    decimals = max(0, digits - 1 - math.floor(math.log10(size))) if size else 0
    text = f"{value:.{decimals}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def duration(seconds: float) -> str:
    """Seconds as a person would say them: 4 ms, 1.23 s, 45.6 s, 3 min 05 s."""
    if seconds < 0.0995:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 9.995:
        return f"{seconds:.2f} s"
    if seconds < 119.95:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min {rest:02d} s"


def moment(iso: str) -> str:
    """A time as ``2026-03-01 12:30 UTC``; what is no ISO time is left as it is."""
    try:
        time = datetime.fromisoformat(iso)
    except ValueError:
        return iso
    if time.tzinfo is None:
        time = time.replace(tzinfo=UTC)
    return time.astimezone(UTC).strftime("%Y-%m-%d %H:%M UTC")


def prose(words: str) -> Markup:
    """A line of a docstring for the page: what stands between double backticks is code."""
    return Markup(re.sub(r"``(.+?)``", r"<code>\1</code>", str(escape(words))))


def flat(settings: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    """Settings one a row, those of devices under dotted names, values as YAML would write them."""
    rows: list[tuple[str, str]] = []
    for name, value in settings.items():
        if isinstance(value, Mapping) and value:
            rows += flat(value, f"{prefix}{name}.")
        else:
            rows.append((prefix + name, _shown(value)))
    return rows


def _number(value: float) -> str:
    return plain(value).replace("-", "−")


def _shown(value: Any) -> str:
    if value is None:
        return "null"
    return str(value).lower() if isinstance(value, bool) else str(value)
