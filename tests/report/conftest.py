from __future__ import annotations

from pathlib import Path

import pytest
from made_up_run import FakeNode, FakeRun, run_with, values_of_every_type

from pipeline.storage.artifact import DamagedArtifact


@pytest.fixture
def run(tmp_path: Path) -> FakeRun:
    """A run with a value of every type, all of it shown or written within a second."""
    return run_with(values_of_every_type(), tmp_path)


@pytest.fixture
def failed(run: FakeRun) -> FakeRun:
    """The same with a stage that failed, one that waits for it, one that is absent, and one whose value is damaged."""
    return (
        run.with_node(FakeNode("broken", status="failed", error="ValueError: no light", seconds=None, artifact=""))
        .with_node(FakeNode("waits", status="blocked", blocked_by=("broken",), inputs={"photos": ("broken",)}))
        .with_node(FakeNode("none", stage="", status="absent", reason="needs a simulated rig", seconds=None))
        .with_node(
            FakeNode("torn", type="PeriodMap", artifact="digest of torn", status="cached"),
            DamagedArtifact("torn: the stored value has changed"),
        )
    )
