"""An interrupted run stops its stages, lets go of its devices, and goes on where it was when asked again."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SLOW = [
    "rig.mount.time_scale=1",
    "rig.mount.velocity_deg_s=10",
    "graph.sample.pixel_mm=0.02",
    "rig.camera.pixel_mm=0.06",
]


def test_control_c_stops_a_capture_between_two_photographs(tmp_path: Path) -> None:
    words = ["+experiment=polarization_logo", "until=photos", f"paths.runs={tmp_path / 'runs'}"]
    command = [sys.executable, "-m", "pipeline", *words]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    heeded = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background inherits deafness
    running = subprocess.Popen([*command, *SLOW], cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, heeded)
    assert running.stderr is not None
    assert "sample" in running.stderr.readline()  # the photographs come next, and take 18 s
    time.sleep(1.5)
    running.send_signal(signal.SIGINT)
    said = running.communicate(timeout=60)[1]
    assert running.returncode == 130
    assert "interrupted; what was finished is kept" in said
    again = subprocess.run(
        [*command, *SLOW[2:]], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert "1 stages run, 1 from the store" in again.stdout  # the photographs had not all been taken
