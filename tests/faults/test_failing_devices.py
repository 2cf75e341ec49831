"""A drive or a camera that fails on the way: its name and the cause are told, all is off, and no photograph is lost."""

from __future__ import annotations

import os
import random
import re
from collections import Counter
from collections.abc import Iterator

import pytest
from workshop import RIG, Tally, Warm, Workshop

from pipeline.cli import main

COUNT = 12
PHOTOS = Counter({f"photo_{15 * i}": 1 for i in range(COUNT)})
BETWEEN_5_AND_6 = 70.0

FAULTS = {
    "jam": r"emergency: following error: .* \(error code 0x8611\); it stands still at",
    "overheating": r"emergency: excess temperature of the drive \(error code 0x4210\); it stands still at",
    "broken": r"emergency: fault of the power stage \(error code 0x5400\); it stands still at",
    "stall": r"has not reached 75\.000 deg after \d\.\d+ s; it stands still at",
    "restart": r"has restarted by itself: look at its supply; it stands still at",
    "refusal": r"refuses to accept 90000 as target position: .* \(abort code 0x08000022\); it stands still at",
    "no heartbeat": r"its heartbeat is lost: nothing for \d\.\d+ s; it stands still at",
    "silence": r"does not answer; it could not be told to stop and may still move",
}
"""What goes wrong with the drive, and what the error says of it."""


@pytest.fixture
def bench(workshop: Workshop, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    """A workshop in which an experiment captures and fits."""
    nodes = {
        "photos": {"stage": "capture.polarizer_sequence", "rig": RIG, "count": COUNT},
        "fit": {"stage": "fit.cosine", "photos": "photos"},
    }
    workshop.experiment("capture", nodes, labelled=False)
    return workshop


def words(bench: Workshop) -> list[str]:
    return bench.words("executor=serial", experiment="capture")


def photos(bench: Workshop) -> Counter[str]:
    """How often each photograph was taken."""
    return Counter({word: count for word, count in bench.computed().items() if word.startswith("photo_")})


_UNDISTURBED: dict[str, str] = {}


@pytest.fixture
def undisturbed(bench: Workshop) -> dict[str, str]:
    """Digests of a capture that nothing disturbed, and of its fit; the same wherever it is made."""
    if not _UNDISTURBED:
        assert main(words(bench)) == 0
        assert photos(bench) == PHOTOS
        _UNDISTURBED.update(bench.artifacts("capture"))
        bench.start_again()
    return _UNDISTURBED


@pytest.fixture
def warm(bench: Workshop) -> Iterator[Warm]:
    """A process that forks one for each run, with all that devices need imported."""
    if not hasattr(os, "pidfd_open"):
        pytest.skip("this system has no descriptors of processes")
    with Warm(bench, "capture") as process:
        yield process


@pytest.mark.parametrize("fault", FAULTS)
def test_a_drive_that_fails(
    bench: Workshop,
    undisturbed: dict[str, str],
    tally: Tally,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    fault: str,
) -> None:
    monkeypatch.setenv("DRILL_DRIVE", f"{fault} at {BETWEEN_5_AND_6}")
    assert main(words(bench)) == 1
    said = capsys.readouterr().err
    assert re.search(rf"rotation mount \(node 1 on simulated-\d+\): {FAULTS[fault]}", said), said
    assert "Traceback" not in said
    assert bench.diary.read_text().split()[-2:] == ["standing", "light_off"]
    kept = photos(bench)
    assert 5 <= kept.total() < COUNT
    monkeypatch.delenv("DRILL_DRIVE")
    assert main(words(bench)) == 0
    assert photos(bench) == PHOTOS
    tally("drive that fails in a capture", 1, bench.artifacts("capture") != undisturbed)


def test_a_camera_that_fails(
    bench: Workshop,
    undisturbed: dict[str, str],
    tally: Tally,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("DRILL_CAMERA", "fail at 7")
    assert main(words(bench)) == 1
    assert "camera Drill does not take the photo: its battery is empty" in capsys.readouterr().err
    assert bench.diary.read_text().split()[-1] == "light_off"
    assert photos(bench) == Counter({f"photo_{15 * i}": 1 for i in range(6)})
    bench.diary.unlink()
    monkeypatch.delenv("DRILL_CAMERA")
    assert main(words(bench)) == 0
    assert photos(bench) == Counter({f"photo_{15 * i}": 1 for i in range(6, COUNT)})
    tally("camera that fails on photo 7 of 12", 1, bench.artifacts("capture") != undisturbed)


def test_a_capture_killed_after_photo_6_and_at_random_moments(
    bench: Workshop, undisturbed: dict[str, str], warm: Warm, tally: Tally
) -> None:
    status, _, _ = warm.run(["DRILL_CAMERA=kill at 7", *words(bench)])
    assert status == -9
    assert photos(bench).total() == 6
    status, _, said = warm.run(words(bench))
    assert status == 0, said
    assert photos(bench) == PHOTOS
    tally("SIGKILL after photo 6 of 12", 1, bench.artifacts("capture") != undisturbed)
    kill_at_random_moments(bench, undisturbed, warm, tally)


def kill_at_random_moments(bench: Workshop, undisturbed: dict[str, str], warm: Warm, tally: Tally) -> None:
    """A photograph may be lost that was being kept, never one that was kept before."""
    bench.start_again()
    status, whole_s, said = warm.run(words(bench))
    assert status == 0, said
    rng = random.Random(3)
    kills = lost = 0
    while kills < 20:
        bench.start_again()
        delays = [rng.uniform(0, whole_s) for _ in range(rng.randint(1, 4))]
        here = sum(warm.run(words(bench), kill_after_s=delay)[0] != 0 for delay in delays)
        status, _, said = warm.run(words(bench))
        assert status == 0, said
        again = photos(bench) - PHOTOS
        lost += again.total() > here or photos(bench) - again != PHOTOS or bench.artifacts("capture") != undisturbed
        kills += here
    tally("SIGKILL of a capture at a random moment", kills, lost)
