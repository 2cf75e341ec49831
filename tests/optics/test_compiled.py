"""Machine code on disk is as new as all that went into it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from pipeline.optics import compiled


def test_an_edit_of_a_helper_compiles_its_callers_anew(tmp_path: Path) -> None:
    optics = tmp_path / "pipeline" / "optics"
    optics.mkdir(parents=True)
    shutil.copy(compiled.__file__, optics)
    for package in (optics, optics.parent):
        (package / "__init__.py").touch()
    head = "from pipeline.optics.compiled import njit\n"
    helper, caller = optics / "helper.py", optics / "caller.py"
    caller.write_text(
        f"{head}from pipeline.optics.helper import f\n\n\n@njit(cache=True)\ndef g(x):\n    return f(x) + 1\n"
    )

    def result() -> int:
        command = [sys.executable, "-c", "from pipeline.optics.caller import g; print(g(1), len(g.stats.cache_hits))"]
        environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        value, hits = done.stdout.split()
        taken.append(int(hits))
        return int(value)

    taken: list[int] = []
    helper.write_text(f"{head}\n\n@njit(cache=True)\ndef f(x):\n    return x * 2\n")
    assert [result(), result()] == [3, 3]
    helper.write_text(f"{head}\n\n@njit(cache=True)\ndef f(x):\n    return x * 5\n")
    assert result() == 6
    assert taken == [0, 1, 0]


def test_the_fast_renderer_is_compiled_with_its_half_vectors() -> None:
    sheet = Path(compiled.__file__).parent / "sheet"
    assert "pipeline.optics.sheet.half_vectors" in compiled.compiled_into(sheet / "tabulated.py")
