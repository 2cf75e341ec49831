"""Several processes on one store at once: all succeed, agree, compute nothing twice and leave nothing behind."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from workshop import Tally, Warm, Workshop

from pipeline.runs import open_run

OVERLAPPING = [[], ["graph.small.ms=1"], ["graph.still.seed=50"], [], ["graph.rough.ms=6"], ["until=whole"], []]
"""What each process of a crowd overrides: some run the same, others come to the same another way, or
share all but some stages."""


def left_behind(store: Path) -> list[Path]:
    """Temporary files and folders, values that were set aside, and locks but for the files that locks stand on."""
    hidden = [path for path in store.parent.rglob(".*") if path != store]
    temporary = [path for path in hidden if not (path.parent.name == "outputs" and path.suffix == ".json")]
    return [*temporary, *store.glob("damaged/*"), *(p for p in store.glob("locks/*") if p.name != "names")]


@pytest.mark.parametrize(("size", "rounds"), [(2, 20), (8, 5)])
def test_crowds(workshop: Workshop, warm: Warm, tally: Tally, size: int, rounds: int) -> None:
    lost = 0
    expected: dict[str, dict[str, str]] = {}
    for number in range(0, 3 * rounds, 3):
        workshop.start_again(forget=number % 15 == 0)
        overrides = [OVERLAPPING[(number + index) % len(OVERLAPPING)] for index in range(size)]
        answers = warm.run_all([workshop.words("executor.workers=2", *words) for words in overrides])
        assert [status for status, _, _ in answers] == [0] * size, [said for _, _, said in answers]
        runs = {path.parent.name: open_run(path.parent) for path in workshop.runs.glob("drill/*/manifest.json")}
        found = {name: {n.name: n.artifact for n in run.nodes.values()} for name, run in runs.items()}
        keys = Counter(name for name, _ in {(n.name, n.key) for r in runs.values() for n in r.nodes.values() if n.key})
        wrong = {
            "values": [name for name in found if found[name] != expected.setdefault(name, found[name])],
            "computed": workshop.computed() - keys,
            "not computed": keys - workshop.computed(),
            "left behind": left_behind(workshop.runs / ".store"),
            "no report": [name for name, run in runs.items() if not run.report.is_file()],
        }
        print({word: what for word, what in wrong.items() if what})
        lost += any(wrong.values())
        for artifact in {a for artifacts in found.values() for a in artifacts.values() if a}:
            workshop.store().get(artifact)
    tally(f"{size} processes at once, rounds of", rounds, lost)
