"""Figures alone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True, eq=False)
class Metrics:
    """Figures for the table: each name ends in its unit."""

    metrics: Mapping[str, float]
