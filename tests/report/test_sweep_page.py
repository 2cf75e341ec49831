from __future__ import annotations

from typing import Any

import pytest

from pipeline.report.sweep_page import _chart

METALS = ("silver", "aluminium", "gold", "copper", "brass", "iron", "platinum")


def rows(names: tuple[str, ...], steps: int = 3) -> list[dict[str, Any]]:
    return [{"metal": n, "film_deg": str(k), "deviation_deg": k + i} for i, n in enumerate(names) for k in range(steps)]


def chart(names: tuple[str, ...]) -> str:
    return _chart(rows(names), ["metal", "film_deg"], ["deviation_deg"])


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
