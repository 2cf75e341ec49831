"""A sweep is one graph: what its points share is computed once, and each point is a run like any other."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from toys import Toys

from pipeline.bench import Experiment
from pipeline.errors import InputError, InputErrors
from pipeline.execution.merge import merge
from pipeline.execution.outcome import Outcome, Silent
from pipeline.sweep_results import Point
from pipeline.sweeps import Sweep, run_sweep


def swept(toys: Toys, *words: str) -> Sweep:
    toys.forget()
    return run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words], [], Silent())


def test_shared_stages_run_once(toys: Toys) -> None:
    done = swept(toys, "graph.big.factor=2,3", "graph.cut.most=1,2,100")
    assert len(done.points) == 6
    assert done.stages_named == 24
    # raw once, big twice, cut and means 6 times each, less cuts that come out equal
    assert done.stages_run <= 1 + 2 + 6 + 6
    assert [p.run.metrics["mean_1_um"] for p in done.points] == [1.0, 2.0, 2.0, 1.0, 2.0, 3.0]
    assert done.swept == ["graph.big.factor", "graph.cut.most"]


def test_a_sweep_gives_what_separate_runs_give(toys: Toys) -> None:
    done = swept(toys, "graph.big.factor=2,5")
    for point, factor in zip(done.points, (2, 5), strict=True):
        alone = toys.run(f"graph.big.factor={factor}", f"paths.store={toys.folder / 'other'}")
        assert {n: r.artifact for n, r in alone.nodes.items()} == {n: r.artifact for n, r in point.run.nodes.items()}
        assert alone.path == point.run.path
        np.testing.assert_array_equal(alone["cut"].period_um, point.run["cut"].period_um)


class Heard(Silent):
    """A listener that keeps what it heard."""

    def __init__(self) -> None:
        self.begun: list[str] = []
        self.outcomes: list[Outcome] = []

    def started(self, name: str) -> None:
        self.begun.append(name)

    def ended(self, outcome: Outcome) -> None:
        self.outcomes.append(outcome)


def test_a_stage_goes_by_the_point_that_it_serves(toys: Toys) -> None:
    toys.forget()
    heard, log = Heard(), list[str]()
    words = ["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", "graph.big.factor=2,3", "graph.cut.most=1,9"]
    run_sweep(words, [], heard, log.append)
    assert {"raw", "big at graph.big.factor=2", "big at graph.big.factor=3"} < set(heard.begun)
    assert "cut at graph.big.factor=3 graph.cut.most=9" in heard.begun
    assert not [name for name in heard.begun if "~" in name]
    assert (heard.begun[-1], log[-1]) == ("drawing the report",) * 2


def test_what_a_blocked_stage_waits_for_goes_by_its_point_too(toys: Toys) -> None:
    toys.forget()
    heard = Heard()
    words = ["graph.cut.stage=toy.clip,toy.fails", "graph.big.factor=2,3"]
    run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words], [], heard)
    causes = {cause for outcome in heard.outcomes for cause in outcome.blocked_by}
    assert causes == {f"cut at graph.cut.stage=toy.fails graph.big.factor={factor}" for factor in (2, 3)}


def test_a_second_sweep_runs_nothing_and_a_wider_one_only_what_is_new(toys: Toys) -> None:
    swept(toys, "graph.big.factor=2,3")
    assert swept(toys, "graph.big.factor=2,3").stages_run == 0
    wider = swept(toys, "graph.big.factor=2,3,4")
    assert wider.stages_run == 3  # big, cut and means of the new point


def test_the_table_has_settings_figures_seconds_and_place(toys: Toys) -> None:
    done = swept(toys, "graph.big.factor=range(2,5)")
    rows = list(csv.DictReader((done.folder / "table.csv").open()))
    assert [row["graph.big.factor"] for row in rows] == ["2", "3", "4"]
    assert [float(row["mean_1_um"]) for row in rows] == [2.0, 3.0, 4.0]
    assert all(float(row["seconds"]) >= 0 and Path(row["run"]).is_dir() for row in rows)
    page = (done.folder / "report.html").read_text()
    assert "<svg" in page
    assert "graph.big.factor" in page
    assert "python -m pipeline -m +experiment=toy" in page


def test_the_table_has_values_without_the_sweepers_escapes() -> None:
    point = Point(("+experiment=a", r"graph.rendering.orders=second\ order"), None)  # type: ignore[arg-type]
    assert point.settings["graph.rendering.orders"] == "second order"


def test_the_same_words_have_the_same_folder(toys: Toys) -> None:
    first = swept(toys, "graph.big.factor=2,3", "graph.cut.most=5")
    assert swept(toys, "graph.cut.most=5", "graph.big.factor=2,3").folder == first.folder
    assert swept(toys, "graph.big.factor=2,4", "graph.cut.most=5").folder != first.folder


def test_a_glob_stands_for_the_stages_that_fit(toys: Toys) -> None:
    done = swept(toys, "graph.big.stage=glob(toy.[cs]*)")
    stages = [point.settings["graph.big.stage"] for point in done.points]
    assert stages == ["toy.clip", "toy.scale"]  # not toy.source, which takes no maps, nor toy.slow, which needs a name
    with pytest.raises(InputError, match=r"no stage fits 'toy.x\*' in the place of toy.scale"):
        swept(toys, "graph.big.stage=glob(toy.x*)")


def test_one_bad_point_is_named_before_anything_runs(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"factor is 'much'[\s\S]*point graph.big.factor=much"):
        swept(toys, "graph.big.factor=2,much")
    assert not (toys.folder / "runs" / ".store" / "objects").exists()


def test_a_point_that_fails_leaves_the_others_alone(toys: Toys) -> None:
    done = swept(toys, "graph.cut.stage=toy.clip,toy.fails")
    assert [point.run.failed for point in done.points] == [False, True]
    assert done.table()[1]["state"] == "failed"
    assert done.points[1].run.nodes["means"].blocked_by == ("cut",)
    assert done.failed


def test_a_yaml_file_may_ask_for_its_sweep(toys: Toys) -> None:
    (toys.configs / "experiment" / "factors.yaml").write_text(
        "# @package _global_\ndefaults: [toy, _self_]\n"
        "hydra: {mode: MULTIRUN, sweeper: {params: {graph.big.factor: '2,3', graph.big.mode: 'up,down'}}}\n"
    )
    assert Experiment.load(["+experiment=factors"]).configuration.sweeps
    toys.forget()
    done = run_sweep(["+experiment=factors", f"paths.runs={toys.folder / 'runs'}"], [], Silent())
    assert [p.run.metrics["mean_1_um"] for p in done.points] == pytest.approx([2, 1 / 2, 3, 1 / 3])


def test_an_optimiser_proposes_batches_through_the_same_launcher(toys: Toys) -> None:
    pytest.importorskip("hydra_plugins.hydra_optuna_sweeper")
    done = swept(
        toys,
        "hydra/sweeper=optuna",
        "hydra/sweeper/sampler=random",
        "hydra.sweeper.sampler.seed=1",
        "hydra.sweeper.direction=minimize",
        "hydra.sweeper.n_trials=6",
        "hydra.sweeper.n_jobs=3",
        "objective=mean_1_um",
        "graph.big.factor=interval(1.0,9.0)",
    )
    assert len(done.points) == 6
    factors = [float(point.settings["graph.big.factor"]) for point in done.points]
    assert len(set(factors)) == 6
    assert all(1 <= factor <= 9 for factor in factors)
    assert [p.run.metrics["mean_1_um"] for p in done.points] == pytest.approx(factors, rel=1e-6)


def test_merging_tells_equal_nodes_from_different_ones(toys: Toys) -> None:
    graphs = [toys.load(*words).graph for words in ([], ["graph.big.factor=4"], ["graph.big.mode=up"])]
    merged = merge(graphs)
    assert sorted(merged.graph.nodes) == ["big", "big~2", "cut", "cut~2", "means", "means~2", "raw"]
    assert merged.names[0] == merged.names[2]
    assert merged.names[1]["raw"] == "raw"
    assert merged.graph.nodes["cut~2"].inputs == {"maps": ("big~2",)}


def test_the_command_line_prints_table_counts_and_places(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    from pipeline.cli import main

    status = main(["-m", "+experiment=toy", "graph.big.factor=2,3", f"paths.runs={toys.folder / 'runs'}"])
    out = capsys.readouterr().out
    assert status == 0
    assert re.search(r"factor +mean_0_um +mean_1_um +seconds +state", out)
    assert "2 points name 8 stages; 7 run, 0 from the store" in out
    assert "table.csv" in out
