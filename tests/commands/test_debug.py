"""A stage that failed can be run again by itself, in the frame that failed."""

from __future__ import annotations

from types import TracebackType
from typing import Any

import pytest
from toys import Toys

from pipeline.commands.debug import debug
from pipeline.errors import InputError


def test_the_debugger_opens_where_the_stage_failed(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    run = toys.run("graph.cut.stage=toy.fails")
    seen: list[dict[str, Any]] = []

    def look(trace: TracebackType) -> None:
        while trace.tb_next is not None:
            trace = trace.tb_next
        seen.append(dict(trace.tb_frame.f_locals))

    assert debug(run.path, "cut", look) == 1
    assert seen[0]["message"] == "the toy broke"
    assert seen[0]["maps"].period_um[0, 0] == 3.0
    assert "RuntimeError: the toy broke" in capsys.readouterr().err


def test_a_stage_that_is_mended_says_so(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    run = toys.run("graph.cut.stage=toy.fails")
    toys.stages.write_text(toys.stages.read_text().replace("raise RuntimeError(message)", "return maps"))
    toys.forget()
    assert debug(run.path, "cut") == 0
    assert "did not fail this time; it gave PeriodMap" in capsys.readouterr().out


def test_what_cannot_be_debugged_is_said(toys: Toys) -> None:
    run = toys.run("graph.big.stage=toy.fails")
    with pytest.raises(InputError, match=r"'means' has no inputs yet: cut did not give a value"):
        debug(run.path, "means")
    with pytest.raises(InputError, match="no node 'bgi'"):
        debug(run.path, "bgi")
