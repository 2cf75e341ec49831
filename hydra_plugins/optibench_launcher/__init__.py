"""The launcher that Hydra's sweepers talk to: it hands whole batches on, to be run as one graph.

Hydra takes plugins from the package ``hydra_plugins`` only, so it stands here.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol

from hydra.core.config_store import ConfigStore
from hydra.core.utils import JobReturn
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext


class Batches(Protocol):
    """Runs a batch of points, each given by its overrides."""

    def launch(self, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
        """Run them all, and say what came of each."""


class OneGraphLauncher(Launcher):
    """Hands each batch of points to the task function, which merges their graphs."""

    def setup(self, *, hydra_context: HydraContext, task_function: Any, config: Any) -> None:
        """Remember who runs batches."""
        self.batches: Batches = task_function

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[JobReturn]:
        """Run a batch."""
        return self.batches.launch(job_overrides)


ConfigStore.instance().store(
    group="hydra/launcher",
    name="optibench",
    node={"_target_": "hydra_plugins.optibench_launcher.OneGraphLauncher"},
    provider="optibench",
)
