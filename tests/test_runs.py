"""Running, rerunning, and knowing what has to run again."""

from __future__ import annotations

import numpy as np
import pytest
from toys import Toys

import pipeline
from pipeline.errors import InputError


def test_a_run_has_values_figures_and_seconds(toys: Toys) -> None:
    run = toys.run()
    np.testing.assert_array_equal(run["big"].period_um, np.full((3, 3), 3.0, np.float32))
    assert run.metrics == {"mean_0_um": 1.0, "mean_1_um": 3.0}
    assert run.seconds("big") >= 0
    assert run.nodes["raw"].warnings == ("made of nothing",)
    assert run.path == toys.folder / "runs" / "toy" / run.digest
    with pytest.raises(InputError, match="no node 'bug'"):
        run["bug"]


def test_figures_of_one_name_are_led_by_their_nodes_but_for_the_one_that_judges(toys: Toys) -> None:
    run = toys.run(
        "+graph.evaluate={stage: toy.mean, maps: [cut]}", "+graph.others={stage: toy.mean, maps: [big, raw]}"
    )
    assert run.metrics == {
        "mean_0_um": 3.0,  # of evaluate, and so of others
        "means.mean_0_um": 1.0,
        "means.mean_1_um": 3.0,
        "others.mean_1_um": 1.0,
    }


def test_a_report_of_another_version_is_drawn_anew(toys: Toys) -> None:
    run = toys.run()
    record = run.path / "outputs" / ".written.json"
    for text in ('{"format": 1, "nodes": {}}', "torn"):
        run.report.write_text("as it used to be")
        record.parent.mkdir(exist_ok=True)
        record.write_text(text)
        assert toys.ran() == []
        assert "as it used to be" not in run.report.read_text()
    run.report.write_text("as it is")
    toys.ran()
    assert run.report.read_text() == "as it is"


def test_values_are_read_only(toys: Toys) -> None:
    value = toys.run()["big"]
    with pytest.raises(ValueError, match="read-only"):
        value.period_um[0, 0] = 5


def test_a_second_run_computes_nothing(toys: Toys) -> None:
    assert toys.ran() == ["big", "cut", "means", "raw"]
    assert toys.ran() == []
    assert set(toys.reasons().values()) == {"cached: in the store"}


def test_a_setting_reruns_what_follows_it(toys: Toys) -> None:
    toys.run()
    assert toys.reasons("graph.big.factor=4")["big"] == "run: factor changed: 3.0 -> 4.0"
    assert toys.ran("graph.big.factor=4") == ["big", "cut", "means"]
    assert toys.ran("graph.big.factor=4.0") == []


def test_same_content_stops_the_ripple(toys: Toys) -> None:
    toys.run("graph.cut.most=2")
    assert toys.ran("graph.cut.most=2", "graph.big.factor=5") == ["big", "cut"]


def test_a_default_written_out_is_no_change(toys: Toys) -> None:
    toys.run()
    assert toys.ran("graph.big.mode=up") == []


def test_settings_that_a_swapped_stage_dropped_make_no_other_run(toys: Toys) -> None:
    swapped = toys.run("graph.big.stage=toy.clip")
    assert swapped.path != toys.run().path
    other = toys.experiment.read_text().replace("factor: 3", "factor: 4")
    toys.experiment.write_text(other)
    assert toys.run("graph.big.stage=toy.clip").path == swapped.path
    toys.experiment.write_text(other.replace("    factor: 4\n", ""))
    assert toys.run("graph.big.stage=toy.clip").path == swapped.path
    assert toys.run("graph.big.stage=toy.clip", "graph.big.most=3").path != swapped.path


def test_prose_reruns_nothing_and_why_says_so(toys: Toys) -> None:
    toys.run()
    toys.helper.write_text(toys.helper.read_text().replace("Scale.", "Multiply.").replace("# how", "# the way"))
    toys.stages.write_text(toys.stages.read_text().replace("Second paragraph.", "Another paragraph."))
    reasons = toys.reasons()
    assert "comments, docstrings or tolerances changed in toybench/arithmetic.py" in reasons["big"]
    assert toys.ran() == []


def test_a_helpers_formula_reruns_exactly_what_imports_it(toys: Toys) -> None:
    other = toys.stages.with_name("other.py")
    other.write_text(
        "from __future__ import annotations\n\nfrom pipeline.data.gratings import PeriodMap\n\n\n"
        'def same(maps: PeriodMap) -> PeriodMap:\n    """Give back."""\n    return maps\n'
    )
    toys.graph(
        """
        raw: {stage: toy.source}
        big: {stage: toy.scale, maps: raw}
        copy: {stage: toy.same, maps: big}
        """
    )
    toys.run()
    toys.helper.write_text(toys.helper.read_text().replace("array * factor", "array * factor + 1"))
    reasons = toys.reasons()
    assert reasons["raw"] == "run: code changed: toybench/arithmetic.py"
    assert reasons["big"].startswith("depends: if raw changes")
    run = toys.run()
    assert {n.name: n.status for n in run.nodes.values()} == {"raw": "ran", "big": "ran", "copy": "ran"}
    assert run["big"].period_um[0, 0] == 3
    toys.helper.write_text(toys.helper.read_text().replace("factor + 1", "factor + 2"))
    assert toys.reasons()["raw"].startswith("run")
    other.write_text(other.read_text().replace("return maps", "return PeriodMap(maps.period_um, maps.mask)"))
    toys.run()
    other.write_text(other.read_text().replace("maps.mask)", "maps.mask, maps.pixel_mm)"))
    assert toys.ran() == ["copy"]


def test_the_same_configuration_has_the_same_folder(toys: Toys) -> None:
    assert toys.run().path == toys.run().path
    assert toys.run("graph.big.factor=7").path != toys.run().path


def test_the_python_interface_runs_and_opens(toys: Toys) -> None:
    run = pipeline.run("toy", [f"paths.runs={toys.folder / 'runs'}", "graph.raw.value=2"])
    assert run.metrics["mean_0_um"] == 2
    again = pipeline.open_run(run.path)
    assert again.metrics == run.metrics
    np.testing.assert_array_equal(again["big"].period_um, run["big"].period_um)


def test_a_failure_blocks_only_what_waits_for_it(toys: Toys) -> None:
    toys.graph(
        """
        raw: {stage: toy.source}
        broken: {stage: toy.fails, maps: raw}
        after: {stage: toy.clip, maps: broken}
        last: {stage: toy.clip, maps: after}
        fine: {stage: toy.scale, maps: raw}
        """
    )
    with pytest.raises(pipeline.RunFailed, match="the toy broke") as caught:
        pipeline.run("toy", [f"paths.runs={toys.folder / 'runs'}"])
    run = caught.value.run
    statuses = {n.name: n.status for n in run.nodes.values()}
    assert statuses == {"raw": "ran", "broken": "failed", "after": "blocked", "last": "blocked", "fine": "ran"}
    assert run.nodes["last"].blocked_by == ("broken",)
    assert run["fine"].period_um[0, 0] == 2
    assert sorted(n.name for n in toys.run().nodes.values() if n.status == "cached") == ["fine", "raw"]


def test_serial_equals_threads(toys: Toys) -> None:
    threads = toys.run()
    serial = toys.run("executor=serial", f"paths.store={toys.folder / 'other'}")
    assert {n.name: n.artifact for n in threads.nodes.values()} == {n.name: n.artifact for n in serial.nodes.values()}
    assert threads.path == serial.path


def test_files_count_by_content(toys: Toys) -> None:
    photos = toys.folder / "photos"
    photos.mkdir()
    (photos / "a.txt").write_text("one")
    toys.run(f"graph.raw.folder={photos}")
    moved = photos.rename(toys.folder / "moved")
    assert toys.ran(f"graph.raw.folder={moved}") == []
    (moved / "a.txt").write_text("two")
    assert toys.reasons(f"graph.raw.folder={moved}")["raw"] == "run: files changed: folder"
    assert toys.ran(f"graph.raw.folder={moved}") == ["raw"]


def test_a_figure_changed_in_a_manifest_is_not_believed(toys: Toys) -> None:
    run = toys.run()
    manifest = run.path / "manifest.json"
    manifest.write_text(manifest.read_text().replace('"mean_1_um": 3.0', '"mean_1_um": 8.0'))
    with pytest.raises(pipeline.errors.PipelineError, match="it is not what was written"):
        pipeline.open_run(run.path)
    assert toys.run().metrics["mean_1_um"] == 3
    assert pipeline.open_run(run.path).metrics == run.metrics


def test_a_default_changed_in_what_is_remembered_of_the_sources_is_not_believed(toys: Toys) -> None:
    toys.run()
    memory = toys.folder / "runs" / ".store" / "memory" / "sources.json"
    assert '"default": 100.0' in memory.read_text()
    memory.write_text(memory.read_text().replace('"default": 100.0', '"default": 2.0'))
    assert toys.run()["cut"].period_um[0, 0] == 3


def test_a_lost_listing_of_code_is_written_again(toys: Toys) -> None:
    run = toys.run()
    (listing,) = {run.store.record(n.key).code for n in run.nodes.values()}
    run.store.provenance_file(listing).write_text("{")
    toys.run("graph.big.factor=4")
    assert toys.load().store.provenance(listing)


def test_a_report_of_older_values_does_not_outlive_a_run_that_died_before_its_own(
    toys: Toys, monkeypatch: pytest.MonkeyPatch
) -> None:
    toys.run()
    toys.helper.write_text(toys.helper.read_text().replace("array * factor", "array * factor + 1"))

    def die(run: pipeline.Run) -> None:
        raise SystemExit("killed")

    with monkeypatch.context() as patch:
        patch.setattr("pipeline.report.write", die)
        with pytest.raises(SystemExit, match="killed"):
            toys.run()
    monkeypatch.setattr("pipeline.report.write", lambda run: run.report.write_text(f"big {run['big'].period_um[0, 0]}"))
    assert toys.run().report.read_text() == "big 4.0"
