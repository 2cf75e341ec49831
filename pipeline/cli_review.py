"""The commands of the command line that look at finished runs: verify, diff, bundle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.errors import InputError

if TYPE_CHECKING:
    from pipeline.cli_line import Line
    from pipeline.review.unpack import Limits


def verify(line: Line) -> int:
    """Recompute a run or bundle and print how it compares; returns the exit status."""
    from pipeline.execution.live import display
    from pipeline.review.verification import verified

    if len(line.words) != 1:
        raise InputError("verify takes one run or bundle", where="command line", expected="verify RUN|BUNDLE")
    with display(quiet=line.quiet) as shown:
        done = verified(Path(line.words[0]), limits(line), shown)
    if not line.quiet or not done.ok:
        print(done)
    return 0 if done.ok else 1


def bundle(line: Line) -> int:
    """Write a run as one file and print its name; returns the exit status."""
    from pipeline.review.bundle import write_bundle
    from pipeline.runs import open_run

    if len(line.words) != 2:
        raise InputError("bundle takes a run and a file", where="command line", expected="bundle RUN FILE.zip")
    print(write_bundle(open_run(Path(line.words[0])), Path(line.words[1])))
    return 0


def diff(line: Line) -> int:
    """Print how two runs differ; returns the exit status."""
    from pipeline.review.diff import diff as difference
    from pipeline.review.unpack import opened

    if len(line.words) != 2:
        raise InputError("diff takes two runs", where="command line", expected="diff RUN RUN")
    first, second = map(Path, line.words)
    with opened(first, limits(line)) as one, opened(second, limits(line)) as other:
        found = difference(one, other, (str(first), str(second)))
    print(found.to_json() if line.json else found)
    return 0


def limits(line: Line) -> Limits:
    """What a bundle may unpack to."""
    from pipeline.review.unpack import Limits

    return Limits() if line.limit_gb is None else Limits(total_bytes=round(line.limit_gb * 1e9))
