"""A store on an object store: others find there what was made here."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest
from toys import Toys

from pipeline.errors import InputError
from pipeline.storage.store import Store


@pytest.fixture
def remote(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "here"))
    return f"file://{tmp_path / 'far' / 'store'}"


def move_elsewhere(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Be another machine, with nothing in its cache."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "elsewhere"))
    shutil.rmtree(tmp_path / "elsewhere", ignore_errors=True)


def test_another_machine_finds_the_results(
    toys: Toys, remote: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    place = f"paths.store={remote}"
    assert toys.ran(place) == ["big", "cut", "means", "raw"]
    move_elsewhere(monkeypatch, tmp_path)
    again = toys.run(place)
    assert [node.status for node in again.nodes.values()] == ["cached"] * 4
    np.testing.assert_array_equal(again["big"].period_um, np.full((3, 3), 3.0, np.float32))
    assert toys.ran(place, "graph.big.factor=4") == ["big", "cut", "means"]


def test_only_what_is_needed_travels(toys: Toys, remote: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    toys.run(f"paths.store={remote}")
    move_elsewhere(monkeypatch, tmp_path)
    Store.at(remote).record("0" * 40)
    assert not list((tmp_path / "elsewhere").rglob("*.npy"))


def test_a_torn_upload_is_not_taken_for_whole(
    toys: Toys, remote: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    place = f"paths.store={remote}"
    run = toys.run(place)
    torn = tmp_path / "far" / "store" / "objects" / run.nodes["big"].artifact[:2] / run.nodes["big"].artifact
    (torn / "meta.json").unlink()
    move_elsewhere(monkeypatch, tmp_path)
    assert toys.ran(place) == ["big"]
    assert (torn / "meta.json").is_file()


def test_damage_on_the_far_side_is_mended(
    toys: Toys, remote: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    place = f"paths.store={remote}"
    run = toys.run(place)
    far = tmp_path / "far" / "store" / "objects" / run.nodes["big"].artifact[:2] / run.nodes["big"].artifact
    whole = (far / "period_um.npy").read_bytes()
    (far / "period_um.npy").write_bytes(whole[:-1] + b"?")
    move_elsewhere(monkeypatch, tmp_path)
    assert "big" in toys.ran(place, "graph.cut.most=7")
    assert (far / "period_um.npy").read_bytes() == whole


def test_an_unknown_protocol_is_refused(toys: Toys) -> None:
    with pytest.raises(InputError, match=r"store nowhere://x cannot be opened[\s\S]*paths.store"):
        toys.run("paths.store=nowhere://x")
