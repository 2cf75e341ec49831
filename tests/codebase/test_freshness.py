"""What changes while a process runs, or between planning and running, never gives a stale or a wrong result."""

from __future__ import annotations

import importlib
import json
import os
import py_compile
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from toys import Toys

from pipeline.bench import Experiment, carry_out, plan_of
from pipeline.codebase import freshness
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import Photo
from pipeline.errors import InputError, InputErrors
from pipeline.execution.executors import executor_of
from pipeline.execution.outcome import Silent
from pipeline.runs import open_run
from pipeline.storage.artifact import META
from pipeline.storage.files import FileDigests, settled, stamp
from pipeline.storage.store import Store

FOLDER_STAGE = '''

def reads(*, folder: Path) -> PeriodMap:
    """Read a number from a file."""
    value = float((folder / "value.txt").read_text())
    return PeriodMap(np.full((2, 2), value, np.float32), np.ones((2, 2), bool))
'''


def loaded(toys: Toys, *words: str) -> Experiment:
    """Without forgetting what this process imported."""
    return Experiment.load(["+experiment=toy", f"paths.runs={toys.folder / 'runs'}", *words])


@pytest.fixture
def folder(toys: Toys) -> Path:
    toys.stages.write_text(toys.stages.read_text() + FOLDER_STAGE)
    made = toys.folder / "measured"
    made.mkdir()
    (made / "value.txt").write_text("1")
    toys.graph(f"raw: {{stage: toy.reads, folder: {made}}}")
    toys.forget()
    return made


def test_an_edit_is_run_by_the_process_that_imported_the_code_before_it(toys: Toys) -> None:
    assert toys.run()["big"].period_um[0, 0] == 3
    toys.helper.write_text(toys.helper.read_text().replace("array * factor", "array * factor * 2"))
    again = loaded(toys).run(Silent())
    assert again["big"].period_um[0, 0] == 6
    assert "toybench.stages.toy.maps" in sys.modules


def test_an_edit_of_the_bench_itself_asks_for_a_new_process(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    toys.run()
    monkeypatch.setitem(freshness._seen, "pipeline.data.gratings", "as it was")
    with pytest.raises(InputError, match=r"the code of pipeline\.data\.gratings changed[\s\S]*restart Python"):
        loaded(toys, "graph.big.factor=9").run(Silent())


def test_files_that_change_between_plan_and_run_are_noticed(toys: Toys, folder: Path) -> None:
    experiment = loaded(toys)
    plan = plan_of(experiment, experiment.graph)
    (folder / "value.txt").write_text("2")
    outcomes = carry_out(plan, experiment.store, experiment.catalog.sources, executor_of({}), Silent())
    assert outcomes["raw"].status == "failed"
    assert "changed while it was read" in outcomes["raw"].error
    (folder / "value.txt").write_text("1")
    assert toys.run()["raw"].period_um[0, 0] == 1


@pytest.mark.parametrize("how", ["in place", "through a linked folder"])
def test_files_that_keep_size_and_time_are_noticed(toys: Toys, folder: Path, how: str) -> None:
    file = folder / "value.txt"
    if how == "through a linked folder":
        (toys.folder / "elsewhere").mkdir()
        file = Path(shutil.move(file, toys.folder / "elsewhere" / "value.txt"))
        (folder / "inner").symlink_to(toys.folder / "elsewhere")
        toys.stages.write_text(toys.stages.read_text().replace('folder / "value', 'folder / "inner" / "value'))
    assert toys.run()["raw"].period_um[0, 0] == 1
    times = (file.stat().st_atime_ns, file.stat().st_mtime_ns)
    with file.open("r+") as opened:
        opened.write("2")
    os.utime(file, ns=times)
    assert toys.run()["raw"].period_um[0, 0] == 2


def test_hidden_files_do_not_count(toys: Toys, folder: Path) -> None:
    toys.run()
    (folder / ".DS_Store").write_text("of a file manager")
    (folder / ".thumbnails").mkdir()
    (folder / ".thumbnails" / "a.png").write_text("of another")
    assert toys.ran() == []
    (folder / "seen.txt").write_text("another file")
    assert toys.ran() == ["raw"]


def test_a_stamp_is_trusted_only_when_the_clock_has_moved_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = tmp_path / "file"
    file.write_text("1")
    assert not settled([stamp(file)])
    later = stamp(file)[1] + 1_000_000_000
    monkeypatch.setattr("time.time_ns", lambda: later)
    assert settled([stamp(file)])
    os.utime(file, ns=(0, stamp(file)[1] + 10**15))
    assert not settled([stamp(file)])
    memory = tmp_path / "memory.json"
    memory.write_text("[1]")
    assert FileDigests(memory).of(file)


def test_names_that_look_like_tags_are_names(tmp_path: Path) -> None:
    store = Store(tmp_path)
    image, saturated = np.zeros((2, 2), np.float32), np.zeros((2, 2), bool)
    one, other, third = (
        store.put(Photo(image, saturated, None, metadata))
        for metadata in ({"number": "7", "model": "A"}, {"number": "7", "model": "B"}, {"array": "x", "mapping": "y"})
    )
    assert len({one, other, third}) == 3
    assert Store(tmp_path).get(other).metadata == {"number": "7", "model": "B"}
    assert Store(tmp_path).get(third).metadata == {"array": "x", "mapping": "y"}
    figures = store.put(Metrics({"number": 1.0, "fields": 2.0}))
    assert Store(tmp_path).get(figures).metrics == {"number": 1.0, "fields": 2.0}


@pytest.mark.parametrize(
    ("before", "after"),
    [("bytes", "cytes"), ("digest", "digesu"), ("fields", "gields"), ("class", "clasr"), ("0x", "1x")],
)
def test_damage_to_a_description_is_noticed_and_mended(toys: Toys, before: str, after: str) -> None:
    run = toys.run()
    meta = run.store.object_folder(run.nodes["means"].artifact) / META
    if before in {"bytes", "digest"}:
        meta = run.store.object_folder(run.nodes["cut"].artifact) / META
    text = meta.read_text()
    assert before in text
    meta.write_text(text.replace(before, after))
    assert not toys.run("description=anew").failed
    assert json.loads(meta.read_text()) == json.loads(text)


def test_a_damaged_result_at_the_end_is_computed_again_for_the_report(toys: Toys) -> None:
    run = toys.run()
    file = run.store.object_folder(run.nodes["means"].artifact) / META
    file.write_text(file.read_text()[:-5])
    assert toys.ran("description=anew") == ["means"]


def test_a_damaged_capture_is_not_taken_again_by_itself(toys: Toys) -> None:
    toys.graph(
        """\
        photo: {stage: toy.photo, camera: {device: lab.Webcam, light: {device: lab.Lamp}}}
        big: {stage: toy.scale, maps: photo}
        """
    )
    run = toys.run()
    file = run.store.object_folder(run.nodes["photo"].artifact) / "period_um.npy"
    data = bytearray(file.read_bytes())
    data[-1] ^= 1
    file.write_bytes(data)
    with pytest.raises(InputError, match=r"captured for 'photo' is damaged or gone[\s\S]*recapture=true"):
        toys.run("graph.big.factor=7")
    assert not toys.run("recapture=true").failed


def test_runs_and_store_can_move_together(toys: Toys) -> None:
    run = toys.run()
    moved = toys.folder / "moved"
    shutil.move(toys.folder / "runs", moved)
    again = open_run(moved / "toy" / run.path.name)
    np.testing.assert_array_equal(again["big"].period_um, np.full((3, 3), 3.0, np.float32))
    found = loaded(toys, f"paths.runs={moved}").run(Silent())
    assert found["cut"].period_um[0, 0] == 3


def test_a_device_of_the_wrong_kind_is_refused(toys: Toys) -> None:
    toys.graph("photo: {stage: toy.photo, camera: {device: lab.Lamp}}")
    with pytest.raises(InputErrors, match=r"a Lamp is no Camera: it lacks expose[\s\S]*graph.photo.camera"):
        toys.run()
    assert not list((toys.folder / "runs").rglob("*.npy"))


def test_runs_that_cannot_be_written_are_found_before_anything_runs(toys: Toys) -> None:
    (toys.folder / "file").write_text("not a folder")
    with pytest.raises(InputError, match=r"folder .*file/runs cannot be written to[\s\S]*paths.runs"):
        toys.run(f"paths.runs={toys.folder / 'file' / 'runs'}", f"paths.store={toys.folder / 'store'}")
    assert not list((toys.folder / "store").rglob("*.npy"))


def changed_unnoticed(path: Path, old: str, new: str) -> None:
    """Edit a file and give it the time it had."""
    before = path.stat()
    path.write_text(path.read_text().replace(old, new))
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    assert (path.stat().st_size, path.stat().st_mtime_ns) == (before.st_size, before.st_mtime_ns)


@pytest.fixture
def long_ago(toys: Toys, monkeypatch: pytest.MonkeyPatch) -> None:
    """Code written long ago, in a process that has run none of it."""
    for path in toys.package.rglob("*.py"):
        os.utime(path, (1e9, 1e9))
    toys.forget()
    monkeypatch.setattr("pipeline.codebase.freshness._seen", {})


@pytest.mark.usefixtures("long_ago")
def test_an_edit_whose_time_was_set_back_is_run_by_the_process_that_imported_the_code_before(toys: Toys) -> None:
    importlib.import_module("toybench.stages.toy.maps")
    changed_unnoticed(toys.helper, "array * factor", "array + factor")
    assert loaded(toys, "graph.raw.value=5").run(Silent())["big"].period_um[0, 0] == 8


@pytest.mark.usefixtures("long_ago")
@pytest.mark.parametrize("imported", [False, True])
def test_what_python_compiled_of_an_older_text_is_not_run(toys: Toys, imported: bool) -> None:
    compiled = Path(py_compile.compile(str(toys.helper), doraise=True))
    changed_unnoticed(toys.helper, "array * factor", "array + factor")
    if imported:
        module = importlib.import_module("toybench.arithmetic")
        assert module.scaled(5, 3) == 15
    assert loaded(toys, "graph.raw.value=5").run(Silent())["big"].period_um[0, 0] == 8
    assert not compiled.exists()


def test_what_python_compiled_of_the_same_text_is_kept(toys: Toys) -> None:
    compiled = Path(py_compile.compile(str(toys.helper), doraise=True))
    os.utime(compiled, (1e9, 1e9))
    toys.run()
    assert compiled.stat().st_mtime_ns > toys.helper.stat().st_ctime_ns
