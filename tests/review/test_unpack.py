"""Bundles made to attack: every one is refused with its reason, and nothing of it is written or kept."""

from __future__ import annotations

import io
import json
import pickle
import shutil
import stat
import struct
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundles import Entries, change_json, changed, entries_of, first_recipe, tree, write_entries
from toys import Toys

from pipeline.cli import main
from pipeline.errors import InputError
from pipeline.review.bundle import write_bundle
from pipeline.review.rerun import rerun_of
from pipeline.review.unpack import Limits, _extract, opened, unpack
from pipeline.review.verification import verify
from pipeline.storage.artifact import digest_of
from pipeline.storage.keys import digest, digest_array
from pipeline.storage.sealed import unsealed


class Trap:
    """What would run, were a pickle of it read."""

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[str, ...]]:
        return print, ("the trap went off",)


@pytest.fixture(scope="module")
def bundled() -> dict[str, bytes]:
    """What one bundle holds, made once for all tests."""
    return {}


@pytest.fixture
def good(toys: Toys, tmp_path: Path, bundled: dict[str, bytes]) -> Path:
    """A bundle as it should be; the run is gone."""
    file = tmp_path / "good.zip"
    if not bundled:
        bundled["good"] = write_bundle(toys.run(), file).read_bytes()
        shutil.rmtree(toys.folder / "runs")
    file.write_bytes(bundled["good"])
    return file


@pytest.fixture
def refused(
    toys: Toys,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    record_property: Callable[[str, object], None],
) -> Callable[..., None]:
    """Check that whatever may be done with a bundle is refused for that reason, and leaves everything as it was."""
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    monkeypatch.chdir(tmp_path)

    def check(file: Path, reason: str, limits: Limits | None = None) -> None:
        before = tree(tmp_path)
        target = tmp_path / "target"
        with pytest.raises(InputError, match=reason):
            unpack(file, target, limits or Limits())
        with pytest.raises(InputError, match=reason), opened(file, limits):
            pytest.fail("the bundle was opened")
        with pytest.raises(InputError, match=reason):
            verify(file, limits=limits)
        with pytest.raises(InputError, match=reason):
            rerun_of(file, [f"paths.runs={tmp_path / 'runs'}"], limits=limits)
        if limits is None:
            assert main(["run", str(file), f"paths.runs={tmp_path / 'runs'}"]) == 2
        assert tree(tmp_path) == before
        assert "the trap went off" not in capsys.readouterr().out
        record_property("fault", ["bundle made to attack", 1, 0])

    return check


Refused = Callable[..., None]


def with_entry(file: Path, name: str, data: bytes = b"x", **more: Any) -> Path:
    """A copy of a bundle with one more entry, of any kind."""
    target = write_entries(file.with_name("spoiled.zip"), entries_of(file))
    info = zipfile.ZipInfo("placeholder")
    info.filename = name
    for attribute, value in more.items():
        setattr(info, attribute, value)
    with zipfile.ZipFile(target, "a") as bundle:
        bundle.writestr(info, data)
    return target


def test_the_good_one_is_taken(good: Path, tmp_path: Path) -> None:
    unpack(good, tmp_path / "target", Limits())
    names = {p.name for p in (tmp_path / "target").iterdir()}
    assert names == {"manifest.json", "config.yaml", "store"}
    assert all(not p.stat().st_mode & 0o111 for p in (tmp_path / "target").rglob("*") if p.is_file())


@pytest.mark.parametrize(
    "name",
    ["../escaped.txt", "/tmp/escaped.txt", "a/../../escaped.txt", "..", "outputs/..", "C:/escaped.txt", "a//b", "./a"],
)
def test_names_that_lead_outside(good: Path, refused: Refused, name: str) -> None:
    refused(with_entry(good, name), "it names a place outside itself")


def test_backslashes(good: Path, refused: Refused) -> None:
    refused(with_entry(good, "..\\escaped.txt"), "it names a place outside itself")


@pytest.mark.parametrize("name", ["a\x1b[2Jb", "a\nb", "x" * 300, "a/" + "y" * 300 + "/b"])
def test_names_that_no_file_has(good: Path, refused: Refused, name: str) -> None:
    refused(with_entry(good, name), "it has a name that no file of ours has")


def test_a_name_cut_short_by_a_null(good: Path, refused: Refused) -> None:
    file = with_entry(good, "harmless.txtXhidden")
    file.write_bytes(file.read_bytes().replace(b"harmless.txtXhidden", b"harmless.txt\0hidden"))
    refused(file, "it has a name that no file of ours has")


@pytest.mark.parametrize("kind", [stat.S_IFLNK, stat.S_IFIFO, stat.S_IFCHR, stat.S_IFSOCK, stat.S_IFDIR])
def test_links_and_special_files(good: Path, refused: Refused, kind: int) -> None:
    refused(
        with_entry(good, "outputs/odd", b"/etc", external_attr=(kind | 0o777) << 16), "it holds a link or a special"
    )


def test_a_link_in_the_place_of_a_value(good: Path, refused: Refused) -> None:
    name = next(n for n in entries_of(good) if n.endswith("period_um.npy"))
    file = changed(good, lambda entries: entries.pop(name))
    with zipfile.ZipFile(file, "a") as bundle:
        info = zipfile.ZipInfo(name)
        info.external_attr = (stat.S_IFLNK | 0o777) << 16
        bundle.writestr(info, "/etc/passwd")
    refused(file, "it holds a link or a special file")


@pytest.mark.parametrize("name", ["manifest.json", "MANIFEST.JSON"])
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_names_that_come_twice(good: Path, refused: Refused, name: str) -> None:
    refused(with_entry(good, name, b"{}"), "it names a file twice")


def test_encrypted_entries(good: Path, refused: Refused) -> None:
    file = write_entries(good.with_name("spoiled.zip"), entries_of(good))
    data = bytearray(file.read_bytes())
    for head, flags in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
        data[data.index(head) + flags] |= 1
    file.write_bytes(data)
    refused(file, "it holds an encrypted file")


def test_other_compressions(good: Path, refused: Refused) -> None:
    refused(with_entry(good, "outputs/a", b"x" * 100, compress_type=zipfile.ZIP_BZIP2), "compressed in a way")


def test_more_than_the_limit_declared(good: Path, refused: Refused) -> None:
    refused(good, "would unpack to", Limits(total_bytes=1000))


def test_the_limit_can_be_set_on_the_command_line(good: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["verify", "--limit-gb=0.000001", str(good)]) == 2
    assert "--limit-gb=N allows more" in capsys.readouterr().err
    assert main(["verify", "--limit-gb", "1", str(good)]) == 0
    assert main(["verify", "--limit-gb", "much", str(good)]) == 2
    assert main(["verify", "--limit-gb=-1", str(good)]) == 2


def test_too_many_entries(good: Path, refused: Refused) -> None:
    refused(good, "has [0-9]+ entries", Limits(entries=3))


def test_a_bomb_by_its_ratio(good: Path, refused: Refused) -> None:
    file = write_entries(good.with_name("spoiled.zip"), {**entries_of(good), "outputs/zeros": bytes(70 * 2**20)})
    refused(file, "unpacks to more than 200 times its size")


def test_a_bomb_that_declares_less_than_it_holds(good: Path, refused: Refused) -> None:
    name = next(n for n in entries_of(good) if n.endswith("period_um.npy"))
    file = changed(good, lambda entries: entries.update({name: bytes(10_000_000)}))
    data = file.read_bytes()
    file.write_bytes(data.replace(struct.pack("<I", 10_000_000), struct.pack("<I", 1000)))
    refused(file, "is no bundle that can be read: Bad CRC-32|cannot be read")


def test_what_is_written_counts_and_not_only_what_is_declared(good: Path, tmp_path: Path) -> None:
    with (
        zipfile.ZipFile(good) as bundle,
        pytest.raises(InputError, match="the bundle unpacks to more than"),
    ):
        _extract(bundle, bundle.infolist(), tmp_path / "target", Limits(total_bytes=2000))


def test_entries_that_share_their_bytes(good: Path, refused: Refused) -> None:
    file = with_entry(good, "outputs/b", b"y" * 1000)
    with zipfile.ZipFile(file, "a") as bundle:
        twin = zipfile.ZipInfo("outputs/c")
        first = bundle.getinfo("outputs/b")
        for name in ("header_offset", "CRC", "compress_size", "file_size", "compress_type", "external_attr"):
            setattr(twin, name, getattr(first, name))
        bundle.filelist.append(twin)
        bundle.NameToInfo[twin.filename] = twin
        bundle._didModify = True  # type: ignore[attr-defined]
    refused(file, "it shares its bytes with")


def test_a_directory_that_would_fill_the_memory(good: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.review.unpack.MOST_DIRECTORY_BYTES", 100)
    refused(good, "the directory of .* has [0-9]+ bytes")


@pytest.mark.parametrize(
    "data", [b"", b"PK", b"no zip at all" * 10, b"PK\x05\x06" + bytes(18), b"PK\x05\x06" + b"\xff" * 18]
)
def test_what_is_no_zip_file(good: Path, refused: Refused, data: bytes) -> None:
    file = good.with_name("spoiled.zip")
    file.write_bytes(data)
    refused(file, "no zip file|no bundle|holds no|the directory of")


def test_a_torn_bundle(good: Path, refused: Refused) -> None:
    file = good.with_name("spoiled.zip")
    file.write_bytes(good.read_bytes()[1000:])
    refused(file, "no bundle|it shares|cannot be read")


@pytest.mark.parametrize("name", ["manifest.json", "config.yaml"])
def test_what_every_bundle_has(good: Path, refused: Refused, name: str) -> None:
    refused(changed(good, lambda entries: entries.pop(name)), f"holds no {name}")


@pytest.mark.parametrize(
    "name",
    [
        "store/memory/sources.json",
        "store/objects/aa/x.npy",
        "store/in-use",
        "store/recipes/../x",
        "store/claims/a.json",
    ],
)
def test_files_that_no_store_has(good: Path, refused: Refused, name: str) -> None:
    refused(with_entry(good, name), "that no store has|a place outside itself")


def value_of(entries: Entries, field: str = "period_um.npy") -> tuple[str, str]:
    """Folder and digest of the first value that has such a file."""
    name = next(n for n in sorted(entries) if n.endswith(f"/{field}"))
    folder = name.rpartition("/")[0]
    return folder, folder.rpartition("/")[2]


def rename_value(entries: Entries, folder: str, old: str) -> None:
    """Give a value whose description was changed the name that its new digest asks for, everywhere."""
    new = digest_of(json.loads(entries[f"{folder}/meta.json"])["value"])
    for name in [n for n in entries if n.startswith(folder)]:
        entries[f"store/objects/{new[:2]}/{new}/{name.rpartition('/')[2]}"] = entries.pop(name)
    for name in [n for n in entries if "/recipes/" in n or n == "manifest.json"]:
        entries[name] = json.dumps(unsealed(entries[name])).replace(old, new).encode()


def npy(array: np.ndarray, *, allow_pickle: bool = False) -> bytes:
    file = io.BytesIO()
    np.save(file, array, allow_pickle=allow_pickle)
    return file.getvalue()


def header(shape: tuple[int, ...], descr: str = "<f4") -> bytes:
    file = io.BytesIO()
    np.lib.format.write_array_header_1_0(file, {"descr": descr, "fortran_order": False, "shape": shape})
    return file.getvalue()


def test_a_value_that_is_not_that_of_its_name(good: Path, refused: Refused) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        other = npy(np.full((3, 3), 9, np.float32))
        assert len(other) == len(entries[f"{folder}/period_um.npy"])
        entries[f"{folder}/period_um.npy"] = other

    refused(changed(good, swap), "damaged or forged: .*has changed since it was written")


def test_a_description_that_is_not_that_of_its_name(good: Path, refused: Refused) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        change_json(
            entries, f"{folder}/meta.json", lambda meta: meta["value"]["fields"].update(pixel_mm=None, relative=False)
        )

    refused(changed(good, swap), "damaged or forged: .*is not the value of its name")


def test_a_pickle_in_the_place_of_an_array(good: Path, refused: Refused) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        data = npy(np.array([[Trap()]], object), allow_pickle=True)
        entries[f"{folder}/period_um.npy"] = data
        change_json(
            entries,
            f"{folder}/meta.json",
            lambda m: m["value"]["fields"]["period_um"].update(bytes=len(data), shape=[1, 1]),
        )

    refused(changed(good, swap), "damaged or forged: .*is an array of object")


def test_a_bare_pickle(good: Path, refused: Refused) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        entries[f"{folder}/period_um.npy"] = pickle.dumps(Trap())

    refused(changed(good, swap), "damaged or forged: .*has no header of an array")


@pytest.mark.parametrize("shape", [(2**40, 2**20), (2**62, 2**62), (3, 3, 10**9), (-1, 3)])
def test_a_header_that_claims_a_huge_shape(good: Path, refused: Refused, shape: tuple[int, ...]) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        data = header(shape) + bytes(36)
        entries[f"{folder}/period_um.npy"] = data
        change_json(
            entries,
            f"{folder}/meta.json",
            lambda m: m["value"]["fields"]["period_um"].update(bytes=len(data), shape=list(shape)),
        )

    refused(changed(good, swap), "damaged or forged: .*(do not fit an array|no header of an array)")


@pytest.mark.parametrize("text", [b"{'descr': '<f4', 'shape': " + b"(" * 3000, b"{", b"exit()", b"\xff" * 100])
def test_a_header_that_is_no_header(good: Path, refused: Refused, text: bytes) -> None:
    def swap(entries: Entries) -> None:
        folder, _ = value_of(entries)
        entries[f"{folder}/period_um.npy"] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text

    refused(changed(good, swap), "damaged or forged: .*has no header of an array")


@pytest.mark.parametrize(
    "change",
    [
        lambda v: v["fields"]["period_um"].update(array="../../../escaped.npy"),
        lambda v: v["fields"]["period_um"].update(array="/etc/passwd"),
        lambda v: v["fields"]["period_um"].update(array="mask.npy"),
        lambda v: v["fields"]["period_um"].update(array="meta.json"),
        lambda v: v["fields"]["period_um"].update(array=3),
        lambda v: v["fields"]["period_um"].update(shape="33"),
        lambda v: v["fields"]["period_um"].update(shape=[3.0, 3.0]),
        lambda v: v["fields"]["period_um"].update(shape=[True, 9]),
        lambda v: v["fields"]["period_um"].update(dtype="|O8"),
        lambda v: v["fields"]["period_um"].update(more=1),
        lambda v: v["fields"].update(pixel_mm=0.5),
        lambda v: v["fields"].update(pixel_mm={"number": "0x1p99999"}),
        lambda v: v["fields"].update(pixel_mm={"number": 5}),
        lambda v: v["fields"].update(pixel_mm=10**300),
        lambda v: v["fields"].update(pixel_mm={"eval": "exit()"}),
        lambda v: v["fields"].update(__reduce__="x"),
        lambda v: v.update({"class": "Popen"}),
        lambda v: v.update({"class": "Mapping"}),
        lambda v: v.update({"fields": []}),
        lambda v: v["fields"].pop("period_um"),
    ],
)
def test_descriptions_of_wrong_types_unknown_classes_and_files_elsewhere(
    good: Path, refused: Refused, change: Callable[[dict[str, Any]], Any]
) -> None:
    def swap(entries: Entries) -> None:
        folder, old = value_of(entries)
        change_json(entries, f"{folder}/meta.json", lambda meta: change(meta["value"]))
        with suppress(InputError, TypeError, ValueError, KeyError, AttributeError, OverflowError):
            rename_value(entries, folder, old)

    refused(changed(good, swap), "damaged or forged")


@pytest.mark.parametrize("value", [[], "x", 3, None, {"format": 1}, {"format": 2, "value": {}}])
def test_a_description_that_is_none(good: Path, refused: Refused, value: Any) -> None:
    def swap(entries: Entries) -> None:
        entries[f"{value_of(entries)[0]}/meta.json"] = json.dumps(value).encode()

    refused(changed(good, swap), "damaged or forged")


def test_a_file_that_a_description_does_not_name(good: Path, refused: Refused) -> None:
    folder, _ = value_of(entries_of(good))
    refused(with_entry(good, f"{folder}/more.npy"), "which its description does not name")


def test_json_that_is_huge(good: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.review.untrusted.MOST_DESCRIPTION_BYTES", 100)
    refused(good, "damaged or forged: .*meta.json has [0-9]+ bytes")


@pytest.mark.parametrize("text", ["[" * 100_000, '{"a":' * 100_000, "9" * 5000, "{", "\xff", "[]", '"x"'])
def test_a_manifest_that_is_no_json_of_ours(good: Path, refused: Refused, text: str) -> None:
    refused(
        changed(good, lambda entries: entries.update({"manifest.json": text.encode("latin1")})),
        "cannot be read|manifest",
    )


def test_json_nested_deeper_than_ours(good: Path, refused: Refused) -> None:
    deep: Any = {}
    for _ in range(100):
        deep = {"a": deep}

    def swap(entries: Entries) -> None:
        change_json(entries, "manifest.json", lambda manifest: manifest.update(raw=deep))

    refused(changed(good, swap), "manifest.json is nested deeper than")


@pytest.mark.parametrize(
    ("change", "place"),
    [
        (lambda m: m.update(experiment="../../escaped"), "experiment"),
        (lambda m: m.update(experiment=".."), "experiment"),
        (lambda m: m.update(experiment="/tmp/escaped"), "experiment"),
        (lambda m: m.update(digest="../../../x"), "digest"),
        (lambda m: m.update(nodes={}), "nodes"),
        (lambda m: m.pop("nodes"), "nodes"),
        (lambda m: m.update(metrics={"a": "1"}), r"metrics\.a"),
        (lambda m: m.update(overrides="abc"), "overrides"),
        (lambda m: m.update(raw=[]), "raw"),
        (lambda m: m["nodes"][0].update(name="../x"), r"nodes\[0\]\.name"),
        (lambda m: m["nodes"][0].update(artifact="../../../../etc"), r"nodes\[0\]\.artifact"),
        (lambda m: m["nodes"][0].update(key=5), r"nodes\[0\]\.key"),
        (lambda m: m["nodes"][0].update(inputs=[1]), r"nodes\[0\]\.inputs"),
        (lambda m: m["nodes"][0].update(status="done"), r"nodes\[0\]\.status"),
        (lambda m: m["nodes"][0].update(seconds=True), r"nodes\[0\]\.seconds"),
    ],
)
def test_manifests_of_wrong_types(good: Path, refused: Refused, change: Callable[[Any], Any], place: str) -> None:
    file = changed(good, lambda entries: change_json(entries, "manifest.json", change))
    refused(file, f"manifest has a wrong '{place}'")


@pytest.mark.parametrize("name", ["store", "store_from_here"])
@pytest.mark.parametrize("place", ["/etc", "../..", "memory://x/y"])
def test_a_manifest_that_looks_for_its_store_elsewhere(good: Path, refused: Refused, name: str, place: str) -> None:
    file = changed(good, lambda entries: change_json(entries, "manifest.json", lambda m: m.update({name: place})))
    refused(file, "its manifest looks for values elsewhere")


def test_a_manifest_of_values_that_are_not_there(good: Path, refused: Refused) -> None:
    def swap(entries: Entries) -> None:
        change_json(entries, "manifest.json", lambda m: m["nodes"][0].update(artifact="0" * 40))

    refused(changed(good, swap), "it lacks the value of a node")


@pytest.mark.parametrize(
    "change",
    [
        lambda r: r.update(key="0" * 40),
        lambda r: r.update(artifact="../../x"),
        lambda r: r.update(artifact="0" * 40),
        lambda r: r.update(type="OrientationMap" if r["type"] != "OrientationMap" else "PeriodMap"),
        lambda r: r.update(settings=[]),
        lambda r: r.update(code="../../x"),
        lambda r: r.update(format=99),
        lambda r: r.pop("stage"),
        lambda r: r.update(inputs={"a": ["x"]}),
        lambda r: r.update(commit=["--output=x"]),
    ],
)
def test_records_that_are_none(good: Path, refused: Refused, change: Callable[[Any], Any]) -> None:
    file = changed(good, lambda entries: change_json(entries, first_recipe(entries), change))
    refused(file, "record")


def test_a_record_that_is_huge(good: Path, refused: Refused, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pipeline.review.unpack.MOST_RECORD_BYTES", 50)
    refused(good, "has [0-9]+ bytes")


def test_a_listing_that_is_not_the_one_of_its_name(good: Path, refused: Refused) -> None:
    name = next(n for n in entries_of(good) if "/provenance/" in n)
    file = changed(good, lambda entries: change_json(entries, name, lambda c: c.update(more="x")))
    refused(file, "a listing that is not the one of its name")


@pytest.mark.parametrize(
    "text",
    [
        "a: &a [x, x]\nb: &b [*a, *a]\nc: [*b, *b]\n",
        "a: !!python/object/apply:os.system ['touch escaped']\n",
        "- a list",
        "{",
        "a: " + "[" * 500 + "]" * 500,
        "a: '" + "x" * 2_000_000 + "'",
    ],
)
def test_yaml_that_is_not_plain(good: Path, tmp_path: Path, text: str) -> None:
    file = changed(good, lambda entries: entries.update({"config.yaml": text.encode()}))
    before = tree(tmp_path)
    with pytest.raises(InputError, match=r"this YAML|this is no YAML"):
        verify(file)
    with pytest.raises(InputError, match=r"this YAML|this is no YAML"):
        rerun_of(file, [f"paths.runs={tmp_path / 'runs'}"])
    assert tree(tmp_path) == before


def test_what_a_value_is_digested_by_is_what_is_checked() -> None:
    array = np.arange(4, dtype=np.float32)
    entry = {"array": "a.npy", "dtype": "<f4", "shape": [4], "digest": digest_array(array), "bytes": 144}
    assert digest_of(entry) == digest_of({**entry, "array": "b.npy"}) != digest(None)
