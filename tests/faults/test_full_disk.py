"""A disk that fills up at any point of a run: the error names it, nothing half-written counts, and the run goes on."""

from __future__ import annotations

import re
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

import OpenImageIO as oiio
import pytest
from test_kills import kept
from workshop import GRAPH, Tally, Workshop

from pipeline.cli import main
from pipeline.storage.keys import digest_array, digest_file

DISK_KB = 16384
ROOM_KB = (0, 4, 8, 16, 24, 40, 60, 100, 250, 600, 1100, 1500, 2500, 3600, 4800, 5600, 6200, 6600, 7000, 7400)


@pytest.fixture
def disk(workshop: Workshop) -> Iterator[Path]:
    """A small disk on which the runs and the store lie."""
    folder = workshop.folder / "small disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if mount is None:
        pytest.skip("there is no mount")
    done = subprocess.run(
        [mount, "-t", "tmpfs", "-o", f"size={DISK_KB}k", "tmpfs", str(folder)],
        check=False,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        pytest.skip(f"no disk can be mounted here: {done.stderr.strip()}")
    workshop.runs = folder / "runs"
    yield folder
    subprocess.run(["umount", "--lazy", str(folder)], check=True)


def leave(disk: Path, kb: int) -> None:
    """Fill the disk up to so many kilobytes."""
    free = shutil.disk_usage(disk).free
    (disk / "ballast").write_bytes(bytes(max(0, free - 1024 * kb)))


def outputs(workshop: Workshop) -> dict[str, str]:
    """Digests of the files that a person opens."""
    found = {path.name: digest_file(path) for path in workshop.runs.rglob("outputs/*.[pc]*")}
    exr = (path for path in workshop.runs.rglob("outputs/*.exr"))  # these bear the time at which they were written
    return found | {path.name: digest_array(oiio.ImageBuf(str(path)).get_pixels(oiio.FLOAT)) for path in exr}


def test_a_disk_that_fills_up(workshop: Workshop, disk: Path, tally: Tally, capsys: pytest.CaptureFixture[str]) -> None:
    workshop.experiment("drill", {**GRAPH, "period": {"stage": "drill.period", "maps": "rough"}})
    assert main(workshop.words()) == 0
    expected = workshop.artifacts(), outputs(workshop)
    assert {"period.exr", "period.png"} < set(expected[1])
    full = lost = 0
    for number, kb in enumerate(ROOM_KB):
        words = workshop.words("executor=threads" if number % 2 else "executor=serial")
        workshop.start_again()
        leave(disk, kb)
        capsys.readouterr()
        status = main(words)
        said = capsys.readouterr().err
        full += status != 0
        if status:
            lost += "Traceback" in said or str(disk) not in said or not re.search(r"is full|No space left", said)
        kept(workshop)
        (disk / "ballast").unlink()
        assert main(words) == 0
        lost += (workshop.artifacts(), outputs(workshop)) != expected
    assert full > 10
    tally("disk that fills up", full, lost)
