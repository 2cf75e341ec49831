from __future__ import annotations

from typing import Any

import pytest
from toys import Toys

from pipeline.errors import InputErrors
from pipeline.execution.outcome import Silent
from pipeline.graph.studies import Maps
from pipeline.report.heat_maps import MOST_WRITTEN, heat_maps
from pipeline.sweeps import run_sweep

SWEPT = ["film", "phase", "metal"]
RED = "stroke: #ff0000"


def rows(values: dict[tuple[int, int], float], metal: str = "gold") -> list[dict[str, Any]]:
    return [{"film": str(f), "phase": str(p), "metal": metal, "error_deg": v} for (f, p), v in values.items()]


def drawn(rows: list[dict[str, Any]], limit: float | None = None) -> str:
    return str(heat_maps(rows, SWEPT, Maps("film", "phase", ("error_deg",), limit), "error_deg"))


TABLE = {(f, p): 1.0 + f + p / 90 for f in (10, 2, 1) for p in (0, 45, 90)}


def test_a_map_for_each_combination_of_the_other_settings_with_every_value() -> None:
    text = drawn(rows(TABLE) + rows({(f, p): 100 + v for (f, p), v in TABLE.items()}, "iron"))
    for words in ("metal gold", "metal iron", "film", "phase", "error (°)"):
        assert f">{words}</text>" in text
    assert text.count(">102</text>") == text.count(">102.5</text>") == 1
    assert text.count(">2.5</text>") == 1
    assert RED not in text


def test_numbers_stand_in_their_order_along_an_axis() -> None:
    text = drawn(rows(TABLE))
    assert text.index(">1</text>") < text.index(">2</text>") < text.index(">10</text>")


@pytest.mark.parametrize(("limit", "lines"), [(4.0, 2), (50.0, 0)])
def test_the_limit_is_a_line_in_the_map_and_on_the_colour_bar_where_it_is_crossed(limit: float, lines: int) -> None:
    assert drawn(rows(TABLE), limit).count(RED) == lines


WORDS = {"cosine": (1.0, 3.0), "jones": (1.0, 1.5), "auto": (3.0, 3.0)}


@pytest.mark.parametrize("axes", [("method", "phase"), ("phase", "method")])
def test_the_limit_is_a_bar_where_a_row_of_words_crosses_it(axes: tuple[str, str]) -> None:
    points = [
        {"method": method, "phase": phase, "error_deg": value}
        for method, ends in WORDS.items()
        for phase, value in zip(("0", "2"), ends, strict=True)
    ]
    drawn = str(heat_maps(points, ["method", "phase"], Maps(*axes, ("error_deg",), 2.0), "error_deg"))
    assert drawn.count(RED) == 2  # cosine's, and the colour bar's


def test_two_settings_of_words_have_no_line_between_them() -> None:
    known = {("a", "x"): 1.0, ("a", "y"): 3.0, ("b", "x"): 3.0, ("b", "y"): 1.0}
    points = [{"method": m, "scene": s, "error_deg": v} for (m, s), v in known.items()]
    drawn = str(heat_maps(points, ["method", "scene"], Maps("method", "scene", ("error_deg",), 2.0), "error_deg"))
    assert drawn.count(RED) == 1  # the colour bar's


def test_a_limit_of_one_figure_draws_no_line_on_the_map_of_another() -> None:
    maps = Maps("film", "phase", ("error_deg", "bad_percent"), {"error_deg": 4.0})
    points = [{**row, "bad_percent": row["error_deg"]} for row in rows(TABLE)]
    assert RED in str(heat_maps(points, SWEPT, maps, "error_deg"))
    assert RED not in str(heat_maps(points, SWEPT, maps, "bad_percent"))


@pytest.mark.parametrize(("largest", "log"), [(19.0, False), (21.0, True)])
def test_colours_are_logarithmic_from_a_ratio_of_twenty(largest: float, log: bool) -> None:
    text = drawn(rows({(1, 0): 1.0, (1, 1): largest, (2, 0): 2.0, (2, 1): 3.0}))
    assert (">20</text>" in text) == log  # 1, 2, 5, 10, 20 or 2.5, 5, 7.5 ...
    assert "mathdefault" not in text


@pytest.mark.parametrize("side", [10, 11])
def test_values_are_written_while_they_have_room(side: int) -> None:
    text = drawn(rows({(i, j): 1234.0 + i / 10 for i in range(side) for j in range(side)}))
    assert (text.count(">1234</text>") + text.count(">1235</text>") == side**2) == (side**2 <= MOST_WRITTEN)


@pytest.mark.parametrize(("columns", "written"), [(4, "1.146"), (5, "1.1")])
def test_few_columns_have_room_for_four_digits(columns: int, written: str) -> None:
    text = drawn(rows({(1, j): 1.1458 for j in range(columns)}))
    assert text.count(f">{written}</text>") >= columns


def test_a_figure_that_is_nowhere_known_gives_no_map() -> None:
    assert drawn([{"film": "1", "phase": "2", "metal": "gold", "error_deg": None}]) == ""


def test_a_sweep_asks_for_maps_and_gets_them(toys: Toys) -> None:
    toys.forget()
    words = ["graph.big.factor=1,2,4", "graph.cut.most=1,2,3"]
    asked = ["maps.rows=graph.big.factor", "maps.columns=graph.cut.most", "maps.metrics=mean_1_um", "maps.limit=1.5"]
    done = run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words, *asked], [], Silent())
    page = (done.folder / "report.html").read_text()
    assert "Map of mean 1 (µm)" in page
    assert "Red line: 1.5 µm." in page
    assert RED in page


def test_a_limit_of_a_figure_that_no_point_has_is_told(toys: Toys) -> None:
    words = ["graph.big.factor=1,2", "graph.cut.most=1,2", "maps.rows=graph.big.factor", "maps.columns=graph.cut.most"]
    asked = ["maps.metrics=mean_1_um", "maps.limit={mean_0_um: 1.0, mean_2_um: 1.5}"]
    with pytest.raises(InputErrors, match=r"no point has a figure 'mean_2_um'\n  where: +maps.limit") as caught:
        run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words, *asked], [], Silent())
    assert len(caught.value.errors) == 1
