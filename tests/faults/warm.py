"""Forks a process for each command line that it reads, and kills it if asked to: see ``workshop.Warm``.

This process has one thread and has imported what the first of its children did, so that a child is at work at once.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import select
import signal
import sys
import time
from typing import Any

from pipeline.cli import main


def child(job: dict[str, Any], modules: int | None) -> int:
    os.setsid()
    with open(job["output"], "w") as file:
        os.dup2(file.fileno(), 1)
        os.dup2(file.fileno(), 2)
    words = job["words"]
    while words[0].startswith("DRILL_"):
        name, _, value = words.pop(0).partition("=")
        os.environ[name] = value
    status = main(words)
    sys.stdout.flush()
    sys.stderr.flush()
    if modules is not None:
        os.write(modules, json.dumps(list(sys.modules)).encode())
    return status


def forked(job: dict[str, Any], modules: int | None) -> int:
    pid = os.fork()
    if pid == 0:
        status = 70
        try:
            status = child(job, modules)
        finally:
            os._exit(status)
    return pid


def ended(pid: int, start: float, kill_after_s: float | None) -> tuple[int, float]:
    descriptor = os.pidfd_open(pid)
    left = None if kill_after_s is None else max(0.0, start + kill_after_s - time.perf_counter())
    if not select.select([descriptor], [], [], left)[0]:
        with contextlib.suppress(ProcessLookupError):  # too young to lead a group
            os.killpg(pid, signal.SIGKILL)
        os.kill(pid, signal.SIGKILL)
    os.close(descriptor)
    _, status = os.waitpid(pid, 0)
    return os.waitstatus_to_exitcode(status), time.perf_counter() - start


def warm_up(reader: int) -> None:
    """Import what the first child had imported."""
    text = b""
    while piece := os.read(reader, 65536):
        text += piece
    for name in json.loads(text):
        with contextlib.suppress(ImportError):
            importlib.import_module(name)


def serve() -> None:
    reader, writer = os.pipe()
    first = True
    for line in sys.stdin:
        request = json.loads(line)
        start = time.perf_counter()
        pids = [forked(job, writer if first else None) for job in request["jobs"]]
        if first:
            os.close(writer)
            warm_up(reader)
            first = False
        print(json.dumps([ended(pid, start, request["kill_after_s"]) for pid in pids]), flush=True)


if __name__ == "__main__":
    os.fsync = lambda descriptor: None  # a machine that loses its power needs it, a process that is killed does not
    serve()
