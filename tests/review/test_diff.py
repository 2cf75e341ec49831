"""Two runs side by side."""

from __future__ import annotations

import json
import math
import shutil
from pathlib import Path
from typing import Any

import pytest
from toys import Toys

from pipeline.cli import main
from pipeline.review.bundle import write_bundle
from pipeline.review.diff import NOTHING, NodeDifference, RunDifference, diff


def node(found: RunDifference, name: str) -> NodeDifference:
    return next(n for n in found.nodes if n.name == name)


def test_a_run_does_not_differ_from_itself(toys: Toys) -> None:
    run = toys.run()
    found = diff(run, run)
    assert (found.nodes, found.only_first, found.only_second, found.versions) == ((), (), (), {})
    assert found.identical == ("raw", "big", "cut", "means")
    assert found.metrics == {"mean_0_um": (1.0, 1.0), "mean_1_um": (3.0, 3.0)}


def test_settings_results_and_figures_are_set_side_by_side(toys: Toys) -> None:
    first, second = toys.run(), toys.run("graph.big.factor=5")
    found = diff(first, second)
    assert node(found, "big").settings == {"factor": (3.0, 5.0)}
    assert node(found, "big").value == ("period_um: 100 % of the elements differ, by up to 2 (relative 0.4)",)
    assert node(found, "cut").settings == {}
    assert found.identical == ("raw",)
    assert found.metrics["mean_1_um"] == (3.0, 5.0)
    text = str(found)
    assert "setting  factor: 3.0 -> 5.0" in text
    assert [line.split() for line in text.splitlines() if line.startswith("mean_1_um")] == [
        ["mean_1_um", "3", "5", "2"]
    ]
    assert [line.split() for line in text.splitlines() if line.startswith("mean_0_um")] == [
        ["mean_0_um", "1", "1", "0"]
    ]


def test_a_setting_without_effect_on_the_value_is_told(toys: Toys) -> None:
    found = diff(toys.run(), toys.run("graph.cut.most=50"))
    assert node(found, "cut").settings == {"most": (100.0, 50.0)}
    assert node(found, "cut").value == ()
    assert "  value    identical" in str(found)


def test_swapped_stages_and_other_inputs_are_told(toys: Toys) -> None:
    found = diff(toys.run(), toys.run("graph.cut.stage=toy.scale", "graph.means.maps=[raw]"))
    assert node(found, "cut").settings["stage"] == ("toy.clip", "toy.scale")
    assert node(found, "cut").settings["most"] == (100.0, NOTHING)
    assert node(found, "cut").settings["factor"] == (NOTHING, 2.0)
    assert node(found, "means").settings == {
        "inputs": ({"maps": ("raw", "cut"), "truth": ()}, {"maps": ("raw",), "truth": ()})
    }
    assert found.metrics["mean_1_um"] == (3.0, None)


def test_settings_of_devices_are_compared_one_by_one(toys: Toys) -> None:
    camera = "{{device: lab.Webcam, exposure_s: {s}, light: {{device: lab.Lamp}}}}"
    toys.graph(f"shot: {{stage: toy.photo, camera: {camera.format(s=0.1)}}}")
    first = toys.run()
    found = diff(first, toys.run("graph.shot.camera.exposure_s=0.5"))
    assert node(found, "shot").settings == {"camera.exposure_s": (0.1, 0.5)}


def test_nodes_of_one_only_are_named(toys: Toys) -> None:
    found = diff(toys.run(), toys.run("graph.more={stage: toy.clip, maps: raw}", "graph.means=null"))
    assert (found.only_first, found.only_second) == (("means",), ("more",))
    assert "only the second has: more" in str(found)


def test_edited_code_is_named(toys: Toys) -> None:
    first = toys.run()
    toys.helper.write_text(toys.helper.read_text().replace("array * factor", "array * factor * 1"))
    found = diff(first, toys.run(f"paths.runs={toys.folder / 'other'}"))
    assert node(found, "big").code == ("toybench.arithmetic",)
    assert node(found, "big").value == ()
    assert "code     toybench/arithmetic.py differs" in str(found)


def test_code_that_one_of_two_only_stands_on_is_told_apart(toys: Toys) -> None:
    first = toys.run()
    toys.helper.with_name("more.py").write_text("def twice(array):\n    return 2 * array\n")
    old = "from toybench.arithmetic import scaled\n"
    toys.stages.write_text(toys.stages.read_text().replace(old, old + "from toybench.more import twice\n"))
    second = toys.run(f"paths.runs={toys.folder / 'other'}")
    for found, of_one in ((diff(first, second), "code_second"), (diff(second, first), "code_first")):
        big = node(found, "big")
        assert getattr(big, of_one) == ("toybench.more",)
        assert "toybench.more" not in big.code
        assert "toybench.arithmetic" not in (*big.code, *big.code_first, *big.code_second)
    assert "  code     only the first stands on toybench/more.py" in str(found)


def test_versions_that_differ_are_listed(toys: Toys) -> None:
    from dataclasses import replace

    run = toys.run()
    other = replace(run, versions={**{k: v for k, v in run.versions.items() if k != "dask"}, "numpy": "9"})
    found = diff(run, other)
    assert found.versions == {"dask": (run.versions["dask"], ""), "numpy": (run.versions["numpy"], "9")}


def test_values_that_are_lost_or_were_never_made_are_said_to_be(toys: Toys) -> None:
    toys.graph("raw: {stage: toy.source}\nbig: {stage: toy.scale, maps: raw}")
    first = toys.run()
    failed = toys.run("graph.big.stage=toy.fails")
    assert node(diff(first, failed), "big").value == ("has value -> no value",)
    assert diff(failed, failed).identical == ("raw", "big")
    second = toys.run("graph.big.factor=9", f"paths.runs={toys.folder / 'other'}")
    shutil.rmtree(second.store.object_folder(second.node("big").artifact))
    assert "by how much cannot be said" in node(diff(first, second), "big").value[0]


def test_json_holds_it_all(toys: Toys, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = toys.run(), toys.run("graph.big.factor=5")
    file = write_bundle(second, tmp_path / "second.zip")
    assert main(["diff", "--json", str(first.path), str(file)]) == 0
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert found["second"] == str(file)
    assert found["metrics"]["mean_1_um"] == [3.0, 5.0]
    assert found["nodes"][0]["settings"] == {"factor": [3.0, 5.0]}


def test_figures_that_are_no_numbers_are_json_all_the_same(toys: Toys) -> None:
    from dataclasses import replace

    run = toys.run()
    found = diff(run, replace(run, metrics={"a": math.inf, "b": math.nan}))
    assert json.loads(found.to_json())["metrics"]["a"] == [None, "inf"]
    assert "inf" in str(found)


def test_the_command_takes_two_runs(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    run = toys.run()
    assert main(["diff", str(run.path), str(run.path)]) == 0
    out = capsys.readouterr().out.splitlines()
    assert out[0] == f"first:  {run.path}"
    assert out[2] == "identical: raw, big, cut, means"
    assert main(["diff", str(run.path)]) == 2
    assert main(["diff", str(run.path), "nowhere"]) == 2
    assert "there is no run in nowhere" in capsys.readouterr().err
