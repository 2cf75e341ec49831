"""Cleaning removes what no run needs, and nothing else."""

from __future__ import annotations

import shutil

import pytest
from toys import Toys

from pipeline.commands.clean import find_waste, remove
from pipeline.errors import InputError
from pipeline.storage.store import Store


def test_nothing_goes_while_every_run_is_kept(toys: Toys) -> None:
    toys.run()
    toys.run("graph.big.factor=5")
    waste = find_waste(toys.folder / "runs", Store(toys.folder / "runs" / ".store"))
    assert (waste.paths, waste.kept_runs) == ({}, 2)


def test_what_only_a_deleted_run_needed_goes(toys: Toys) -> None:
    kept = toys.run()
    gone = toys.run("graph.big.factor=5")
    shutil.rmtree(gone.path)
    runs, store = toys.folder / "runs", Store(toys.folder / "runs" / ".store")
    lost = {node.artifact for node in gone.nodes.values()} - {node.artifact for node in kept.nodes.values()}
    assert {p.name for p in find_waste(runs, store).paths if p.is_dir()} == lost
    assert all(store.object_folder(artifact).is_dir() for artifact in lost)
    waste = remove(runs, store)
    assert waste.bytes > 0
    assert not any(store.object_folder(artifact).is_dir() for artifact in lost)
    assert find_waste(runs, store).paths == {}
    assert toys.ran() == []
    assert toys.ran("graph.big.factor=5") == ["big", "cut", "means"]


def test_half_written_and_damaged_values_go(toys: Toys) -> None:
    run = toys.run()
    (run.store.root / "objects" / ".half").mkdir()
    run.store.set_aside(run.nodes["cut"].artifact)
    assert sorted(find_waste(toys.folder / "runs", run.store).paths.values()) == ["damaged", "half-written"]


def test_what_devices_captured_stays(toys: Toys) -> None:
    toys.graph("photo: {stage: toy.photo, camera: {device: lab.Webcam, light: {device: lab.Lamp}}}")
    run = toys.run()
    shutil.rmtree(run.path)
    remove(toys.folder / "runs", run.store)
    assert run.store.object_folder(run.nodes["photo"].artifact).is_dir()
    assert toys.ran() == []


def test_a_store_in_use_is_left_alone(toys: Toys) -> None:
    run = toys.run()
    shutil.rmtree(run.path)
    with run.store.in_use(), pytest.raises(InputError, match="is in use"):
        remove(toys.folder / "runs", run.store)
    assert run.store.object_folder(run.nodes["raw"].artifact).is_dir()


def test_the_command_shows_before_it_removes(toys: Toys, capsys: pytest.CaptureFixture[str]) -> None:
    from pipeline.cli import main

    shutil.rmtree(toys.run().path)
    place = f"paths.runs={toys.folder / 'runs'}"
    assert main(["clean", place]) == 0
    assert "could go, none removed" in capsys.readouterr().out
    assert main(["clean", "now", place]) == 0
    assert "removed" in capsys.readouterr().out
    assert main(["clean", "nwo", place]) == 2
    assert "did you mean 'now'?" in capsys.readouterr().err
