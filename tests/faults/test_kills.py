"""SIGKILL at random moments: what was finished is kept, nothing half-written counts, and a rerun ends the same."""

from __future__ import annotations

import random

import pytest
from workshop import Tally, Warm, Workshop

from pipeline.runs import open_run

KILLED = -9


def finished(workshop: Workshop) -> dict[str, str]:
    """Text of every record that the store holds with its value, each value found to be what its digest says."""
    store = workshop.store()
    found = {}
    for path in (store.root / "recipes").glob("*/*.json"):
        record = store.find(path.stem)
        assert record is not None, f"{path} is half-written"
        store.get(record.artifact)
        found[path.stem] = path.read_text()
    return found


def nothing_torn(workshop: Workshop) -> None:
    """Every value and every manifest that bears its name is whole."""
    store = workshop.store()
    for folder in (store.root / "objects").glob("[!.]*/*"):
        store.get(folder.name)
    for manifest in workshop.runs.glob("*/*/manifest.json"):
        open_run(manifest.parent)


def reference(workshop: Workshop, warm: Warm) -> tuple[dict[str, str], float]:
    """Digests of an undisturbed run, and the seconds that one takes."""
    seconds = []
    for _ in range(4):
        workshop.start_again()
        status, spent, said = warm.run(workshop.words())
        assert status == 0, said
        seconds.append(spent)
    return workshop.artifacts(), min(seconds)


@pytest.mark.parametrize("seed", range(4))
def test_kills_at_random_moments(workshop: Workshop, warm: Warm, tally: Tally, seed: int) -> None:
    expected, whole_s = reference(workshop, warm)
    rng = random.Random(seed)
    kills = lost = 0
    while kills < 30:
        workshop.start_again(forget=rng.random() < 0.2)
        kept: dict[str, str] = {}
        for _ in range(rng.randint(1, 4)):
            status, _, said = warm.run(workshop.words(), kill_after_s=rng.uniform(0, whole_s))
            assert status in {0, KILLED}, said
            kills += status == KILLED
            nothing_torn(workshop)
            now = finished(workshop)
            lost += not now.items() >= kept.items()
            kept = now
        lost += not resumed(workshop, warm, kept, expected)
    tally("SIGKILL at a random moment", kills, lost)


def resumed(workshop: Workshop, warm: Warm, kept: dict[str, str], expected: dict[str, str]) -> bool:
    """Whether another run ends as an undisturbed one does, and computes nothing that had been kept."""
    before = workshop.computed()
    status, _, said = warm.run(workshop.words())
    assert status == 0, said
    run, after = workshop.run(), workshop.computed()
    again = [node.name for node in run.nodes.values() if node.key in kept and after[node.name] != before[node.name]]
    whole = run.report.read_text().rstrip().endswith("</html>")
    return not again and whole and finished(workshop).items() >= kept.items() and workshop.artifacts() == expected


def test_kills_of_a_run_and_its_processes(workshop: Workshop, warm: Warm, tally: Tally) -> None:
    words = workshop.words("executor=processes", "executor.workers=2")
    expected, _ = reference(workshop, warm)
    workshop.start_again()
    _, whole_s, said = warm.run(words)
    assert "report: " in said, said
    rng = random.Random(99)
    kills = lost = 0
    while kills < 10:
        workshop.start_again()
        status, _, said = warm.run(words, kill_after_s=rng.uniform(0.2 * whole_s, whole_s))
        assert status in {0, KILLED}, said
        kills += status == KILLED
        nothing_torn(workshop)
        lost += not resumed(workshop, warm, finished(workshop), expected)
    tally("SIGKILL of a run and its processes", kills, lost)
