"""Every executor gives what the serial one gives, and stages keep out of each other's way where they must."""

from __future__ import annotations

import re
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest
from toys import Toys

from pipeline.errors import InputError
from pipeline.execution.executors import executor_of
from pipeline.execution.outcome import Silent

EXECUTORS = {
    "threads": ["executor=threads", "executor.workers=3"],
    "processes": ["executor=processes", "executor.workers=2"],
    "distributed": ["executor=distributed", "executor.workers=2", "executor.dashboard=false"],
}

GRAPH = """\
raw: {stage: toy.source, size: 3}
left: {stage: toy.scale, maps: raw, factor: 2}
right: {stage: toy.scale, maps: raw, factor: 5}
broken: {stage: toy.fails, maps: left}
waits: {stage: toy.clip, maps: broken}
means: {stage: toy.mean, maps: [left, right]}
"""


class Log(Silent):
    """Remembers what it hears."""

    def __init__(self) -> None:
        self.heard: dict[str, list[str]] = defaultdict(list)

    def started(self, name: str) -> None:
        self.heard[name].append("started")

    def ended(self, outcome: object) -> None:
        self.heard[outcome.name].append(outcome.status)  # type: ignore[attr-defined]


@pytest.mark.parametrize("words", EXECUTORS.values(), ids=EXECUTORS)
def test_every_executor_gives_what_the_serial_one_gives(toys: Toys, words: list[str], tmp_path: Path) -> None:
    toys.graph(GRAPH)
    log = Log()
    run = toys.load(*words).run(log)
    serial = toys.load("executor=serial", f"paths.store={tmp_path / 'another'}").run(Silent())
    assert {n.name: n.artifact for n in run.nodes.values()} == {n.name: n.artifact for n in serial.nodes.values()}
    assert {n.name: n.status for n in run.nodes.values()} == {
        **dict.fromkeys(("raw", "left", "right", "means"), "ran"),
        "broken": "failed",
        "waits": "blocked",
    }
    assert run.nodes["waits"].blocked_by == ("broken",)
    assert "RuntimeError: the toy broke" in run.nodes["broken"].error
    assert run.nodes["raw"].warnings == ("made of nothing",)
    np.testing.assert_array_equal(run["right"].period_um, np.full((3, 3), 5.0, np.float32))
    assert log.heard["left"] == ["started", "ran"]
    assert log.heard["waits"] == ["blocked"]


@pytest.mark.parametrize("words", EXECUTORS.values(), ids=EXECUTORS)
def test_a_worker_that_dies_takes_nothing_with_it_but_its_stage(toys: Toys, words: list[str]) -> None:
    if words[0] == "executor=threads":
        pytest.skip("threads die with their process")
    toys.graph(
        """\
        raw: {stage: toy.source}
        deadly: {stage: toy.kills_its_process, maps: raw}
        after: {stage: toy.clip, maps: deadly}
        """
    )
    run = toys.run(*words)
    assert (run.nodes["deadly"].status, run.nodes["after"].status) == ("failed", "blocked")
    np.testing.assert_array_equal(run["raw"].period_um, np.ones((4, 4), np.float32))
    assert "died" in run.nodes["deadly"].error
    assert run.nodes["after"].blocked_by == ("deadly",)


def test_only_the_stage_that_kills_workers_is_blamed_for_it(toys: Toys) -> None:
    """Dask blames whatever waits on a worker when it dies."""
    others = "\n".join(f"other{i}: {{stage: toy.scale, maps: raw, factor: {i + 2}}}" for i in range(6))
    toys.graph(
        f"""\
raw: {{stage: toy.source}}
deadly: {{stage: toy.kills_its_process, maps: raw}}
waits: {{stage: toy.clip, maps: deadly}}
{others}
"""
    )
    run = toys.run("executor=distributed", "executor.workers=1", "executor.dashboard=false")
    assert {name: node.status for name, node in run.nodes.items() if node.status not in {"ran", "cached"}} == {
        "deadly": "failed",
        "waits": "blocked",
    }
    assert "died" in run.nodes["deadly"].error
    assert run.nodes["waits"].blocked_by == ("deadly",)


def test_a_cluster_whose_workers_do_not_come_back_is_started_anew(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    """Dask's nannies give up when a worker takes too long to start, and dask then waits for ever."""

    async def gives_up(nanny: object, code: int) -> None:
        return

    monkeypatch.setattr("distributed.nanny.Nanny._on_worker_exit", gives_up)
    monkeypatch.setattr("pipeline.execution.executors._DESERTED_S", 1.0)
    monkeypatch.setattr("pipeline.execution.executors._ATTEMPTS", 2)
    toys.graph(
        f"""\
        raw: {{stage: toy.source}}
        once: {{stage: toy.kills_its_process, maps: raw, unless: {toys.folder / "dead"}}}
        always: {{stage: toy.kills_its_process, maps: once}}
        after: {{stage: toy.clip, maps: always}}
        besides: {{stage: toy.clip, maps: once}}
        """
    )
    run = toys.run("executor=distributed", "executor.workers=1", "executor.dashboard=false")
    assert {name: node.status for name, node in run.nodes.items() if node.status not in {"ran", "cached"}} == {
        "always": "failed",
        "after": "blocked",
    }
    assert "no worker of the cluster stays alive" in str(run.nodes["always"].error)


def test_a_dead_worker_of_a_cluster_is_replaced(toys: Toys) -> None:
    toys.graph(
        f"""\
        raw: {{stage: toy.source}}
        once: {{stage: toy.kills_its_process, maps: raw, unless: {toys.folder / "dead"}}}
        """
    )
    assert toys.run(*EXECUTORS["distributed"]).nodes["once"].status == "ran"
    assert (toys.folder / "dead").is_file()


def spans(toys: Toys) -> dict[str, tuple[float, float]]:
    lines = (toys.folder / "spans.txt").read_text().splitlines()
    found = (re.fullmatch(r"(\w+) ([\d.]+) ([\d.]+)", line) for line in lines)
    return {m[1]: (float(m[2]), float(m[3])) for m in found if m}


def overlap(one: tuple[float, float], other: tuple[float, float]) -> bool:
    return one[0] < other[1] and other[0] < one[1]


@pytest.mark.parametrize("words", EXECUTORS.values(), ids=EXECUTORS)
def test_large_stages_do_not_run_side_by_side(toys: Toys, words: list[str]) -> None:
    toys.graph(
        f"""\
        raw: {{stage: toy.source}}
        a: {{stage: toy.slow, maps: raw, name: a, log: {toys.folder}, resources: {{memory_gb: 6}}}}
        b: {{stage: toy.slow, maps: raw, name: b, log: {toys.folder}, resources: {{memory_gb: 6}}}}
        """
    )
    assert not toys.run(*words, "executor.memory_gb=8").failed
    found = spans(toys)
    assert not overlap(found["a"], found["b"])


def test_stages_side_by_side_share_the_cores(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.execution.workbench.cores", lambda: 8)
    lines = [
        f"{n}: {{stage: toy.waits_for_others, maps: raw, count: 4, folder: {toys.folder}, name: {n}}}" for n in "abcd"
    ]
    toys.graph("\n".join(["raw: {stage: toy.source}", *lines]))
    run = toys.run("executor=threads", "executor.workers=4")
    assert not run.failed
    assert sorted(run[name].period_um[0, 0] for name in "abcd")[0] == 2  # the last of four to begin


def test_an_exclusive_stage_runs_alone_and_small_ones_together(toys: Toys) -> None:
    lines = [f"{n}: {{stage: toy.slow, maps: raw, name: {n}, log: {toys.folder}" for n in "abcd"]
    needs = ["", "", ", resources: {exclusive: true}", ", resources: {memory_gb: 1}"]
    toys.graph("\n".join(["raw: {stage: toy.source}", *(f"{a}{b}}}" for a, b in zip(lines, needs, strict=True))]))
    assert not toys.run("executor=threads", "executor.workers=4", "executor.memory_gb=8").failed
    found = spans(toys)
    assert not any(overlap(found["c"], found[n]) for n in "abd")
    assert any(overlap(found[a], found[b]) for a, b in ("ab", "ad", "bd"))


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("graph.raw.resources={memory: 3}", "there is no resource 'memory'"),
        ("graph.raw.resources=big", "'resources' is 'big'"),
        ("graph.raw.resources={exclusive: 2}", "exclusive is 2"),
        ("executor.memory_gb=-1", "memory_gb is -1"),
        ("executor.workers=0", "workers is 0"),
        ("executor.workerz=2", "has no setting 'workerz'"),
        ("executor.kind=thread", "no executor of kind 'thread'"),
    ],
)
def test_wrong_resources_are_refused(toys: Toys, word: str, message: str) -> None:
    from pipeline.errors import PipelineError

    with pytest.raises(PipelineError, match=re.escape(message)):
        toys.run(word)


def test_a_scheduler_that_does_not_answer_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.execution.executors._ANSWER_S", 1.0)
    executor = executor_of({"kind": "distributed", "address": "tcp://127.0.0.1:9"})
    with pytest.raises(InputError, match=r"no dask scheduler answers at tcp://127\.0\.0\.1:9"), executor._client():  # type: ignore[attr-defined]
        pass
