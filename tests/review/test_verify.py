"""Verification: what came out as it did, what did not, where that starts, and what cannot be known."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from toys import Toys

import pipeline
from pipeline.cli import main
from pipeline.errors import InputError
from pipeline.review.bundle import write_bundle
from pipeline.review.verification import Verification, verify
from pipeline.runs import Run

CAPTURE = """
    shot: {stage: toy.photo, camera: {device: lab.Webcam, light: {device: lab.Lamp}}}
    big: {stage: toy.scale, maps: shot}
    """


@pytest.fixture(autouse=True)
def own_temporary_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where temporary folders are made, to see that none stays."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


def verdicts(done: Verification) -> dict[str, str]:
    return {name: node.verdict for name, node in done.nodes.items()}


def edit(file: Path, before: str, after: str) -> None:
    text = file.read_text()
    assert before in text
    file.write_text(text.replace(before, after))


def files_of(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def test_an_unchanged_run_is_identical_and_nothing_is_left(toys: Toys, own_temporary_folder: Path) -> None:
    run = toys.run()
    before = files_of(toys.folder / "runs")
    done = pipeline.verify(run.path)
    assert verdicts(done) == dict.fromkeys(["raw", "big", "cut", "means"], "identical")
    assert (done.ok, done.culprits, done.versions, done.code) == (True, (), {}, {})
    assert files_of(toys.folder / "runs") == before
    assert list(own_temporary_folder.iterdir()) == []


def test_values_are_recomputed_and_not_looked_up(toys: Toys, tmp_path: Path) -> None:
    log = tmp_path / "spans.txt"
    toys.graph(f"raw: {{stage: toy.source}}\nslow: {{stage: toy.slow, maps: raw, name: a, log: {tmp_path}}}")
    run = toys.run()
    assert len(log.read_text().splitlines()) == 1
    verify(run.path)
    assert len(log.read_text().splitlines()) == 2


def test_an_edited_formula_is_found_with_its_place_and_amount(toys: Toys) -> None:
    run = toys.run()
    edit(toys.helper, "array * factor", "array * factor + np.float32(0.5)")
    edit(toys.helper, '"""Arithmetic of the toys."""', '"""Arithmetic."""\nimport numpy as np')
    done = verify(run.path)
    assert verdicts(done) == {"raw": "identical", "big": "different", "cut": "different", "means": "different"}
    assert done.culprits == ("big",)
    assert done.nodes["big"].differences[0].largest == 0.5
    assert done.nodes["cut"].changed_inputs == ("big",)
    assert done.nodes["cut"].alone == "identical"
    assert done.code == {"toybench.arithmetic": ("raw", "big", "cut", "means")}
    text = str(done)
    assert "period_um: 100 % of the elements differ, by up to 0.5 (relative 0.143)" in text
    assert "its inputs differ: big; on the run's own inputs: identical" in text
    assert "code differs: toybench/arithmetic.py" in text
    assert "deviations start at: big; 2 of the 2 that follow come out as then on the run's own inputs" in text


def test_a_second_culprit_behind_the_first_is_seen_on_the_runs_own_inputs(toys: Toys) -> None:
    run = toys.run()
    edit(toys.stages, "np.float32(factor)), maps.mask)", "np.float32(factor) + 1), maps.mask)")
    edit(
        toys.stages, "np.minimum(maps.period_um, np.float32(most))", "np.minimum(maps.period_um, np.float32(most)) + 2"
    )
    done = verify(run.path)
    assert done.culprits == ("big",)
    assert done.nodes["cut"].alone.startswith("different (period_um: 100 % of the elements differ, by up to 2")


@pytest.mark.parametrize(("tolerance", "verdict"), [("1e-3", "within tolerance"), ("1e-4", "different")])
def test_a_stage_may_state_a_tolerance(toys: Toys, tolerance: str, verdict: str) -> None:
    toys.graph("raw: {stage: toy.source}\nbig: {stage: toy.scale, maps: raw}")
    run = toys.run()
    edit(toys.stages, "np.float32(factor)), maps.mask)", "np.float32(factor + 2**-13)), maps.mask)")
    edit(toys.stages, "def scale(", f"_tolerance_scale = {{'period_um': {tolerance}}}\n\n\ndef scale(")
    done = verify(run.path)
    assert verdicts(done) == {"raw": "identical", "big": verdict}
    assert done.ok == (verdict == "within tolerance")
    assert f"by up to 0.000122 of {float(tolerance):g} allowed" in str(done)


def test_a_tolerance_that_changes_reruns_nothing_and_counts_at_once(toys: Toys) -> None:
    edit(toys.stages, "def scale(", "_tolerance_scale = {'period_um': 1e-4}\n\n\ndef scale(")
    run = toys.run("until=big")
    edit(toys.stages, "'period_um': 1e-4", "'period_um': 2e-3")
    assert toys.ran("until=big") == []
    assert "tolerances changed in toybench/stages/toy/maps.py" in toys.reasons("until=big")["big"]
    edit(toys.stages, "np.float32(factor)), maps.mask)", "np.float32(factor + 2**-13)), maps.mask)")
    assert verdicts(verify(run.path)) == {"raw": "identical", "big": "within tolerance"}
    edit(toys.stages, "'period_um': 2e-3", "'period_um': 1e-5")
    assert verdicts(verify(run.path)) == {"raw": "identical", "big": "different"}


@pytest.mark.parametrize("stated", ["{'period_um': 'any'}", "{'period_um': np.pi}", "1e-5"])
def test_an_impossible_tolerance_is_no_verdict(toys: Toys, stated: str) -> None:
    run = toys.run()
    edit(toys.stages, "np.float32(factor)), maps.mask)", "np.float32(factor) + 1), maps.mask)")
    edit(toys.stages, "def scale(", f"_tolerance_scale = {stated}\n\n\ndef scale(")
    with pytest.raises(InputError, match=r"the tolerance of toy\.scale is"):
        verify(run.path)


def test_a_run_that_moved_with_its_store_is_verified(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    elsewhere = tmp_path / "elsewhere"
    shutil.move(toys.folder / "runs", elsewhere)
    edit(toys.helper, "array * factor", "array * (factor + 1)")
    done = verify(elsewhere / "toy" / run.digest)
    assert done.nodes["big"].differences[0].largest == 1.0


def test_without_its_store_a_run_is_compared_by_digest(toys: Toys) -> None:
    run = toys.run()
    shutil.rmtree(run.store.root)
    assert set(verdicts(verify(run.path)).values()) == {"identical"}
    edit(toys.helper, "array * factor", "array * (factor + 1)")
    done = verify(run.path)
    assert verdicts(done)["big"] == "different"
    assert "only its digest could be compared" in done.nodes["big"].remark
    assert done.nodes["cut"].alone == "not at hand"


def test_a_stored_value_that_is_not_what_its_digest_says_is_different_and_left_alone(toys: Toys) -> None:
    run = toys.run()
    file = run.store.object_folder(run.node("big").artifact) / "period_um.npy"
    data = bytearray(file.read_bytes())
    data[-1] ^= 0x40
    file.write_bytes(data)
    done = verify(run.path)
    assert verdicts(done)["big"] == "different"
    assert "has changed since it was written" in done.nodes["big"].remark
    assert "its digest is that of the value recomputed" in done.nodes["big"].remark
    assert file.read_bytes() == bytes(data)


def test_captures_of_real_devices_are_taken_over_and_never_taken_again(toys: Toys) -> None:
    toys.graph(CAPTURE)
    run = toys.run()
    taken = sys.modules["toybench.devices.lab"].Webcam.taken
    edit(toys.devices, "Webcam.taken += 1", "raise RuntimeError('the camera moved')")
    done = verify(run.path)
    assert verdicts(done) == {"shot": "taken over", "big": "identical"}
    assert done.nodes["shot"].remark == "real devices captured it"
    assert taken == 1


def test_a_lost_capture_cannot_be_verified(toys: Toys) -> None:
    toys.graph(CAPTURE)
    run = toys.run()
    shutil.rmtree(run.store.object_folder(run.node("shot").artifact))
    with pytest.raises(InputError, match="'shot' cannot be recomputed, since real devices captured it"):
        verify(run.path)


def test_a_run_of_nothing_but_captures_cannot_be_verified(toys: Toys) -> None:
    toys.graph(CAPTURE.rsplit("big", 1)[0])
    with pytest.raises(InputError, match="can be recomputed here: shot came from real devices"):
        verify(toys.run().path)


def test_values_of_absent_files_are_taken_over(toys: Toys, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "a.txt").write_text("one")
    run = toys.run(f"graph.raw.folder={photos}")
    assert verdicts(verify(run.path))["raw"] == "identical"
    shutil.rmtree(photos)
    done = verify(run.path)
    assert verdicts(done) == {"raw": "taken over", "big": "identical", "cut": "identical", "means": "identical"}
    assert done.nodes["raw"].remark == "photos is not here"


def test_files_that_changed_since_are_named(toys: Toys, tmp_path: Path) -> None:
    edit(toys.stages, "np.full((size, size), value", "np.full((size, size), float((folder / 'a.txt').read_text())")
    (tmp_path / "a.txt").write_text("1")
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "a.txt").write_text("1")
    run = toys.run(f"graph.raw.folder={photos}")
    (photos / "a.txt").write_text("2")
    done = verify(run.path)
    assert done.nodes["raw"].remark == "files changed: folder"


def test_a_stage_that_fails_now_blocks_and_is_named(toys: Toys) -> None:
    run = toys.run()
    edit(toys.helper, "return array * factor", "raise RuntimeError('broken since')")
    done = verify(run.path)
    assert verdicts(done) == {"raw": "identical", "big": "failed", "cut": "failed", "means": "failed"}
    assert done.nodes["big"].remark == "RuntimeError: broken since"
    assert done.nodes["cut"].remark == "it waited for big"
    assert done.nodes["cut"].alone == "identical"
    assert not done.ok


def test_nodes_that_failed_in_the_run_are_not_taken_for_verified(toys: Toys) -> None:
    toys.graph(
        "raw: {stage: toy.source}\nbroken: {stage: toy.fails, maps: raw}\nafter: {stage: toy.clip, maps: broken}"
    )
    done = verify(toys.run().path)
    assert verdicts(done) == {"raw": "identical", "broken": "failed", "after": "failed"}
    assert "the run has no value of it: it is blocked there" in done.nodes["after"].remark


def test_versions_of_libraries_then_and_now_are_listed(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    run = toys.run()
    now = {**run.versions, "numpy": "9.9.9", "more": "1.0"}
    monkeypatch.setattr("pipeline.review.verification.versions", lambda: now)
    done = verify(run.path)
    assert done.versions == {"more": ("", "1.0"), "numpy": (np.__version__, "9.9.9")}
    assert f"numpy {np.__version__} -> 9.9.9" in str(done)


def test_the_runs_executor_and_folders_are_not_followed(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    config = run.path / "config.yaml"
    edit(config, "kind: threads", "kind: distributed\n  address: tcp://192.0.2.1:1")
    edit(config, f"runs: {toys.folder / 'runs'}", f"runs: {tmp_path / 'trap'}")
    assert verify(run.path).ok
    assert not (tmp_path / "trap").exists()


def test_a_stage_that_is_not_here_cannot_be_verified(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    run = toys.run()
    edit(toys.stages, "def scale(", "def rescale(")
    assert main(["verify", str(run.path)]) == 2
    assert "there is no stage 'toy.scale'" in capsys.readouterr().err


def run_and_bundle(toys: Toys, tmp_path: Path) -> tuple[Run, Path]:
    run = toys.run()
    return run, write_bundle(run, tmp_path / "toy.zip")


def test_a_bundle_is_verified_without_the_run(toys: Toys, tmp_path: Path, own_temporary_folder: Path) -> None:
    _, file = run_and_bundle(toys, tmp_path)
    shutil.rmtree(toys.folder / "runs")
    done = verify(file)
    assert set(verdicts(done).values()) == {"identical"}
    edit(toys.helper, "array * factor", "array * (factor + 1)")
    done = verify(file)
    assert done.nodes["big"].differences[0].largest == 1.0
    assert done.code == {"toybench.arithmetic": ("raw", "big", "cut", "means")}
    assert list(own_temporary_folder.iterdir()) == []
    assert not (toys.folder / "runs").exists()


def test_the_command_prints_a_line_a_node_and_its_status_says_the_rest(
    toys: Toys, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run, file = run_and_bundle(toys, tmp_path)
    for path in (run.path, file):
        assert main(["verify", str(path)]) == 0
        out = capsys.readouterr().out.splitlines()
        assert [line.split()[:3] for line in out[:2]] == [
            ["identical", "raw", "toy.source"],
            ["identical", "big", "toy.scale"],
        ]
        assert out[-1] == "4 identical"
    edit(toys.helper, "array * factor", "array * (factor + 1)")
    assert main(["verify", "--quiet", str(file)]) == 1
    assert "1 identical, 3 different; deviations start at: big" in capsys.readouterr().out
    for words in (["nowhere"], [], [str(toys.helper)]):
        assert main(["verify", *words]) == 2
    assert "there is no run in nowhere" in capsys.readouterr().err
