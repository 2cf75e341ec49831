from __future__ import annotations

from typing import Any

import pytest
from toys import Toys

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
    assert text.count(">1.1e+02</text>") == 3
    assert text.count(">2.5</text>") == 1
    assert RED not in text


def test_numbers_stand_in_their_order_along_an_axis() -> None:
    text = drawn(rows(TABLE))
    assert text.index(">1</text>") < text.index(">2</text>") < text.index(">10</text>")


@pytest.mark.parametrize(("limit", "lines"), [(4.0, 2), (50.0, 0)])
def test_the_limit_is_a_line_in_the_map_and_on_the_colour_bar_where_it_is_crossed(limit: float, lines: int) -> None:
    assert drawn(rows(TABLE), limit).count(RED) == lines


@pytest.mark.parametrize(("largest", "log"), [(19.0, False), (21.0, True)])
def test_colours_are_logarithmic_from_a_ratio_of_twenty(largest: float, log: bool) -> None:
    text = drawn(rows({(1, 0): 1.0, (1, 1): largest, (2, 0): 2.0, (2, 1): 3.0}))
    assert ("10^{1}" in text or "mathdefault{10" in text) == log


@pytest.mark.parametrize("side", [10, 11])
def test_values_are_written_while_they_have_room(side: int) -> None:
    text = drawn(rows({(i, j): 1234.0 + i / 10 for i in range(side) for j in range(side)}))
    assert (text.count(">1.2e+03</text>") == side**2) == (side**2 <= MOST_WRITTEN)


def test_a_figure_that_is_nowhere_known_gives_no_map() -> None:
    assert drawn([{"film": "1", "phase": "2", "metal": "gold", "error_deg": None}]) == ""


def test_a_sweep_asks_for_maps_and_gets_them(toys: Toys) -> None:
    toys.forget()
    words = ["graph.big.factor=1,2,4", "graph.cut.most=1,2,3"]
    asked = ["maps.rows=graph.big.factor", "maps.columns=graph.cut.most", "maps.metrics=mean_1_um", "maps.limit=1.5"]
    done = run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words, *asked], [], Silent())
    page = (done.folder / "report.html").read_text()
    assert "Map of mean 1 (µm)" in page
    assert "Red line: 1.5" in page
    assert RED in page
