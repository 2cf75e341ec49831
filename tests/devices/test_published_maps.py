"""Published maps: found on this machine, downloaded, or refused with what to do."""

from __future__ import annotations

import hashlib
import http.server
import inspect
import threading
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pooch
import pytest
from photo_makers import write_image

from pipeline.devices.published_maps import PUBLISHED, PublishedMap, published_file
from pipeline.errors import InputError
from pipeline.stages.capture.published_height_map import published_height_map


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache of a user's, and no folder named."""
    folder = tmp_path / "cache"
    monkeypatch.setattr(pooch, "os_cache", lambda project: folder)
    monkeypatch.delenv("OPTIBENCH_DATA", raising=False)
    return folder


@pytest.fixture
def source(tmp_path: Path) -> Iterator[tuple[Path, str]]:
    """A folder that is published on this machine, and its address."""
    folder = tmp_path / "published"
    folder.mkdir()

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments: object) -> None:
            super().__init__(*arguments, directory=str(folder))

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield folder, f"http://127.0.0.1:{server.server_port}"
        server.shutdown()


def published_in(folder: Path, address: str) -> PublishedMap:
    file = write_image(folder / "map.png", np.arange(12, dtype=np.uint8).reshape(3, 4))
    digest = hashlib.sha256(file.read_bytes()).hexdigest()
    return PublishedMap("map.png", f"{address}/map.png", digest, "A ramp", 0.1, 0.255)


def test_a_map_is_downloaded_once(source: tuple[Path, str], cache: Path) -> None:
    published = published_in(*source)
    assert published_file(published) == cache / "map.png"
    (source[0] / "map.png").unlink()
    assert published_file(published) == cache / "map.png"


def test_a_copy_in_the_named_folder_comes_first(
    source: tuple[Path, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    published = replace(published_in(*source), source="http://127.0.0.1:9/map.png")
    monkeypatch.setenv("OPTIBENCH_DATA", str(source[0]))
    assert published_file(published) == source[0] / "map.png"
    assert not (tmp_path / "cache").exists()


def test_a_copy_that_is_another_file_is_not_used(
    source: tuple[Path, str], cache: Path, caplog: pytest.LogCaptureFixture
) -> None:
    published = published_in(*source)
    cache.mkdir()
    (cache / "map.png").write_bytes(b"another file")
    assert hashlib.sha256(published_file(published).read_bytes()).hexdigest() == published.sha256
    assert "map.png is not what was published, and is not used" in caplog.text


def test_without_a_network_it_is_said_what_to_do(cache: Path) -> None:
    published = PublishedMap("map.png", "http://127.0.0.1:9/map.png", "ab" * 32, "A ramp", 0.1, 0.255)
    words = r"map.png is not on this machine and cannot be downloaded: its source cannot be reached\s+where: +http://127.0.0.1:9/map.png"
    with pytest.raises(InputError, match=rf"{words}\s+expected: a network, or a copy in the folder .* OPTIBENCH_DATA"):
        published_file(published)


def test_what_is_no_longer_what_was_published_is_refused(source: tuple[Path, str], cache: Path) -> None:
    published = replace(published_in(*source), sha256="ab" * 32)
    with pytest.raises(InputError, match=r"map.png is not on this machine and cannot be downloaded: .*hash"):
        published_file(published)
    assert not list(cache.glob("*.png"))
    with pytest.raises(InputError, match=r"cannot be downloaded: 404"):
        published_file(replace(published, source=f"{source[1]}/gone.png"))


def test_every_map_has_a_name_in_the_stage_and_a_source() -> None:
    annotation = inspect.get_annotations(published_height_map, eval_str=True)["name"]
    assert get_args(annotation) == tuple(PUBLISHED)
    for published in PUBLISHED.values():
        assert published.source.startswith("https://raw.githubusercontent.com/simplay/Bachelor-Thesis/")
        assert "MIT" in published.caption


@pytest.mark.parametrize("name", PUBLISHED)
def test_the_published_maps_are_those_at_hand(
    name: str, measurements: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The sheds are 65 um wide, or crops of 100 samples of 65 nm; the tiles are one period of 2.5 um."""
    monkeypatch.setenv("OPTIBENCH_DATA", str(measurements / "afm"))
    surface = published_height_map(name=name)
    side = surface.height_um.shape[0]
    wide = {"elaphe": 65, "xenopeltis": 65, "elaphe_crop": 6.5, "xenopeltis_crop": 6.5}.get(name, 2.5)
    assert side * surface.pitch_um == pytest.approx(wide)
    assert surface.periodic == name.endswith("tile")
    assert surface.caption == PUBLISHED[name].caption
    assert 0.7 < surface.height_um.max() / PUBLISHED[name].full_height_um <= 1.0001
    doubled = published_height_map(name=name, full_height_um=2 * PUBLISHED[name].full_height_um)
    np.testing.assert_allclose(doubled.height_um, 2 * surface.height_um, rtol=1e-6)
    assert not caplog.records
