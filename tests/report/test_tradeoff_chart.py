from __future__ import annotations

from typing import Any

import pytest

from pipeline.graph.studies import Tradeoff
from pipeline.report.tradeoff_chart import front, tradeoff_chart

ERROR = "error_mean_deg"
ASKED = Tradeoff((ERROR,), ("fit",), panels=("scene",))
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
    drawn = str(tradeoff_chart(ROWS, SWEPT, ASKED, ERROR))
    for text in ("scene stars", "scene logo", "fast", "exact", "error, mean (°)", "fit (s)", "0.01", "10"):
        assert f">{text}</text>" in drawn
    assert drawn.count('id="front"') == 2
    assert drawn.count(">12</text>") == 2
    assert drawn.count(">4</text>") == 2  # the point that failed is not drawn


def test_the_front_is_listed_panel_by_panel_the_fastest_first() -> None:
    assert [(r["scene"], r["fit_seconds"]) for r in front(ROWS, ASKED, ERROR)] == [
        ("stars", 0.01),
        ("stars", 9.0),
        ("logo", 0.02),
    ]


def test_two_settings_of_panels_make_a_table_with_a_gap() -> None:
    drawn = str(tradeoff_chart(ROWS[:4], SWEPT, Tradeoff((ERROR,), ("fit",), panels=("scene", "count")), ERROR))
    for text in ("scene stars, count 4", "scene stars, count 12", "scene logo, count 4"):
        assert f">{text}</text>" in drawn
    assert "scene logo, count 12" not in drawn


def test_an_error_of_nought_leaves_the_axis_linear() -> None:
    rows = [row("stars", "fast", "4", 0.0, 0.01, "yes"), row("stars", "fast", "8", 50.0, 0.02, "no")]
    drawn = str(tradeoff_chart(rows, SWEPT, Tradeoff((ERROR,), ("fit",)), ERROR))
    assert ">0</text>" in drawn
    assert ">30</text>" in drawn


def test_each_of_several_errors_has_a_front_of_its_own_over_the_seconds_of_a_chain() -> None:
    wanted = Tradeoff((ERROR, "unlit_percent"), ("merged", "fit"))
    rows = [
        {"count": "1", ERROR: 2.0, "unlit_percent": 9.0, "timed_seconds": 1.0},
        {"count": "3", ERROR: 3.0, "unlit_percent": 0.0, "timed_seconds": 2.0},
    ]
    for one, best in zip(rows, (("yes", "yes"), ("no", "yes")), strict=True):
        one |= {f"pareto_{ERROR}": best[0], "pareto_unlit_percent": best[1]}
    drawn = str(tradeoff_chart(rows, ["count"], wanted, ERROR))
    assert ">merged to fit (s)</text>" in drawn
    assert ">error, mean (°)</text>" in drawn
    assert [row["count"] for row in front(rows, wanted, ERROR)] == ["1"]
    assert [row["count"] for row in front(rows, wanted, "unlit_percent")] == ["1", "3"]


@pytest.mark.parametrize("rows", [[], ROWS[4:]])
def test_without_a_point_there_is_no_chart(rows: list[Any]) -> None:
    assert tradeoff_chart(rows, SWEPT, ASKED, ERROR) == ""
    assert front(rows, ASKED, ERROR) == []
