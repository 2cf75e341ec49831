from __future__ import annotations

import re
from typing import Any

import pytest

from pipeline.report.line_charts import constants, line_charts

METALS = ("silver", "aluminium", "gold", "copper", "brass", "iron", "platinum")


def rows(names: tuple[str, ...], steps: int = 3) -> list[dict[str, Any]]:
    return [{"metal": n, "film_deg": str(k), "deviation_deg": k + i} for i, n in enumerate(names) for k in range(steps)]


def chart(names: tuple[str, ...]) -> str:
    return str(line_charts(rows(names), ["metal", "film_deg"], ["deviation_deg"]))


@pytest.mark.parametrize("names", [METALS[:3], METALS, tuple(f"alloy {i}" for i in range(16))])
def test_every_line_is_named_as_long_as_there_is_room(names: tuple[str, ...]) -> None:
    text = chart(names)
    for name in names:
        assert text.count(f">{name}</text>") == 2  # along the axis and in the legend


def test_seventeen_lines_are_too_many_to_name() -> None:
    names = tuple(f"alloy {i}" for i in range(17))
    assert chart(names).count(">alloy 3</text>") == 1


def test_names_that_would_run_into_each_other_are_turned() -> None:
    def turned(names: tuple[str, ...]) -> bool:
        label = next(line for line in chart(names).splitlines() if f">{names[0]}</text>" in line)
        return "rotate(-90" in label

    assert turned(METALS)
    assert not turned(METALS[:3])


def test_settings_and_their_values_have_their_units() -> None:
    text = chart(METALS[:3])
    for words in ("film (°)", "metal", "0°", "1°", "2°", "deviation (°)"):
        assert f">{words}</text>" in text


def test_words_have_nothing_between_them_and_are_not_joined() -> None:
    """A line's path stands alone under its id; the points of a marker-only line have none."""
    ((over_words, over_numbers),) = [re.findall(r'<g id="axes_\d">.*?(?=<g id="axes|\Z)', chart(METALS[:3]), re.DOTALL)]
    joined = re.compile(r'<path d="[^"]*" clip-path="[^"]*" style="fill: none')
    assert not joined.search(over_words)
    assert len(joined.findall(over_numbers)) == 3


def test_lines_that_look_alike_are_drawn_as_one_and_named_for_all() -> None:
    both = [{**row, "phase_deg": p} for row in rows(METALS[:3]) for p in ("0", "45")]
    text = str(line_charts(both, ["metal", "film_deg", "phase_deg"], ["deviation_deg"]))
    assert text.count(">silver, any</text>") == 1
    assert ">silver, 45°</text>" not in text
    apart = [{**row, "deviation_deg": row["deviation_deg"] + float(row["phase_deg"]) / 100} for row in both]
    assert ">silver, 45°</text>" in str(line_charts(apart, ["metal", "film_deg", "phase_deg"], ["deviation_deg"]))


def test_what_only_rounding_changes_is_constant() -> None:
    points = [{"turns": 1.0 + k * 1e-14, "noise": k * 1e-15, "mean": float(k), "lost": None} for k in range(3)]
    assert constants(points, ["turns", "noise", "mean", "lost"]) == {"turns": 1.0, "noise": 0.0}
