"""A sweep may time one node of its points and chart error against seconds."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from toys import Toys

from pipeline.bench import Experiment
from pipeline.errors import InputErrors
from pipeline.execution import again
from pipeline.execution.outcome import Silent
from pipeline.graph.config import options
from pipeline.parallel import cores, threads
from pipeline.sweep_results import Sweep
from pipeline.sweeps import run_sweep

SWEPT = ("graph.big.factor=2,3", "graph.cut.most=1,100")
ASKED = ("tradeoff.error=mean_1_um", "tradeoff.node=big")


def swept(toys: Toys, *words: str) -> Sweep:
    toys.forget()
    return run_sweep(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words], [], Silent())


def objects(toys: Toys) -> set[Path]:
    return set((toys.folder / "runs" / ".store").rglob("meta.json"))


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[tuple[float, int]]:
    """Factor and threads of each call that is timed."""
    made: list[tuple[float, int]] = []
    call = again.call_stage

    def counted(node: Any, values: Any) -> Any:
        made.append((node.settings["factor"], threads()))
        return call(node, values)

    monkeypatch.setattr(again, "call_stage", counted)
    return made


def test_each_recipe_is_timed_once_for_all_points_and_nothing_of_it_is_kept(
    toys: Toys, calls: list[tuple[float, int]]
) -> None:
    swept(toys, *SWEPT)
    before = objects(toys)
    done = swept(toys, *SWEPT, *ASKED, "tradeoff.repeats=4")
    assert Counter(factor for factor, _ in calls) == {2.0: 5, 3.0: 5}
    assert {count for _, count in calls} == {cores()}
    assert done.stages_run == 0
    assert objects(toys) == before
    seconds = {row["graph.big.factor"]: set() for row in done.table()}
    for row in done.table():
        seconds[row["graph.big.factor"]].add(row["big_seconds"])
    assert all(len(values) == 1 for values in seconds.values())
    assert min(min(values) for values in seconds.values()) > 0


def test_the_least_of_the_times_counts_and_the_first_does_not(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    run = toys.run()
    node = toys.load().graph.nodes["big"]
    clock = iter([10.0, 15.0, 20.0, 23.0, 30.0, 34.0])
    monkeypatch.setattr(again, "time", SimpleNamespace(perf_counter=lambda: next(clock)))
    assert again.least_seconds(node, {"raw": run.node("raw").artifact}, run.store, 3) == 3.0


def test_the_table_says_which_points_nothing_beats(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    times = {2.0: 0.2, 3.0: 0.1, 4.0: 0.3}
    monkeypatch.setattr("pipeline.sweeps.least_seconds", lambda node, *_: times[node.settings["factor"]])
    done = swept(toys, "graph.big.factor=2,3,4", "graph.cut.most=100", *ASKED)
    rows = list(csv.DictReader((done.folder / "table.csv").open()))
    assert [(row["mean_1_um"], row["big_seconds"], row["pareto"]) for row in rows] == [
        ("2.0", "0.2", "yes"),
        ("3.0", "0.1", "yes"),
        ("4.0", "0.3", "no"),
    ]
    assert "big_seconds  pareto" in (done.folder / "table.txt").read_text()
    apart = swept(toys, "graph.big.factor=2,3,4", "graph.cut.most=100", *ASKED, "tradeoff.panels=graph.big.factor")
    assert [row["pareto"] for row in apart.table()] == ["yes", "yes", "yes"]


def test_seconds_of_several_nodes_are_added_and_each_error_has_a_front(
    toys: Toys, monkeypatch: pytest.MonkeyPatch
) -> None:
    times = {"raw": lambda _: 0.5, "big": lambda settings: 0.1 * (4 - settings["factor"])}
    monkeypatch.setattr("pipeline.sweeps.least_seconds", lambda node, *_: times[node.name](node.settings))
    done = swept(
        toys,
        "graph.big.factor=2,3",
        "graph.cut.most=100",
        "tradeoff.node=[raw,big]",
        "tradeoff.error=[mean_0_um,mean_1_um]",
    )
    rows = done.table()
    assert [(row["raw_seconds"], row["big_seconds"], row["timed_seconds"]) for row in rows] == [
        (0.5, pytest.approx(0.2), pytest.approx(0.7)),
        (0.5, pytest.approx(0.1), pytest.approx(0.6)),
    ]
    assert [[row["pareto_mean_0_um"], row["pareto_mean_1_um"]] for row in rows] == [["no", "yes"], ["yes", "yes"]]
    page = (done.folder / "report.html").read_text()
    assert "<code>raw</code> + <code>big</code>" in page
    assert page.count("On the Pareto front of ") == 2


def test_points_that_failed_are_left_out_and_said_to_be(toys: Toys) -> None:
    done = swept(toys, "graph.cut.stage=toy.clip,toy.fails", *ASKED)
    good, bad = done.table()
    assert (good["pareto"], bad["pareto"], bad["big_seconds"]) == ("yes", None, good["big_seconds"])
    page = (done.folder / "report.html").read_text()
    assert "1 of 2 points are left out" in page
    assert "Accuracy against speed" in page
    assert "2 points are left out" not in page.replace("1 of 2 points", "")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["tradeoff.node=bigg"], r"there is no node 'bigg'[\s\S]*tradeoff.node[\s\S]*did you mean 'big'"),
        (["tradeoff.repeats=0"], r"repeats is 0[\s\S]*at least 1"),
        (["tradeoff.repeats=many"], r"repeats is 'many'[\s\S]*expected: int"),
        (["tradeoff.repeat=3"], r"'tradeoff' has no 'repeat'[\s\S]*did you mean 'repeats'"),
        (["tradeoff.panels=graph.cut.mist"], r"'graph.cut.mist' is not swept[\s\S]*did you mean 'graph.cut.most'"),
        (["tradeoff.panels=[graph.cut.most,graph.big.factor,graph.raw.size]"], r"panels names 3 settings[\s\S]*most 2"),
        (["tradeoff.node=[big,bigg]"], r"there is no node 'bigg'[\s\S]*did you mean 'big'"),
        (["tradeoff.error=[]"], r"error is empty[\s\S]*expected: error: str | list"),
        (["~tradeoff.error"], r"'tradeoff' does not say its 'error'"),
        (["tradeoff=fast"], r"'tradeoff' is 'fast'"),
        (["maps.rows=graph.cut.most"], r"does not say its 'columns'[\s\S]*does not say its 'metrics'"),
        (
            ["maps={rows: graph.cut.most, columns: graph.cut.most, metrics: []}"],
            r"both 'graph.cut.most'[\s\S]*metrics is empty",
        ),
        (["maps={rows: graph.cut.most, columns: graph.raw.value, metrics: a}"], r"'graph.raw.value' is not swept"),
    ],
)
def test_what_cannot_be_charted_is_refused_before_anything_runs(toys: Toys, words: list[str], message: str) -> None:
    toys.experiment.write_text(toys.experiment.read_text() + "tradeoff: {error: mean_1_um, node: big}\n")
    with pytest.raises(InputErrors, match=message):
        swept(toys, "graph.big.factor=2,3", "graph.cut.most=1,2", "graph.raw.size=2,3", *words)
    assert not objects(toys)


def test_the_place_of_a_mistake_is_file_and_line(toys: Toys) -> None:
    toys.experiment.write_text(toys.experiment.read_text() + "tradeoff:\n  error: mean_1_um\n  node: bigg\n")
    with pytest.raises(InputErrors, match=r"toy.yaml, line 14: tradeoff.node"):
        swept(toys, "graph.big.factor=2,3")


def test_a_figure_that_no_point_has_is_told_at_the_end_and_the_table_is_there(toys: Toys) -> None:
    with pytest.raises(InputErrors, match=r"no point has a figure 'mean_1_u'[\s\S]*did you mean 'mean_1_um'"):
        swept(toys, *SWEPT, "tradeoff.error=mean_1_u", "tradeoff.node=big")
    assert list((toys.folder / "runs" / "toy" / "sweeps").glob("*/table.csv"))


def test_what_is_charted_changes_no_run(toys: Toys) -> None:
    plain = toys.load().digest
    assert toys.load("tradeoff={error: a, node: big}", "maps={rows: a, columns: b, metrics: c}").digest == plain


SCENES = ("logo", "kinematic", "banknote", "stars", "fireworks", "facets", "cd")


@pytest.mark.parametrize("scene", SCENES)
def test_the_studys_scenes_are_those_of_their_experiments_seen_by_a_coarser_camera(scene: str) -> None:
    study = Experiment.load(["+experiment=tradeoff_polarization", f"scene={scene}"]).graph.nodes
    own = Experiment.load([f"+experiment=polarization_{scene}"]).graph.nodes
    for name in ("sample", "aligned"):
        assert study[name].entry.name == own[name].entry.name
        assert study[name].settings == own[name].settings
    ours, theirs = (dict(nodes["photos"].settings["rig"].settings["camera"].settings) for nodes in (study, own))
    assert ours.pop("pixel_mm") == pytest.approx(theirs.pop("pixel_mm") * 5 / 3, rel=1e-6)
    assert ours == theirs


def test_the_study_sweeps_all_of_its_scenes_and_estimators() -> None:
    import yaml

    content = yaml.safe_load(options("experiment")["tradeoff_polarization"].read_text())
    params = content["hydra"]["sweeper"]["params"]
    assert params["scene"].split(",") == list(content["scenes"]) == list(SCENES)
    assert params["estimator"].split(",") == list(content["estimators"])


def test_the_study_charts_its_estimators_unsmoothed(tmp_path: Path) -> None:
    small = ["rig.camera.pixel_mm=0.15", "graph.photos.count=4", "tradeoff.repeats=1"]
    few = ["scene=stars", "rig.camera.electrons=10000", "estimator=cosine,prenormalized"]
    done = run_sweep(["+experiment=tradeoff_polarization", f"paths.runs={tmp_path}", *few, *small], [], Silent())
    assert [point.settings["estimator"] for point in done.points] == ["cosine", "prenormalized"]
    assert {node.name for node in done.points[0].run.nodes.values() if node.stage} == {
        "sample",
        "photos",
        "aligned",
        "fit",
        "evaluate",
    }
    rows = done.table()
    assert all(row["fit_seconds"] > 0 for row in rows)
    assert rows[0]["orientation_error_mean_deg"] < rows[1]["orientation_error_mean_deg"]
    page = (done.folder / "report.html").read_text()
    assert "scene stars, electrons 10000" in page
