"""numba's ``njit``, whose machine code on disk is not taken where a compiled function of another module was edited.

Numba compiles such a function into its caller, but looks at the caller's file alone to tell whether that is current.
"""

from __future__ import annotations

import hashlib
import re
from pathlib import Path
from typing import Any

from numba import njit
from numba.core import caching

__all__ = ["njit"]

_ROOT = Path(__file__).parents[2]
_IMPORT = re.compile(r"^from (pipeline\.[\w.]+) import", re.MULTILINE)


def compiled_into(path: Path) -> dict[str, str]:
    """Digests of the modules with compiled functions that a file imports, and that they import."""
    found: dict[str, str] = {}
    waiting = [path]
    while waiting:
        for name in _IMPORT.findall(waiting.pop().read_text(encoding="utf-8")):
            source = _ROOT.joinpath(*name.split(".")).with_suffix(".py")
            if name not in found and source.is_file() and b"njit" in (text := source.read_bytes()):
                found[name] = hashlib.sha256(text).hexdigest()
                waiting.append(source)
    return found


_of_file = caching._SourceFileBackedLocatorMixin.get_source_stamp


def _stamp(locator: Any) -> Any:
    path = Path(locator._py_file)
    return (_of_file(locator), compiled_into(path)) if path.is_relative_to(_ROOT / "pipeline") else _of_file(locator)


caching._SourceFileBackedLocatorMixin.get_source_stamp = _stamp
