"""What the charts of a sweep's page have in common: style, labels, places on an axis."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from markupsafe import Markup

from pipeline.report.naming import labelled, plain, with_unit

Row = Mapping[str, Any]

MOST_COLUMNS = 3
"""Panels side by side, where their order means nothing."""
NARROW, WIDE = 3.0, 100.0
"""Ratios of an axis's ends below which it takes evenly spaced ticks, and above which powers of ten only."""
CROWDED = 36
"""Characters of an axis's names beyond which they are turned."""


@contextmanager
def chart_style() -> Iterator[None]:
    """The look of all charts, inside the block."""
    from matplotlib import rc_context

    frame: Any = {"axes.spines.top": False, "axes.spines.right": False}
    plain_ticks: Any = {"axes.formatter.useoffset": False, "axes.formatter.limits": (-4, 6)}
    with rc_context({"font.size": 8, "svg.fonttype": "none", **frame, **plain_ticks}):
        yield


def as_svg(figure: Any) -> Markup:
    """A figure of matplotlib as an element of the page."""
    drawn = io.StringIO()
    figure.savefig(drawn, format="svg", transparent=True, metadata={"Date": None})
    return Markup(drawn.getvalue()[drawn.getvalue().index("<svg") :])


def figure_label(metric: str) -> str:
    """A figure of merit in words, with its unit: ``orientation error, mean (°)``."""
    label = labelled(metric, 0.0)
    return f"{label.label} ({label.unit})" if label.unit else label.label


def short(setting: str) -> str:
    """The last part of a setting's name."""
    return setting.rpartition(".")[2]


def round_ticks(axis: Any, ratio: float) -> None:
    """Ticks of a logarithmic axis at round numbers, written as such; ``ratio`` is that of its ends."""
    from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

    subs = (1.0,) if ratio > WIDE else (1.0, 2.0, 5.0)
    axis.set_major_locator(MaxNLocator(4) if ratio < NARROW else LogLocator(subs=subs))
    axis.set_major_formatter(FuncFormatter(lambda value, _: plain(value)))
    axis.set_minor_locator(NullLocator())


def combinations(rows: Sequence[Row], settings: Sequence[str]) -> list[tuple[str, ...]]:
    """The combinations of some settings that occur, in the order in which they do, numbers by size."""
    found = list(dict.fromkeys(tuple(row[name] for name in settings) for row in rows))
    place = [places([values[i] for values in found]) for i in range(len(settings))]
    return sorted(found, key=lambda values: [place[i][value] for i, value in enumerate(values)])


def named(settings: Sequence[str], values: Sequence[str]) -> str:
    """Settings and their values in words: ``phase 160°, estimator jones``."""
    heads = [labelled(short(name), 0.0) for name in settings]
    return ", ".join(f"{h.label} {with_unit(value, h.unit)}" for h, value in zip(heads, values, strict=True))


def places(values: Sequence[str]) -> dict[str, float]:
    """Where on an axis values stand: as numbers if they all are, else one after the other."""
    distinct = list(dict.fromkeys(values))
    found = numbers(distinct)
    return dict(zip(distinct, found or [float(i) for i in range(len(distinct))], strict=True))


def numbers(values: Sequence[str]) -> list[float] | None:
    """Values as numbers, or None if any is none."""
    try:
        return [float(value) for value in values]
    except ValueError:
        return None
