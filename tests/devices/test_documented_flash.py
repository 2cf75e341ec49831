"""The folder that docs/flash.md describes is accepted as the page describes it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from photo_makers import write_image

from pipeline.devices.flash_folder import FlashFolder
from pipeline.stages.capture.flash_photographs import flash_photographs

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "flash.md").read_text()


def test_the_documented_folder_is_replayed(tmp_path: Path) -> None:
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.DOTALL)
    (tmp_path / "capture.yaml").write_text(text)
    for name in {*re.findall(r"\w+\.jpg", text)}:
        write_image(tmp_path / name, np.full((8, 10, 3), 90, np.uint8), Compression="jpeg:100")
    rig = FlashFolder(folder=tmp_path)
    rig.check()
    taken = flash_photographs(rig=rig)
    assert taken.images.shape == (2, 2, 8, 10, 3)
    assert taken.light_mm[1].tolist() == [0, 120, 250]
    assert taken.sheet_mm == (297.0, 210.0)
    assert (taken.wavelength_nm, taken.bandwidth_nm, taken.light_sigma_mm) == (530, 10, 4)
    assert taken.room is not None
