from __future__ import annotations

from typing import Any

import pytest

from pipeline.graph.studies import Tradeoff
from pipeline.report.tradeoff_chart import front, tradeoff_chart

ASKED = Tradeoff("error_mean_deg", "fit", panels=("scene",))
SWEPT = ["scene", "method", "count"]


def row(scene: str, method: str, count: str, error: float | None, seconds: float | None, pareto: str | None) -> Any:
    point = {"scene": scene, "method": method, "count": count}
    return {**point, "error_mean_deg": error, "fit_seconds": seconds, "pareto": pareto}


ROWS = [
    row("stars", "exact", "12", 0.01, 9.0, "yes"),
    row("stars", "fast", "4", 2.0, 0.01, "yes"),
    row("stars", "fast", "12", 3.0, 0.1, "no"),
    row("logo", "fast", "4", 0.5, 0.02, "yes"),
    row("logo", "exact", "4", None, None, None),
]


def test_panels_methods_front_and_numbers_are_drawn() -> None:
    drawn = str(tradeoff_chart(ROWS, SWEPT, ASKED))
    for text in ("scene stars", "scene logo", "fast", "exact", "error, mean (°)", "fit (s)", "0.01", "10"):
        assert f">{text}</text>" in drawn
    assert drawn.count('id="front"') == 2
    assert drawn.count(">12</text>") == 2
    assert drawn.count(">4</text>") == 2  # the point that failed is not drawn


def test_the_front_is_listed_panel_by_panel_the_fastest_first() -> None:
    assert [(r["scene"], r["fit_seconds"]) for r in front(ROWS, ASKED)] == [
        ("stars", 0.01),
        ("stars", 9.0),
        ("logo", 0.02),
    ]


def test_two_settings_of_panels_make_a_table_with_a_gap() -> None:
    drawn = str(tradeoff_chart(ROWS[:4], SWEPT, Tradeoff("error_mean_deg", "fit", panels=("scene", "count"))))
    for text in ("scene stars, count 4", "scene stars, count 12", "scene logo, count 4"):
        assert f">{text}</text>" in drawn
    assert "scene logo, count 12" not in drawn


def test_an_error_of_nought_leaves_the_axis_linear() -> None:
    rows = [row("stars", "fast", "4", 0.0, 0.01, "yes"), row("stars", "fast", "8", 50.0, 0.02, "no")]
    drawn = str(tradeoff_chart(rows, SWEPT, Tradeoff("error_mean_deg", "fit")))
    assert ">0</text>" in drawn
    assert ">30</text>" in drawn


@pytest.mark.parametrize("rows", [[], ROWS[4:]])
def test_without_a_point_there_is_no_chart(rows: list[Any]) -> None:
    assert tradeoff_chart(rows, SWEPT, ASKED) == ""
    assert front(rows, ASKED) == []
