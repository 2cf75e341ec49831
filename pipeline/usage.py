"""What a stage uses of the machine."""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from types import TracebackType

_INTERVAL_S = 0.02


class PeakMemory:
    """Highest resident memory of the process while a block runs, sampled 50 times a second.

    Stages that run at the same time share the process, so the figure is what the machine needed, not one stage's own.
    """

    def __init__(self) -> None:
        self.peak_mb = 0.0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)

    def __enter__(self) -> PeakMemory:
        self.peak_mb = resident_mb()
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stop.set()
        self._thread.join()
        self.peak_mb = max(self.peak_mb, resident_mb())

    def _sample(self) -> None:
        while not self._stop.wait(_INTERVAL_S):
            self.peak_mb = max(self.peak_mb, resident_mb())


def resident_mb() -> float:
    """Resident memory of this process in MB; where the system does not tell the present, its highest so far."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        import resource

        highest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return highest / (1e6 if sys.platform == "darwin" else 1e3)
    import resource

    return pages * resource.getpagesize() / 1e6
