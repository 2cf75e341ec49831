"""Locks by name: one holder at a time, holders of other names not kept waiting, and few files left."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import pytest

from pipeline.storage import locks

pytestmark = pytest.mark.parametrize(
    "ranges",
    [
        pytest.param(True, marks=pytest.mark.skipif(not locks._RANGES, reason="this system has no locks of ranges")),
        False,
    ],
)


@pytest.fixture(autouse=True)
def kind(ranges: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(locks, "_RANGES", ranges)


def test_only_one_holds_a_name(tmp_path: Path) -> None:
    inside, most = 0, 0

    def work() -> None:
        nonlocal inside, most
        for _ in range(20):
            with locks.locked(tmp_path / "locks", "a"):
                inside += 1
                most = max(most, inside)
                time.sleep(0.001)
                inside -= 1

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert most == 1


def test_who_holds_one_name_keeps_nobody_from_another(tmp_path: Path) -> None:
    done = threading.Event()

    def work() -> None:
        with locks.locked(tmp_path, "b"):
            done.set()

    with locks.locked(tmp_path, "a"):
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        assert done.wait(5)
    thread.join()


def test_who_waits_gets_it_when_it_is_let_go(tmp_path: Path) -> None:
    done = threading.Event()

    def work() -> None:
        with locks.locked(tmp_path, "a"):
            done.set()

    with locks.locked(tmp_path, "a"):
        thread = threading.Thread(target=work, daemon=True)
        thread.start()
        assert not done.wait(0.05)
    assert done.wait(5)
    thread.join()


def test_files_do_not_grow_in_number(tmp_path: Path) -> None:
    for name in "abcdef":
        with locks.locked(tmp_path, name):
            pass
    assert len(list(tmp_path.iterdir())) <= 1
