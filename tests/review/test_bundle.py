"""Bundles: whole, the same bytes for the same run, nothing of the machine in them, readable as RO-Crates."""

from __future__ import annotations

import json
import os
import re
import subprocess
import time
import zipfile
from pathlib import Path

import numpy as np
import pytest
from bundles import entries_of
from toys import Toys

from pipeline.cli import main
from pipeline.errors import InputError
from pipeline.review.bundle import without_places, write_bundle
from pipeline.review.unpack import opened
from pipeline.runs import open_run
from pipeline.storage.keys import digest_bytes
from pipeline.storage.sealed import unsealed


def test_a_bundle_holds_all_of_a_run(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    (run.path / "outputs" / "raw.csv").write_text("1,2")
    entries = entries_of(write_bundle(run, tmp_path / "toy.zip"))
    assert {
        "README.txt",
        "config.yaml",
        "environment.json",
        "manifest.json",
        "outputs/raw.csv",
        "report.html",
        "ro-crate-metadata.json",
        "source/toybench/arithmetic.py",
        "source/toybench/stages/__init__.py",
        "source/toybench/stages/toy/maps.py",
    } <= set(entries)
    assert not any(".written" in name for name in entries)
    for node in run.nodes.values():
        assert f"store/objects/{node.artifact[:2]}/{node.artifact}/meta.json" in entries
        record = unsealed(entries[f"store/recipes/{node.key[:2]}/{node.key}.json"])
        assert record["artifact"] == node.artifact
        assert f"store/provenance/{record['code']}.json" in entries
        assert f"store/provenance/{record['versions']}.json" in entries
    assert entries["source/toybench/arithmetic.py"] == toys.helper.read_bytes()
    assert b"python -m pipeline verify BUNDLE.zip" in entries["README.txt"]
    assert b"python -m pipeline run BUNDLE.zip" in entries["README.txt"]


def test_the_environment_is_that_of_the_run(toys: Toys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    run = toys.run()
    monkeypatch.setattr("pipeline.bench.environment", lambda: {"python": "9.9"})
    found = json.loads(entries_of(write_bundle(run, tmp_path / "toy.zip"))["environment.json"])
    assert found["distributions"]["numpy"] == np.__version__
    assert found["commit"] == run.commit.partition(" ")[0]
    assert found["local_changes"] == run.commit.endswith("with local changes")


def test_the_same_run_gives_the_same_bytes(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    first = write_bundle(run, tmp_path / "first.zip")
    for path in run.path.rglob("*"):
        os.utime(path, (1e9, 1e9))
    time.sleep(2.1)  # zip files tell times in steps of two seconds
    second = write_bundle(open_run(run.path), tmp_path / "second.zip")
    assert first.read_bytes() == second.read_bytes()
    with zipfile.ZipFile(first) as bundle:
        assert bundle.namelist() == sorted(bundle.namelist())


def test_no_place_of_the_machine_is_in_it(toys: Toys, tmp_path: Path) -> None:
    photos = tmp_path / "photos"
    photos.mkdir()
    (photos / "a.txt").write_text("one")
    run = toys.run(f"graph.raw.folder={photos}", f"paths.store={tmp_path / 'kept'}", "executor.workers=1")
    assert str(tmp_path) in (run.path / "manifest.json").read_text()
    entries = entries_of(write_bundle(run, tmp_path / "toy.zip"))
    for name, data in entries.items():
        assert str(tmp_path).encode() not in data, name
    manifest = unsealed(entries["manifest.json"])
    assert manifest["command"] == "python -m pipeline +experiment=toy graph.raw.folder=photos"
    assert manifest["store"] == "store"
    assert "executor" not in manifest["raw"]
    assert manifest["raw"]["graph"]["raw"]["folder"] == "photos"


def test_absolute_paths_are_reduced_to_names() -> None:
    content = {"a": "/home/me/photos", "b": ["rig.folder=/home/me/photos"], "c": "a/b", "d": 3, "e": "x=y"}
    assert without_places(content) == {"a": "photos", "b": ["rig.folder=photos"], "c": "a/b", "d": 3, "e": "x=y"}


def test_it_is_an_ro_crate(toys: Toys, tmp_path: Path) -> None:
    from rocrate.rocrate import ROCrate

    run = toys.run()
    crate = ROCrate(write_bundle(run, tmp_path / "toy.zip"))
    metadata = crate.dereference("ro-crate-metadata.json")
    assert metadata["conformsTo"] == "https://w3id.org/ro/crate/1.1" or metadata["conformsTo"].id.endswith("/crate/1.1")
    assert crate.name == f"Run {run.digest} of the experiment toy"
    assert crate.root_dataset["datePublished"] == run.finished
    (action,) = crate.get_by_type("CreateAction")
    assert action["instrument"]["softwareVersion"] == run.versions["optibench"]
    assert {result["identifier"] for result in action["result"]} == {n.artifact for n in run.nodes.values()}


def test_an_unpacked_bundle_is_a_run(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    with zipfile.ZipFile(write_bundle(run, tmp_path / "toy.zip")) as bundle:
        bundle.extractall(tmp_path / "unpacked")
    np.testing.assert_array_equal(open_run(tmp_path / "unpacked")["big"].period_um, run["big"].period_um)
    with opened(tmp_path / "toy.zip") as inside:
        assert inside.metrics == run.metrics
        np.testing.assert_array_equal(inside["big"].period_um, run["big"].period_um)
        place = inside.path
    assert not place.exists()


def test_source_that_changed_since_comes_from_its_history(toys: Toys, tmp_path: Path) -> None:
    def git(*words: str) -> str:
        who = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        return subprocess.run(
            ["git", *who, *words], cwd=toys.package, check=True, capture_output=True, text=True
        ).stdout

    git("init", "-q")
    git("add", ".")
    git("commit", "-qm", "One")
    commit = git("rev-parse", "HEAD").strip()
    original = toys.helper.read_bytes()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.bench.commit", lambda: commit)
        run = toys.run()
    toys.helper.write_text("pass\n")
    entries = entries_of(write_bundle(run, tmp_path / "toy.zip"))
    assert entries["source/toybench/arithmetic.py"] == original
    assert b"not in here any more" not in entries["README.txt"]


def test_source_that_is_lost_is_named(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    toys.helper.write_text("pass\n")
    entries = entries_of(write_bundle(run, tmp_path / "toy.zip"))
    assert "source/toybench/arithmetic.py" not in entries
    assert b"not in here any more: toybench.arithmetic" in entries["README.txt"]


def test_a_commit_that_is_none_is_not_given_to_git(toys: Toys, tmp_path: Path) -> None:
    trap = tmp_path / "trap"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.bench.commit", lambda: f"--output={trap}")
        run = toys.run()
    toys.helper.write_text("pass\n")
    write_bundle(run, tmp_path / "toy.zip")
    assert not list(tmp_path.glob("trap*"))


def test_a_lost_value_is_no_bundle(toys: Toys, tmp_path: Path) -> None:
    run = toys.run()
    (run.store.object_folder(run.node("raw").artifact) / "mask.npy").unlink()
    with pytest.raises(InputError, match="the value of node 'raw' is lost or damaged"):
        write_bundle(run, tmp_path / "toy.zip")
    assert not list(tmp_path.glob("*toy.zip*"))


def test_large_arrays_that_shrink_suspiciously_are_stored_plain(
    toys: Toys, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = toys.run("graph.raw.size=300")
    monkeypatch.setattr("pipeline.review.bundle.SUSPICIOUS_BYTES", 100_000)
    monkeypatch.setattr("pipeline.review.unpack.SUSPICIOUS_BYTES", 100_000)
    file = write_bundle(run, tmp_path / "toy.zip")
    with zipfile.ZipFile(file) as bundle:
        kinds = {Path(i.filename).name: i.compress_type for i in bundle.infolist() if i.filename.endswith(".npy")}
    assert kinds == {"period_um.npy": zipfile.ZIP_STORED, "mask.npy": zipfile.ZIP_DEFLATED}
    with opened(file) as inside:
        assert inside["raw"].period_um.shape == (300, 300)


def test_the_command_writes_a_bundle_and_nothing_over_it(
    toys: Toys, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = toys.run()
    file = tmp_path / "toy.zip"
    assert main(["bundle", str(run.path), str(file)]) == 0
    assert capsys.readouterr().out.strip() == str(file)
    before = digest_bytes(file.read_bytes())
    assert main(["bundle", str(run.path), str(file)]) == 2
    assert re.search("there is a file .*toy.zip already", capsys.readouterr().err)
    assert digest_bytes(file.read_bytes()) == before
    assert main(["bundle", str(run.path)]) == 2
    assert main(["bundle", str(run.path), str(tmp_path / "nowhere" / "toy.zip")]) == 2
