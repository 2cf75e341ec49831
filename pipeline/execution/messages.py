"""What stages log while they run, collected with their results."""

from __future__ import annotations

import logging
import os
import threading
from contextvars import ContextVar
from typing import Self

_said: ContextVar[Messages | None] = ContextVar("messages", default=None)


class Messages:
    """Collects what the current stage logs inside a block, warnings and notes apart."""

    def __init__(self) -> None:
        self.warnings: list[str] = []
        self.notes: list[str] = []

    def __enter__(self) -> Self:
        _HANDLER.install()
        self._token = _said.set(self)
        return self

    def __exit__(self, *_: object) -> None:
        _said.reset(self._token)
        _HANDLER.remove()


class _Handler(logging.Handler):
    """Hands log records to the stage that runs in the thread that logs; installed while any stage runs."""

    def __init__(self) -> None:
        super().__init__()
        self._installed = 0
        self._guard = threading.Lock()
        self._logger = logging.getLogger("pipeline")
        self._before = (logging.NOTSET, True)

    def emit(self, record: logging.LogRecord) -> None:
        said = _said.get()
        if said is not None and record.levelno >= logging.INFO:
            (said.warnings if record.levelno >= logging.WARNING else said.notes).append(record.getMessage())

    def install(self) -> None:
        with self._guard:
            self._installed += 1
            if self._installed == 1:
                self._before = (self._logger.level, self._logger.propagate)
                self._logger.setLevel(logging.INFO)
                self._logger.propagate = bool(os.environ.get("OPTIBENCH_LOG"))
                self._logger.addHandler(self)

    def remove(self) -> None:
        with self._guard:
            self._installed -= 1
            if self._installed == 0:
                self._logger.removeHandler(self)
                self._logger.level, self._logger.propagate = self._before


_HANDLER = _Handler()
