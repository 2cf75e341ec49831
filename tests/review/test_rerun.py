"""Running from a bundle or a run: unchanged, changed, and without trusting it more than it deserves."""

from __future__ import annotations

import csv
import shutil
import sys
from pathlib import Path
from typing import Any

import pytest
from bundles import Entries, change_json, changed, entries_of, first_recipe
from toys import Toys

from pipeline.bench import Experiment
from pipeline.cli import main
from pipeline.errors import InputError, InputErrors
from pipeline.execution.outcome import Silent
from pipeline.review.bundle import write_bundle
from pipeline.review.rerun import Rerun, check_size, rerun_of, without_resolvers
from pipeline.review.verification import verify
from pipeline.runs import Run, open_run
from pipeline.storage.store import Store

RIG = "device: lab.Webcam\nsimulated: false\nexposure_s: {exposure}\nlight: {{device: lab.Lamp, watts: {watts}}}\n"

WITH_RIG = """\
# @package _global_
defaults:
  - override /rig: dim
shared: {much: 3}
graph:
  raw: {stage: toy.source, size: 3}
  big: {stage: toy.scale, maps: raw, factor: "${shared.much}"}
  shot: {stage: toy.photo, camera: "${rig}"}
  cut: {stage: toy.clip, maps: shot}
"""


class Reviewer:
    """Somebody else, with a folder of results of their own."""

    def __init__(self, folder: Path, toys: Toys) -> None:
        self.runs = folder / "reviewer"
        self.toys = toys

    def load(self, path: Path, *overrides: str) -> Rerun:
        self.toys.forget()
        return rerun_of(path, [f"paths.runs={self.runs}", *overrides])

    def run(self, path: Path, *overrides: str) -> Run:
        return self.load(path, *overrides).run(Silent())

    def ran(self, path: Path, *overrides: str) -> list[str]:
        return sorted(self.run(path, *overrides).ran())


@pytest.fixture
def reviewer(toys: Toys, tmp_path: Path) -> Reviewer:
    return Reviewer(tmp_path, toys)


def bundled(toys: Toys, *overrides: str) -> Path:
    """A bundle of a run that is gone since."""
    file = write_bundle(toys.run(*overrides), toys.folder / "toy.zip")
    shutil.rmtree(toys.folder / "runs")
    return file


@pytest.fixture
def rigged(toys: Toys) -> Path:
    (toys.configs / "rig" / "dim.yaml").write_text(RIG.format(exposure=0.1, watts=5))
    (toys.configs / "rig" / "bright.yaml").write_text(RIG.format(exposure=0.2, watts=500))
    toys.experiment.write_text(WITH_RIG)
    return bundled(toys)


def test_unchanged_everything_comes_from_the_bundle(toys: Toys, reviewer: Reviewer) -> None:
    original = toys.run()
    file = bundled(toys)
    run = reviewer.run(file)
    assert list(run.ran()) == []
    assert (run.digest, run.metrics) == (original.digest, original.metrics)
    assert {n.name: n.artifact for n in run.nodes.values()} == {n.name: n.artifact for n in original.nodes.values()}
    assert run.command == f"python -m pipeline run {file} paths.runs={reviewer.runs}"
    assert run.path == reviewer.runs / "toy" / original.digest
    assert run.report.is_file()


def test_no_yaml_of_the_experiment_is_needed(toys: Toys, reviewer: Reviewer) -> None:
    file = bundled(toys)
    toys.experiment.unlink()
    assert reviewer.ran(file) == []
    assert reviewer.ran(file, "graph.big.factor=5") == ["big", "cut", "means"]


def test_an_override_reruns_what_follows_it_and_no_more(toys: Toys, reviewer: Reviewer) -> None:
    file = bundled(toys)
    assert reviewer.ran(file, "graph.cut.most=2") == ["cut", "means"]
    assert reviewer.ran(file, "graph.cut.most=2") == []
    assert reviewer.run(file, "graph.big.mode=down")["big"].period_um[0, 0] == pytest.approx(1 / 3)


def test_an_override_reaches_every_node_that_refers_to_it(rigged: Path, reviewer: Reviewer) -> None:
    assert reviewer.ran(rigged, "shared.much=7") == ["big"]
    run = reviewer.run(rigged, "shared.much=7")
    assert run["big"].period_um[0, 0] == 7
    changed_rig = reviewer.run(rigged, "rig.exposure_s=0.5", "recapture=true")
    assert changed_rig.node("shot").settings["camera"]["exposure_s"] == 0.5
    assert sorted(changed_rig.ran()) == ["shot"]


def test_an_option_of_a_group_takes_the_place_of_what_the_bundle_had(rigged: Path, reviewer: Reviewer) -> None:
    run = reviewer.run(rigged, "rig=bright", "rig.light.watts=400", "recapture=true")
    camera = run.node("shot").settings["camera"]
    assert (camera["exposure_s"], camera["light"]["watts"]) == (0.2, 400.0)
    with pytest.raises(InputError, match="there is no rig 'brigth'"):
        reviewer.load(rigged, "rig=brigth")


def test_stages_can_be_swapped_and_nodes_added_and_removed(toys: Toys, reviewer: Reviewer) -> None:
    file = bundled(toys)
    experiment = reviewer.load(file, "graph.big.stage=toy.clip")
    assert experiment.graph.dropped == {"big": ("factor",)}
    run = reviewer.run(file, "~graph.means", "graph.more={stage: toy.scale, maps: cut}")
    assert sorted(run.ran()) == ["more"]
    assert "means" not in run.nodes


def test_a_run_whose_stage_was_swapped_can_be_run_again(toys: Toys, reviewer: Reviewer) -> None:
    file = bundled(toys, "graph.big.stage=toy.clip")
    assert reviewer.ran(file) == []


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("experiment=toy", "is an experiment already"),
        ("graph.raw.sise=3", "did you mean 'size'"),
        ("grap.raw.size=3", "there is no section 'grap'"),
        ("shared.much=", "unresolved|mismatched|could not|Could not|no section|not in struct|Key"),
        ("graph.raw.size=[", "missing|mismatched|no viable|extraneous|token"),
        ("nothing=3", "not in struct|no section|Could not"),
        ("graph.big.factor=2,3", r"has several values[\s\S]*python -m pipeline -m run \S*zip .*graph.big.factor=2,3"),
    ],
)
def test_wrong_overrides_are_answered(toys: Toys, reviewer: Reviewer, override: str, message: str) -> None:
    file = bundled(toys)
    with pytest.raises((InputError, InputErrors), match=message):
        reviewer.load(file, override)
    assert not reviewer.runs.exists()


def test_a_run_folder_does_as_well(toys: Toys, reviewer: Reviewer) -> None:
    run = toys.run()
    assert reviewer.ran(run.path) == []
    assert reviewer.ran(run.path, "graph.cut.most=2") == ["cut", "means"]
    same = rerun_of(run.path, [f"paths.runs={toys.folder / 'runs'}", "graph.cut.most=2"])
    assert sorted(same.run(Silent()).ran()) == ["cut", "means"]
    assert same.claims == ""


def test_where_and_how_to_run_is_never_the_bundles_affair(toys: Toys, reviewer: Reviewer, tmp_path: Path) -> None:
    def lure(manifest: dict[str, Any]) -> None:
        manifest["raw"]["paths"] = {"runs": str(tmp_path / "trap"), "store": str(tmp_path / "trap")}
        manifest["raw"]["executor"] = {"kind": "distributed", "address": "tcp://192.0.2.1:1"}
        manifest["raw"]["force"] = "raw"
        manifest["raw"]["recapture"] = True

    file = changed(bundled(toys), lambda entries: change_json(entries, "manifest.json", lure))
    content = reviewer.load(file).configuration.content
    assert content["executor"]["kind"] == "threads"
    assert (content["force"], content["recapture"]) == (None, False)
    assert reviewer.ran(file, "graph.cut.most=2") == ["cut", "means"]
    assert not (tmp_path / "trap").exists()


def forged(entries: Entries) -> None:
    """Say of a recipe that it gave what another one gave."""
    manifest: dict[str, Any] = {}
    change_json(entries, "manifest.json", manifest.update)
    raw, big = (next(n for n in manifest["nodes"] if n["name"] == name) for name in ("raw", "big"))
    name = f"store/recipes/{big['key'][:2]}/{big['key']}.json"
    change_json(entries, name, lambda record: record.update(artifact=raw["artifact"]))
    change_json(
        entries,
        "manifest.json",
        lambda m: next(n for n in m["nodes"] if n["name"] == "big").update(artifact=raw["artifact"]),
    )


def test_what_a_bundle_claims_is_believed_for_itself_only(toys: Toys, reviewer: Reviewer) -> None:
    file = changed(bundled(toys), forged)
    run = reviewer.run(file)
    assert run["big"].period_um[0, 0] == 1
    assert Store(run.store.root).record(run.node("big").key) is None
    own = toys.run(f"paths.runs={reviewer.runs}")
    assert own["big"].period_um[0, 0] == 3
    assert open_run(run.path).node("big").artifact == own.node("big").artifact
    assert verify(file).culprits == ("big",)


def test_a_record_of_another_type_than_its_stage_gives_is_not_believed(toys: Toys, reviewer: Reviewer) -> None:
    def lie(entries: Entries) -> None:
        manifest: dict[str, Any] = {}
        change_json(entries, "manifest.json", manifest.update)
        nodes = {node["name"]: node for node in manifest["nodes"]}
        key = nodes["means"]["key"]
        change_json(
            entries,
            f"store/recipes/{key[:2]}/{key}.json",
            lambda record: record.update(artifact=nodes["raw"]["artifact"], type="PeriodMap"),
        )
        nodes["means"].update(artifact=nodes["raw"]["artifact"])
        change_json(entries, "manifest.json", lambda content: content.update(nodes=manifest["nodes"]))

    assert reviewer.ran(changed(bundled(toys), lie)) == ["means"]


def test_a_run_made_from_a_bundle_can_be_bundled_verified_and_opened(toys: Toys, reviewer: Reviewer) -> None:
    run = reviewer.run(bundled(toys), "graph.cut.most=2")
    again = open_run(run.path)
    assert again.metrics == run.metrics
    assert all(again.store.record(node.key) is not None for node in again.nodes.values())
    second = write_bundle(again, toys.folder / "second.zip")
    assert sum("/recipes/" in name for name in entries_of(second)) == 4
    assert verify(second).ok
    assert Reviewer(toys.folder / "third", toys).ran(second) == []


def test_captures_come_from_the_bundle_and_are_not_taken_again(rigged: Path, reviewer: Reviewer) -> None:
    run = reviewer.run(rigged)
    assert list(run.ran()) == []
    assert run["shot"].period_um[0, 0] == 1
    assert "toybench.devices.lab" not in sys.modules
    assert sorted(reviewer.run(rigged, "graph.cut.most=0.5").ran()) == ["cut"]


def test_a_later_session_of_a_capture_is_the_one_that_the_bundle_has(
    rigged: Path, toys: Toys, reviewer: Reviewer
) -> None:
    toys.run()
    toys.devices.write_text(toys.devices.read_text().replace("taken = 0", "taken = 10"))
    second = toys.run("recapture=true")
    file = write_bundle(second, toys.folder / "second.zip")
    shot = second.node("shot").artifact
    assert reviewer.run(rigged).node("shot").artifact != shot
    assert reviewer.run(file).node("shot").artifact == shot
    assert reviewer.run(rigged).node("shot").artifact != shot


def test_a_bundle_moves_real_devices_on_request_only(rigged: Path, reviewer: Reviewer) -> None:
    def drop(manifest: dict[str, Any]) -> None:
        shot = next(node for node in manifest["nodes"] if node["name"] == "shot")
        shot.update(artifact="", key="", status="failed")

    without = changed(rigged, lambda entries: change_json(entries, "manifest.json", drop))
    for path, words in ((without, []), (rigged, ["rig.exposure_s=0.5"]), (rigged, ["rig=bright"])):
        with pytest.raises(InputError, match=r"real devices would take one: lab\.Webcam, lab\.Lamp"):
            reviewer.run(path, *words)
    assert "toybench.devices.lab" not in sys.modules
    assert "shot" in reviewer.ran(rigged, "rig=bright", "recapture=true")
    assert reviewer.ran(rigged, "rig=bright") == []


def test_files_that_are_not_here_are_not_needed_for_what_does_not_change(
    toys: Toys, reviewer: Reviewer, tmp_path: Path
) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "a.txt").write_text("one")
    file = bundled(toys, f"graph.raw.folder={photos}")
    shutil.rmtree(photos)
    assert reviewer.ran(file) == []
    assert reviewer.ran(file, "graph.big.factor=5") == ["big", "cut", "means"]
    with pytest.raises(InputErrors, match=r"there is no file or folder .*photos"):
        reviewer.run(file, "graph.raw.size=5")


def test_edited_code_reruns_its_nodes(toys: Toys, reviewer: Reviewer) -> None:
    file = bundled(toys)
    toys.helper.write_text(toys.helper.read_text().replace("array * factor", "array * factor + 1"))
    run = reviewer.run(file)
    assert sorted(run.ran()) == ["big", "cut", "means"] or sorted(run.ran()) == ["big", "cut", "means", "raw"]
    assert run["big"].period_um[0, 0] == 4


def test_variables_of_this_machine_are_not_read(
    toys: Toys, reviewer: Reviewer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("TOY_NAME", "mine")
    toys.graph("raw: {stage: toy.source}\nbroken: {stage: toy.fails, maps: raw, message: '${oc.env:TOY_NAME}'}")
    file = bundled(toys)
    monkeypatch.setenv("TOY_NAME", "secret")
    settings = reviewer.load(file).graph.nodes["broken"].settings
    assert settings["message"] == "mine"


def test_only_plain_references_are_followed() -> None:
    raw = {
        "a": "${b.c}",
        "d": "x ${b} ${.e}",
        "f": "${oc.env:HOME}",
        "g": ["${b.${c}}", 3],
        "h": {"i": "${oc.create:1}"},
    }
    content = {"a": 1, "d": 2, "f": 3, "g": [4, 3], "h": {"i": 5}}
    assert without_resolvers(raw, content) == {"a": "${b.c}", "d": "x ${b} ${.e}", "f": 3, "g": [4, 3], "h": {"i": 5}}


def bomb(levels: int) -> dict[str, Any]:
    return {"a0": "x", **{f"a{i}": [f"${{a{i - 1}}}"] * 10 for i in range(1, levels)}}


@pytest.mark.parametrize(
    "raw",
    [
        bomb(40),
        {"a0": "x" * 1000, **{f"a{i}": f"${{a{i - 1}}}" * 10 for i in range(1, 40)}},
        {
            "top": {
                "a0": "x",
                **{f"a{i}": {"b": f"${{..a{i - 1}}}", "c": f"${{top.a{i - 1}}}"} for i in range(1, 60)},
            }
        },
    ],
)
def test_configurations_that_grow_without_end_are_refused(raw: dict[str, Any]) -> None:
    with pytest.raises(InputError, match="refers to itself without end"):
        check_size(raw)


def test_a_configuration_of_ordinary_size_is_not() -> None:
    check_size({**bomb(5), "self": "${self}", "lost": "${nowhere.at.all}"})


@pytest.mark.parametrize(
    "extra",
    [bomb(40), {"loop": "${pool}", "pool": "${loop}"}, {f"a{i}": f"${{a{i + 1}}}" for i in range(5000)}],
    ids=["bomb", "loop", "chain"],
)
def test_a_bundle_with_such_a_configuration_is_refused(toys: Toys, reviewer: Reviewer, extra: dict[str, Any]) -> None:
    def lure(entries: Entries) -> None:
        change_json(entries, "manifest.json", lambda manifest: manifest["raw"].update(extra))
        entries["config.yaml"] += "".join(f"{name}: x\n" for name in extra).encode()

    file = changed(bundled(toys), lure)
    with pytest.raises(InputError, match=r"without end|ecursi|not found|Interpolation"):
        reviewer.load(file)
    assert not reviewer.runs.exists()


def test_a_run_from_before_says_what_it_lacks(toys: Toys, reviewer: Reviewer) -> None:
    file = changed(bundled(toys), lambda e: change_json(e, "manifest.json", lambda manifest: manifest.pop("raw")))
    with pytest.raises(InputError, match="keeps no configuration that can be changed"):
        reviewer.load(file)


def test_the_command_line_runs_a_bundle(toys: Toys, reviewer: Reviewer, capsys: pytest.CaptureFixture[str]) -> None:
    file = bundled(toys)
    assert main(["run", str(file), f"paths.runs={reviewer.runs}"]) == 0
    assert "0 stages run, 4 from the store" in capsys.readouterr().out
    assert main(["run", str(file), f"paths.runs={reviewer.runs}", "graph.cut.most=2"]) == 0
    assert "2 stages run, 2 from the store" in capsys.readouterr().out
    for words, message in [
        (["nowhere.zip"], "there is no run or bundle nowhere.zip"),
        (["toy"], "did you mean '+experiment=toy'?"),
        ([str(file), "graph"], "'graph' is neither a command nor SETTING=VALUE"),
        ([str(file), "-m", "graph.cut.mots=1,2"], "did you mean 'most'?"),
    ]:
        assert main(["run", *words]) == 2
        assert message in capsys.readouterr().err
    assert main(["run", "+experiment=toy", f"paths.runs={reviewer.runs}"]) == 0


def test_a_bundle_is_swept_as_one_graph(toys: Toys, reviewer: Reviewer, capsys: pytest.CaptureFixture[str]) -> None:
    file = bundled(toys)
    toys.experiment.unlink()
    toys.forget()
    words = ["-m", "run", str(file), f"paths.runs={reviewer.runs}", "graph.cut.most=1,2,100"]
    assert main(words) == 0
    out = capsys.readouterr().out
    assert "3 points name 12 stages; 4 run, 4 from the store" in out
    (table,) = (reviewer.runs / "toy" / "sweeps").glob("*/table.csv")
    rows = list(csv.DictReader(table.open()))
    assert [(row["graph.cut.most"], float(row["mean_1_um"])) for row in rows] == [("1", 1), ("2", 2), ("100", 3)]
    assert f"-m run {file}" in table.with_name("report.html").read_text()
    for row in rows:
        alone = reviewer.load(file, f"graph.cut.most={row['graph.cut.most']}")
        assert str(alone.run(Silent()).path) == row["run"]
    assert main([*words[:-1], "graph.big.stage=glob(toy.[cs]*)", "graph.cut.most=1"]) == 0
    assert "toy.clip" in (capsys.readouterr().out)


def test_a_sweep_of_a_bundle_reaches_its_own_sections_and_takes_no_capture_unasked(
    rigged: Path, reviewer: Reviewer, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["-m", "run", str(rigged), f"paths.runs={reviewer.runs}"]
    reviewer.toys.forget()
    assert main([*words, "shared.much=3,4"]) == 0
    assert "2 points name 8 stages; 1 run, 4 from the store" in capsys.readouterr().out
    assert main([*words, "shared.mcuh=3,4"]) == 2
    assert "did you mean 'much'?" in capsys.readouterr().err
    assert main([*words, "rig=dim,bright"]) == 2
    assert "holds no such capture of 'shot'" in capsys.readouterr().err


def test_an_experiment_and_its_rerun_have_one_digest(rigged: Path, toys: Toys, reviewer: Reviewer) -> None:
    words = ["+experiment=toy", f"paths.runs={toys.folder / 'runs'}"]
    assert reviewer.load(rigged).digest == Experiment.load(words).digest
    assert reviewer.load(rigged, "rig=bright").digest == Experiment.load([*words, "rig=bright"]).digest
    assert first_recipe(entries_of(rigged)).startswith("store/recipes/")
