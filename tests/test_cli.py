"""The command line: what it prints, and its exit status."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from toys import Toys

from pipeline.cli import main

Command = Callable[..., tuple[int, str, str]]


@pytest.fixture
def command(toys: Toys, capsys: pytest.CaptureFixture[str]) -> Command:
    def call(*words: str) -> tuple[int, str, str]:
        runs = [f"paths.runs={toys.folder / 'runs'}"] if any("experiment=" in w for w in words) else []
        status = main([*words, *runs])
        printed = capsys.readouterr()
        return status, printed.out, printed.err

    return call


def test_a_run_prints_figures_counts_and_the_report(command: Command) -> None:
    status, out, err = command("+experiment=toy")
    assert status == 0
    assert "mean_1_um  3" in out
    assert "4 stages run, 0 from the store" in out
    assert out.splitlines()[-1].startswith("report: ")
    assert "ran" in err
    assert re.search(r"ran .* raw .*\n +of \d+ rows\n +warning: made of nothing\n", err)
    status, out, err = command("+experiment=toy")
    assert (status, err.strip()) == (0, "warning (raw, from the store): made of nothing")
    assert "0 stages run, 4 from the store" in out


def test_a_sweep_prints_what_stages_warn_of_and_not_their_notes(command: Command) -> None:
    status, _, err = command("-m", "+experiment=toy", "graph.big.factor=2,3")
    assert status == 0
    assert "made of nothing" in err
    assert " rows" not in err


def test_experiment_without_plus_is_understood(command: Command) -> None:
    assert command("experiment=toy")[0] == 0


def test_quiet_prints_only_where_the_report_is(command: Command) -> None:
    status, out, err = command("+experiment=toy", "--quiet")
    assert (status, err) == (0, "")
    assert out.startswith("report: ")
    assert len(out.splitlines()) == 1


def test_why_runs_nothing(command: Command) -> None:
    for _ in range(2):
        status, out, _ = command("why", "+experiment=toy")
        assert status == 0
        assert "RUN  raw" in out
        assert "never run" in out
        assert "1 would run, 3 depend on these, 0 are in the store" in out


def test_a_failure_names_the_stage_and_its_cause(command: Command) -> None:
    status, _, err = command("+experiment=toy", "graph.big.stage=toy.fails")
    assert status == 1
    assert "stage 'big' (toy.fails) failed" in err
    assert "RuntimeError: the toy broke" in err
    assert "not run, since they wait for what failed: cut, means" in err
    assert re.search(r"under a debugger: python -m pipeline debug \S+/toy/\w+ big", err)


def test_wrong_input_ends_with_status_2(command: Command) -> None:
    status, out, err = command("+experiment=toy", "graph.raw.sise=3")
    assert (status, out) == (2, "")
    assert "did you mean 'size'?" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["whi"], "'whi' is neither a command nor SETTING=VALUE"),
        (["--quite", "+experiment=toy"], "did you mean '--quiet'?"),
        (["list", "stage"], "did you mean 'stages'?"),
        (["show", "toy.scael"], "did you mean 'toy.scale'?"),
        (["export", "x"], "export takes three words"),
        (["export", "nowhere", "photos", "out"], "there is no run in nowhere"),
    ],
)
def test_wrong_words_are_answered(command: Command, words: list[str], message: str) -> None:
    status, _, err = command(*words)
    assert status == 2
    assert message in err


def test_help_is_printed(command: Command) -> None:
    assert command("--help")[0] == 0
    assert "python -m pipeline" in command("--help")[1]


def test_list_and_show_know_the_stages(command: Command) -> None:
    status, out, _ = command("list", "stages")
    assert status == 0
    assert "toy.scale" in out
    assert "Scale a map." in out
    status, out, _ = command("show", "toy.scale")
    assert status == 0
    assert "maps: PeriodMap" in out
    assert "mode: one of 'up', 'down' = 'up'" in out
    assert "gives PeriodMap" in out


def test_a_study_takes_several_values_without_being_told_that_it_sweeps(command: Command, toys: Toys) -> None:
    (toys.configs / "experiment" / "factors.yaml").write_text(
        "# @package _global_\ndefaults: [toy, _self_]\n"
        "hydra: {mode: MULTIRUN, sweeper: {params: {graph.big.factor: '2,3'}}}\n"
    )
    status, out, _ = command("+experiment=factors", "graph.big.factor=4,5,6")
    assert status == 0
    assert out.count(" done") == 3
    status, _, err = command("+experiment=toy", "graph.big.factor=4,5,6")
    assert status == 2
    assert "'graph.big.factor' has several values" in err
