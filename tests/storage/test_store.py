"""Artifacts: what goes in comes out, and what is damaged is noticed, set aside and computed again."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from toys import Toys

from pipeline.data.gratings import PeriodMap
from pipeline.data.metrics import Metrics
from pipeline.data.photographs import PolarizerSequence
from pipeline.errors import PipelineError
from pipeline.storage.artifact import META, DamagedArtifact, digest_of, read_description
from pipeline.storage.store import Store


def a_map(size: int = 4) -> PeriodMap:
    return PeriodMap(np.arange(size * size, dtype=np.float32).reshape(size, size), np.eye(size, dtype=bool), 0.02)


def test_a_value_comes_back_as_it_was(tmp_path: Path) -> None:
    value = PolarizerSequence(
        images=np.random.default_rng(0).random((3, 4, 5)).astype(np.float32),
        polarizer_rad=np.array([0.0, 0.1, np.pi]),
        valid=np.ones((4, 5), bool),
        pixel_mm=0.1 + 0.2,
        exposure_s=(0.01, 0.02, float("inf")),
        metadata={"model": "Kamera £", "a/b": "../.."},
    )
    store = Store(tmp_path)
    again = Store(tmp_path).get(store.put(value))
    np.testing.assert_array_equal(again.images, value.images)
    np.testing.assert_array_equal(again.polarizer_rad, value.polarizer_rad)
    assert (again.pixel_mm, again.wavelength_nm, again.exposure_s) == (0.1 + 0.2, None, value.exposure_s)
    assert again.metadata == value.metadata
    assert not again.images.flags.writeable
    assert isinstance(again.images, np.memmap)


def test_what_happens_to_a_value_after_it_was_put_or_got_changes_nothing(tmp_path: Path) -> None:
    store = Store(tmp_path)
    value = a_map()
    kept = store.put(value)
    value.period_um[:] = -1
    first = store.get(kept)
    np.testing.assert_array_equal(first.period_um, a_map().period_um)
    for array in (first.period_um, first.period_um[1:], first.period_um.T):
        with pytest.raises(ValueError, match="read-only"):
            array[0, 0] = 5
        with pytest.raises(ValueError, match="cannot set WRITEABLE flag"):
            array.flags.writeable = True
    figures = {"error_deg": 1.0}
    kept = store.put(Metrics(figures))
    figures["error_deg"] = 2.0
    store.get(kept).metrics["error_deg"] = 3.0
    assert store.get(kept).metrics == {"error_deg": 1.0}


@pytest.mark.parametrize("array", [np.zeros((0, 3)), np.array(2.5), np.arange(6).reshape(2, 3).T, np.array([True])])
def test_a_small_value_is_the_same_from_memory_and_from_the_disk(tmp_path: Path, array: np.ndarray) -> None:
    store = Store(tmp_path)
    kept = store.put(PeriodMap(array, array > 0))
    from_memory, from_disk = store.get(kept).period_um, Store(tmp_path).get(kept).period_um
    np.testing.assert_array_equal(from_memory, from_disk)
    assert (from_memory.dtype, from_memory.shape) == (from_disk.dtype, from_disk.shape) == (array.dtype, array.shape)


@given(
    hnp.arrays(np.float32, hnp.array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=4)),
    st.dictionaries(st.text(), st.floats(), max_size=3),
)
def test_equal_content_has_equal_digest_and_any_value_survives(
    tmp_path_factory: pytest.TempPathFactory, array: np.ndarray, figures: dict[str, float]
) -> None:
    store = Store(tmp_path_factory.mktemp("store"))
    digest = store.put(PeriodMap(array, array > 0))
    assert digest == store.put(PeriodMap(np.asfortranarray(array), array > 0))
    np.testing.assert_array_equal(store.get(digest).period_um, array)
    found = store.get(store.put(Metrics(figures))).metrics
    assert {k: float(v).hex() for k, v in found.items()} == {k: v.hex() for k, v in figures.items()}


@pytest.mark.parametrize(
    "array", [np.array(2.5), np.zeros((0, 3)), np.array(["ab", "c"]), np.arange(6.0).reshape(2, 3).T]
)
def test_arrays_of_every_form_come_back(tmp_path: Path, array: np.ndarray) -> None:
    found = Store(tmp_path).get(Store(tmp_path).put(PeriodMap(array, array))).period_um
    np.testing.assert_array_equal(found, array)
    assert (found.shape, found.dtype) == (array.shape, array.dtype)


def test_the_digest_of_a_value_is_frozen(tmp_path: Path) -> None:
    assert Store(tmp_path).put(a_map(2)) == "615632354742e78bed17d431d3a30aa7ba4d9268"


def test_nothing_unknown_can_be_stored(tmp_path: Path) -> None:
    with pytest.raises(PipelineError, match="is of type set, which has no form on disk"):
        Store(tmp_path).put(Metrics({"a": {1}}))  # type: ignore[dict-item]


def flip(path: Path, position: int = -1) -> None:
    data = bytearray(path.read_bytes())
    data[position] ^= 0x40
    path.write_bytes(data)


@pytest.mark.parametrize("name", ["period_um.npy", "mask.npy"])
def test_a_flipped_byte_is_noticed_and_set_aside(tmp_path: Path, name: str) -> None:
    digest = Store(tmp_path).put(a_map())
    store = Store(tmp_path)
    flip(store.object_folder(digest) / name)
    with pytest.raises(DamagedArtifact, match=f"{name} has changed"):
        store.get(digest)
    assert not store.object_folder(digest).exists()
    assert len(list((tmp_path / "damaged").iterdir())) == 1
    assert store.put(a_map()) == digest


def test_edited_metadata_is_noticed(tmp_path: Path) -> None:
    digest = Store(tmp_path).put(a_map())
    meta = Store(tmp_path).object_folder(digest) / META
    meta.write_text(meta.read_text().replace("0x1.47ae147ae147bp-6", "0x1.5p-6"))
    with pytest.raises(DamagedArtifact, match="is not the value of its name"):
        Store(tmp_path).get(digest)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda e: e.update(array="../../x.npy"), "names a file outside itself"),
        (lambda e: e.update(array="/etc/x.npy"), "names a file outside itself"),
        (lambda e: e.update(shape=[2, 8]), "is not the array that meta.json describes"),
    ],
)
def test_a_hostile_description_is_refused(tmp_path: Path, change: object, message: str) -> None:
    digest = Store(tmp_path).put(a_map())
    meta = Store(tmp_path).object_folder(digest) / META
    content = json.loads(meta.read_text())
    change(content["value"]["fields"]["period_um"])  # type: ignore[operator]
    meta.write_text(json.dumps(content))
    with pytest.raises(DamagedArtifact, match=message):
        Store(tmp_path).get(digest)


def test_only_classes_of_values_are_built(tmp_path: Path) -> None:
    store = Store(tmp_path)
    written = store.object_folder(store.put(a_map()))
    (written / META).write_text((written / META).read_text().replace('"PeriodMap"', '"Popen"'))
    digest = digest_of(read_description(written))
    store.object_folder(digest).parent.mkdir(exist_ok=True)
    written.rename(store.object_folder(digest))
    with pytest.raises(DamagedArtifact, match="'Popen', which is no type of value"):
        Store(tmp_path).get(digest)


def test_pickles_are_not_read(tmp_path: Path) -> None:
    digest = Store(tmp_path).put(a_map())
    file = Store(tmp_path).object_folder(digest) / "period_um.npy"
    np.save(file, np.array([print], dtype=object), allow_pickle=True)
    with pytest.raises(DamagedArtifact, match="cannot be read"):
        Store(tmp_path).get(digest)


def test_a_torn_value_is_no_value(toys: Toys) -> None:
    run = toys.run()
    folder = run.store.object_folder(run.nodes["big"].artifact)
    os.truncate(folder / "period_um.npy", 140)
    assert toys.reasons()["big"] == "run: its result is no longer in the store"
    assert toys.ran() == ["big"]


def test_threads_that_parse_at_once_do_not_make_a_value_seem_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Python 3.11 counts for all threads together how deep a syntax tree goes, such as that of an array's header."""
    store, load, failures = Store(tmp_path), np.load, [True, False] * 4

    def trips(*words: object, **named: object) -> object:
        if failures.pop(0):
            raise SystemError("AST constructor recursion depth mismatch (before=75, after=71)")
        return load(*words, **named)

    artifact = store.put(a_map())
    monkeypatch.setattr(np, "load", trips)
    np.testing.assert_array_equal(store.get(artifact).period_um, a_map().period_um)


def test_damage_is_found_before_it_is_read_and_recomputed(toys: Toys) -> None:
    run = toys.run()
    flip(run.store.object_folder(run.nodes["big"].artifact) / "period_um.npy")
    assert toys.reasons("graph.cut.most=2")["big"] == "run: its stored result is damaged and was set aside"
    again = toys.run("graph.cut.most=2")
    assert {n.name: n.status for n in again.nodes.values()} == {
        "raw": "cached",
        "big": "ran",
        "cut": "ran",
        "means": "ran",
    }
    assert again["big"].period_um[0, 0] == 3


def test_a_record_that_is_no_json_is_no_record(toys: Toys) -> None:
    run = toys.run()
    run.store.recipe_file(run.nodes["raw"].key).write_text("{")
    assert toys.ran() == ["raw"]


def test_nothing_temporary_is_left(toys: Toys) -> None:
    run = toys.run()
    assert list(run.store.root.rglob(".*")) == []
