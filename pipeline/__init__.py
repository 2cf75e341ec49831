"""A bench for optical-measurement experiments: YAML graphs of stages on simulated, replayed or real devices."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pipeline.bench import RunFailed, run
    from pipeline.review.verification import verify
    from pipeline.runs import Run, open_run
    from pipeline.sweeps import sweep

__all__ = ["Run", "RunFailed", "open_run", "run", "sweep", "verify"]

_HOMES = {
    "run": "pipeline.bench",
    "RunFailed": "pipeline.bench",
    "Run": "pipeline.runs",
    "open_run": "pipeline.runs",
    "sweep": "pipeline.sweeps",
    "verify": "pipeline.review.verification",
}


def __getattr__(name: str) -> Any:
    """Import the public names when they are first asked for, so that ``import pipeline`` costs nothing."""
    import importlib

    if name not in _HOMES:
        raise AttributeError(f"module 'pipeline' has no attribute '{name}'")
    return getattr(importlib.import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
