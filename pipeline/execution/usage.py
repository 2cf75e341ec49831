"""What a stage uses of the machine."""

from __future__ import annotations

import os
import sys
import threading
from functools import cache
from types import TracebackType

_INTERVAL_S = 0.02
_LINGERS = 50
"""Looks without a meter after which the sampler sleeps; to wake it costs more than a short stage."""


class PeakMemory:
    """Highest resident memory of the process while a block runs, sampled 50 times a second.

    Stages that run at the same time share the process, so the figure is what the machine needed, not one stage's own.
    """

    def __init__(self) -> None:
        self.peak_mb = 0.0

    def __enter__(self) -> PeakMemory:
        self.peak_mb = resident_mb()
        _SAMPLER.watch(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        _SAMPLER.leave(self)
        self.peak_mb = max(self.peak_mb, resident_mb())


class _Sampler:
    """One thread that looks for all meters, and sleeps while there are none."""

    def __init__(self) -> None:
        self._meters: set[PeakMemory] = set()
        self._some = threading.Condition()
        self._asleep = False
        self._process = 0

    def watch(self, meter: PeakMemory) -> None:
        with self._some:
            if self._process != os.getpid():
                self._process, self._meters, self._asleep = os.getpid(), set(), False
                threading.Thread(target=self._sample, daemon=True, name="peak memory").start()
            self._meters.add(meter)
            if self._asleep:
                self._some.notify()

    def leave(self, meter: PeakMemory) -> None:
        with self._some:
            self._meters.discard(meter)

    def _sample(self) -> None:
        pause = threading.Event()
        idle = 0
        while True:
            with self._some:
                idle = 0 if self._meters else idle + 1
                if idle > _LINGERS:
                    self._asleep = True
                    self._some.wait_for(lambda: self._meters)
                    self._asleep, idle = False, 0
            pause.wait(_INTERVAL_S)
            now = resident_mb()
            with self._some:
                for meter in self._meters:
                    meter.peak_mb = max(meter.peak_mb, now)


_SAMPLER = _Sampler()


def resident_mb() -> float:
    """Resident memory of this process in MB; where the system does not tell the present, its highest so far."""
    import resource

    try:
        return int(os.pread(_statm(os.getpid()), 128, 0).split()[1]) * resource.getpagesize() / 1e6
    except OSError:
        highest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return highest / (1e6 if sys.platform == "darwin" else 1e3)


@cache
def _statm(process: int) -> int:
    """A descriptor of what the kernel says of this process' memory; a process that was forked has one of its own."""
    return os.open("/proc/self/statm", os.O_RDONLY)
