"""Where a result comes from: versions, commit, host."""

from __future__ import annotations

import platform
import re
import sys
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, requires, version
from pathlib import Path
from typing import Any

DISTRIBUTION = "optibench"


@cache
def versions() -> dict[str, str]:
    """Versions of Python, of this package and of the libraries that it requires."""
    found = {"python": platform.python_version()}
    try:
        names = [
            DISTRIBUTION,
            *(re.split(r"[^\w.-]", r)[0] for r in requires(DISTRIBUTION) or () if "extra ==" not in r),
        ]
    except PackageNotFoundError:
        return found
    for group in ("pipeline.stages", "pipeline.devices"):
        names += [point.dist.name for point in entry_points(group=group) if point.dist is not None]
    for name in names:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


@cache
def environment() -> dict[str, Any]:
    """Python, platform, and the versions of all that is installed.

    The versions are read off the names of the folders that installers make: reading every distribution's own listing
    takes a third of a second.
    """
    installed: dict[str, str] = {}
    for place in sys.path:
        for folder in Path(place).glob("*.dist-info"):
            name, _, number = folder.stem.rpartition("-")
            installed.setdefault(re.sub(r"[-_.]+", "-", name).lower(), number)
    return {
        "python": platform.python_version(),
        "implementation": platform.python_implementation(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "distributions": dict(sorted(installed.items())),
    }


def own_version() -> str:
    """Name and version of this distribution."""
    try:
        return f"{DISTRIBUTION} {version(DISTRIBUTION)}"
    except PackageNotFoundError:
        return f"{DISTRIBUTION} from a checkout"


CHANGED = " with local changes"


def commit() -> str:
    """Commit of the checkout that this package runs from, and whether files differ from it; empty outside one."""
    checkout = Path(__file__).resolve().parents[2]
    found = head(checkout)
    return found + CHANGED if found and _changed(checkout) else found


def _changed(checkout: Path) -> bool:
    """Whether git knows of changes to what results depend on; no where there is no git to ask."""
    import subprocess

    command = ["git", "--no-optional-locks", "status", "--porcelain", "--", "pipeline", "configs"]
    try:
        done = subprocess.run(command, cwd=checkout, capture_output=True, timeout=5, check=True)
    except (OSError, subprocess.SubprocessError):
        return False
    return bool(done.stdout.strip())


def head(checkout: Path) -> str:
    """Commit that a checkout stands at, read off git's files; empty where it is none."""
    git = checkout / ".git"
    try:
        if git.is_file():
            git = (checkout / git.read_text().removeprefix("gitdir:").strip()).resolve()
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref: "):
            return head
        reference = head.removeprefix("ref: ")
        common = git / "commondir"
        base = (git / common.read_text().strip()).resolve() if common.is_file() else git
        loose = base / reference
        if loose.is_file():
            return loose.read_text().strip()
        packed = (line.split() for line in (base / "packed-refs").read_text().splitlines())
        return next((line[0] for line in packed if line[1:] == [reference]), "")
    except OSError:
        return ""
