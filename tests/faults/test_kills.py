"""SIGKILL at random moments: what was finished is kept, nothing half-written counts, and a rerun ends the same."""

from __future__ import annotations

import random

import pytest
from workshop import Tally, Warm, Workshop

from pipeline.runs import open_run

KILLED = -9


def kept(workshop: Workshop) -> dict[str, str]:
    """Text of every record that the store holds; all that bears its name is found to be whole."""
    store = workshop.store()
    for folder in (store.root / "objects").glob("[!.]*/*"):
        store.get(folder.name)
    for manifest in workshop.runs.glob("*/*/manifest.json"):
        open_run(manifest.parent)
    found = {path.stem: path.read_text() for path in (store.root / "recipes").glob("*/*.json")}
    for key in found:
        record = store.record(key)
        assert record is not None, f"the record {key} is half-written"
        store.get(record.artifact)
    return found


def reference(workshop: Workshop, warm: Warm) -> tuple[dict[str, str], float]:
    """Digests of an undisturbed run, and the seconds that one takes."""
    seconds = []
    for _ in range(4):
        workshop.start_again()
        status, spent, said = warm.run(workshop.words())
        assert status == 0, said
        seconds.append(spent)
    return workshop.artifacts(), min(seconds)


@pytest.mark.parametrize("seed", range(2))
def test_kills_at_random_moments(workshop: Workshop, warm: Warm, tally: Tally, seed: int) -> None:
    expected, whole_s = reference(workshop, warm)
    rng = random.Random(seed)
    kills = lost = 0
    while kills < 26:
        workshop.start_again(forget=rng.random() < 0.2)
        before: dict[str, str] = {}
        for _ in range(rng.randint(1, 4)):
            status, _, said = warm.run(workshop.words(), kill_after_s=rng.uniform(0, whole_s))
            assert status in {0, KILLED}, said
            kills += status == KILLED
            now = kept(workshop)
            lost += not now.items() >= before.items()
            before = now
        lost += not resumed(workshop, warm, before, expected)
    tally("SIGKILL at a random moment", kills, lost)


def resumed(workshop: Workshop, warm: Warm, before: dict[str, str], expected: dict[str, str]) -> bool:
    """Whether another run ends as an undisturbed one does, and computes nothing that had been kept."""
    computed = workshop.computed()
    status, _, said = warm.run(workshop.words())
    assert status == 0, said
    run, after = workshop.run(), workshop.computed()
    again = [node.name for node in run.nodes.values() if node.key in before and after[node.name] != computed[node.name]]
    artifacts = {name: node.artifact for name, node in run.nodes.items()}
    whole = run.report.read_text().rstrip().endswith("</html>")
    return not again and whole and kept(workshop).items() >= before.items() and artifacts == expected


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
        lost += not resumed(workshop, warm, kept(workshop), expected)
    tally("SIGKILL of a run and its processes", kills, lost)
