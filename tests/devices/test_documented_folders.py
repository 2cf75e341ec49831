"""The folders that docs/own-photos.md describes are accepted as the page describes them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from photo_makers import write_image

from pipeline.codebase.source import Sources
from pipeline.devices.replay import PhotoFolder
from pipeline.graph.catalog import Catalog
from pipeline.graph.config import options
from pipeline.stages.capture.polarizer_sequence import polarizer_sequence
from pipeline.stages.capture.recorded_point_light import recorded_point_light

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "own-photos.md").read_text()
BLOCKS = [yaml.safe_load(text) for text in re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)]


def folder_of(block: dict[str, Any], folder: Path) -> Path:
    """A folder with every file that a capture.yaml of the page names."""
    rng = np.random.default_rng(0)
    named = [photo["file"] for photo in block["photos"]]
    for name in [*named, *block.get("dark", []), *block.get("flat", [])]:
        bright = 0.01 if name in block.get("dark", []) else 0.5
        pixels = bright * (1 + 0.1 * rng.random((8, 10)))
        write_image(
            folder / name,
            (pixels if name.endswith("tif") else 60000 * pixels).astype(
                np.float32 if name.endswith("tif") else np.uint16
            ),
        )
    if "mask" in block:
        write_image(folder / block["mask"], np.full((8, 10), 255, np.uint8))
    (folder / "capture.yaml").write_text(yaml.safe_dump({"kind": "polarizer_sequence", **block}))
    return folder


def test_the_page_has_a_sequence_a_mosaic_and_a_torch() -> None:
    assert [block.get("kind") for block in BLOCKS] == ["polarizer_sequence", None, "point_light"]


@pytest.mark.parametrize("block", BLOCKS[:2], ids=["sequence", "mosaic"])
def test_documented_sequences_are_replayed(block: dict[str, Any], tmp_path: Path) -> None:
    rig = PhotoFolder(folder=folder_of(block, tmp_path))
    rig.check()
    assert len(polarizer_sequence(rig=rig).images) == 4


def test_the_documented_torch_is_replayed(tmp_path: Path) -> None:
    series = recorded_point_light(folder=folder_of(BLOCKS[2], tmp_path))
    assert series.rgb.shape == (2, 8, 10, 3)
    assert series.light_mm[1].tolist() == [70, 121, 300]


def test_every_setting_of_the_replay_is_on_the_page_and_most_in_its_yaml() -> None:
    settings = set(Catalog(Sources()).devices["replay.PhotoFolder"].settings)
    table = PAGE.split("## Settings")[1].split("##")[0]
    rows = [row for row in table.splitlines() if row.startswith("| `")]
    named = set(re.findall(r"`(\w+)`", " ".join(row.split("|")[1] for row in rows if "`rig.`" not in row)))
    assert named == settings
    assert set(yaml.safe_load(options("rig")["replay"].read_text())) - {"device", "simulated"} <= settings
