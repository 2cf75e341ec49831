"""Memory that a process uses, as the kernel tells it."""

from __future__ import annotations

import os

import numpy as np
import pytest

from pipeline.execution.usage import PeakMemory, resident_mb


def test_a_stages_memory_is_seen() -> None:
    before = resident_mb()
    with PeakMemory() as memory:
        block = np.ones(8_000_000)
        held = resident_mb()
    assert held - before > 50
    assert memory.peak_mb >= held - 5
    assert block.nbytes == 64e6


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_forked_process_sees_its_own_memory() -> None:
    resident_mb()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        before = resident_mb()
        block = np.ones(8_000_000)
        os.write(writing, f"{resident_mb() - before:f} {block.nbytes}".encode())
        os._exit(0)
    os.waitpid(child, 0)
    assert float(os.read(reading, 100).split()[0]) > 50
    os.close(reading)
    os.close(writing)
