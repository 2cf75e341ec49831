"""Flipped bytes and cut ends in every kind of file: noticed before they are believed, and mended by the next run."""

from __future__ import annotations

import random
import shutil
import time
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from workshop import Tally, Workshop

from pipeline.bench import Experiment
from pipeline.data.photographs import Photo, PolarizerPhoto
from pipeline.execution.outcome import Silent
from pipeline.graph.compose import compose, remember
from pipeline.graph.config import Configuration
from pipeline.runs import Run, open_run
from pipeline.storage.artifact import DamagedArtifact
from pipeline.storage.journal import Journal
from pipeline.storage.store import data_types

KINDS = {
    "meta.json": ".store/objects/*/*/meta.json",
    "arrays": ".store/objects/*/*/*.npy",
    "records": ".store/recipes/*/*.json",
    "provenance": ".store/provenance/*.json",
    "digests of files": ".store/memory/files.json",
    "parsed sources": ".store/memory/sources.json",
    "compositions": ".store/memory/composed/*.json",
    "manifest.json": "table/*/manifest.json",
    "last.json": "table/last.json",
}
EACH = 16
OTHERS_RUN = "graph.later.ms=1"
"""Lets stages run that read what was harmed; without it none runs."""


def composed(workshop: Workshop, *words: str) -> Configuration:
    return compose(workshop.words(*words, experiment="table")[1:], [workshop.configs])


def carried_out(workshop: Workshop, *words: str) -> Run:
    """A run by a bench that has read nothing of the store yet."""
    return Experiment.of(composed(workshop, *words)).run(Silent())


def contents(run: Run) -> dict[str, Any]:
    """Every value as plain numbers.

    Raises
    ------
    DamagedArtifact
        One is damaged.
    """
    values = {name: run[name] for name in run.nodes}
    return {
        name: (value.image.tolist(), value.saturated.tolist()) if isinstance(value, Photo) else dict(value.metrics)
        for name, value in values.items()
    }


def harm(path: Path, rng: random.Random) -> None:
    """Flip a bit, as a disk does, or cut the end off."""
    data = bytearray(path.read_bytes())
    if rng.random() < 0.25:
        del data[rng.randrange(len(data)) :]
    else:
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
    path.write_bytes(data)


@pytest.fixture
def whole(workshop: Workshop) -> Path:
    """A copy of the results of a run, with all that can be remembered of it."""
    time.sleep(0.15)  # what changed this tick is not remembered
    carried_out(workshop)
    carried_out(workshop)
    remember(composed(workshop, OTHERS_RUN))
    return workshop.runs.rename(workshop.folder / "whole")


@pytest.mark.parametrize("kinds", [list(KINDS)[start::3] for start in range(3)], ids=" and ".join)
def test_harmed_files(workshop: Workshop, whole: Path, tally: Tally, kinds: list[str]) -> None:
    shutil.copytree(whole, workshop.runs)
    sound = carried_out(workshop)
    expected, artifacts, metrics = contents(sound), {n.name: n.artifact for n in sound.nodes.values()}, sound.metrics
    rng = random.Random(kinds[0])
    lost = 0
    for kind, trial in product(kinds, range(EACH)):
        shutil.rmtree(workshop.runs)
        shutil.copytree(whole, workshop.runs)
        harm(rng.choice(sorted(workshop.runs.glob(KINDS[kind]))), rng)
        words = [OTHERS_RUN] if trial % 2 else []
        run = carried_out(workshop, *words)
        try:
            as_before = contents(run) == expected
        except DamagedArtifact:
            run = carried_out(workshop, *words)
            as_before = contents(run) == expected
        as_before &= {n.name: n.artifact for n in run.nodes.values()} == artifacts
        as_before &= run.metrics == metrics == open_run(run.path).metrics
        lost += not as_before
    tally("flip or cut in a file of the store or a manifest", EACH * len(kinds), lost)


def test_a_harmed_journal(tmp_path: Path, tally: Tally) -> None:
    rng = random.Random(1)
    numbers = np.random.default_rng(1)
    photos = [
        PolarizerPhoto(Photo(numbers.random((3, 4)), numbers.random((3, 4)) > 0.5, 0.125, {"iso": "100"}), 0.1 * i)
        for i in range(4)
    ]
    for index, photo in enumerate(photos):
        Journal(tmp_path / "whole", data_types()).step(index, lambda photo=photo: photo)
    flips, lost = 150, 0
    for trial in range(flips):
        folder = tmp_path / str(trial)
        shutil.copytree(tmp_path / "whole", folder)
        harm(rng.choice(sorted(folder.rglob(rng.choice(["meta.json", "*.npy"])))), rng)
        journal = Journal(folder, data_types())
        found = [journal.step(index, lambda photo=photo: photo) for index, photo in enumerate(photos)]
        lost += [told(f) for f in found] != [told(p) for p in photos] or journal.recalled < len(photos) - 1
        journal = Journal(folder, data_types())
        for index in range(len(photos)):
            journal.step(index, lambda: pytest.fail("a photograph was taken again"))
    tally("flip or cut in a capture's journal", flips, lost)


def told(taken: PolarizerPhoto) -> tuple[object, ...]:
    photo = taken.photo
    return photo.image.tolist(), photo.saturated.tolist(), photo.exposure_s, dict(photo.metadata), taken.polarizer_rad
