"""Numbers that a file keeps in single precision."""

from __future__ import annotations

from typing import Any

import numpy as np


def shortest(value: Any) -> float:
    """Its shortest decimal: 0.005, not 0.004999999888241291, whatever numpy's print options have been set to."""
    return float(np.format_float_scientific(np.float32(value), unique=True))
