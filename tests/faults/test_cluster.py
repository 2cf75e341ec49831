"""Workers of a cluster killed in the middle of a stage: another one takes it over, and the run ends as it should."""

from __future__ import annotations

import pytest
from workshop import Tally, Workshop

from pipeline.bench import Experiment
from pipeline.execution.outcome import Silent
from pipeline.runs import Run

KILLS = 6


def carried_out(workshop: Workshop, *words: str) -> Run:
    return Experiment.load(workshop.words(*words, experiment="deadly")[1:], [workshop.configs]).run(Silent())


def test_killed_workers(workshop: Workshop, tally: Tally) -> None:
    pytest.importorskip("distributed")
    deadly = {
        f"deadly{i}": {"stage": "drill.perish", "maps": "raw", "seed": i, "once": str(workshop.folder / f"dead{i}")}
        for i in range(KILLS)
    }
    after = {f"after{i}": {"stage": "drill.blend", "maps": [f"deadly{i}"], "seed": i} for i in range(KILLS)}
    fit = {"stage": "drill.mean", "maps": list(after)}
    workshop.experiment("deadly", {"raw": {"stage": "drill.make"}, **deadly, **after, "fit": fit})
    run = carried_out(workshop, "executor=distributed", "executor.workers=2", "executor.dashboard=false")
    assert {node.status for node in run.nodes.values()} <= {"ran", "cached"}, [n.error for n in run.nodes.values()]
    computed = workshop.computed()
    killed = sum((workshop.folder / f"dead{i}").exists() for i in range(KILLS))
    lost = sum(computed[name] != (2 if name in deadly else 1) for name in run.nodes)
    artifacts = workshop.artifacts("deadly")
    serial = carried_out(workshop, "executor=serial", f"paths.store={workshop.folder / 'another'}")
    lost += artifacts != {node.name: node.artifact for node in serial.nodes.values()}
    tally("worker of a cluster killed in a stage", killed, lost)
