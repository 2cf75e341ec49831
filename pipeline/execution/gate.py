"""A gate that lets through the stages whose needs of a machine fit at the same time."""

from __future__ import annotations

import math
import os
import tempfile
import time
import uuid
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from pipeline.graph.nodes import Needs
from pipeline.storage.locks import alone, shared

_PARTS = 32
_LOOK_AGAIN_S = 0.02


@dataclass(frozen=True)
class Gate:
    """Lets stages of a run pass while their needs fit together, whichever process of a machine they run in.

    It stands on locks in the machine's folder for temporary files, which a killed process loses. Who waits at the gate
    keeps later ones waiting, so that a large stage gets its turn.

    Attributes
    ----------
    name : str
        The run's own.
    memory_gb : float
        Memory of the machine that may be used.
    """

    name: str
    memory_gb: float

    @classmethod
    def new(cls, memory_gb: float | None = None) -> Gate:
        """A gate for one run; by default it deals out the machine's whole memory."""
        return cls(uuid.uuid4().hex, memory_gb or machine_memory_gb())

    @contextmanager
    def passing(self, needs: Needs) -> Iterator[None]:
        """Wait until there is room, and hold it inside the block."""
        folder = Path(tempfile.gettempdir()) / f"optibench-gate-{os.getuid()}-{self.name}"
        with ExitStack() as held:
            with alone(folder / "turnstile"):
                held.enter_context((alone if needs.exclusive else shared)(folder / "machine"))
                wanted = min(math.ceil(_PARTS * needs.memory_gb / self.memory_gb), _PARTS)
                for _ in range(wanted):
                    _take_part(folder, held)
            yield


def _take_part(folder: Path, held: ExitStack) -> None:
    """Hold one of the parts into which the memory is divided, when one is free."""
    while True:
        for part in range(_PARTS):
            try:
                held.enter_context(alone(folder / f"memory-{part}", wait=False))
            except BlockingIOError:
                continue
            return
        time.sleep(_LOOK_AGAIN_S)


def machine_memory_gb() -> float:
    """Memory of this machine in GB."""
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9)
