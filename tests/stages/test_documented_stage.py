"""The stage that docs/adding-a-stage.md shows, as the page shows it."""

from __future__ import annotations

import importlib.util
import inspect
import re
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import yaml

from pipeline.data.gratings import PeriodMap
from pipeline.errors import InputError

PAGE = Path(__file__).resolve().parents[2] / "docs" / "adding-a-stage.md"


def block(language: str) -> str:
    (text,) = re.findall(rf"```{language}\n(.*?)```", PAGE.read_text(), re.DOTALL)
    return text


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> ModuleType:
    path = tmp_path_factory.mktemp("documented") / "median.py"
    path.write_text(block("python"))
    spec = importlib.util.spec_from_file_location("documented_median", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_masked_pixels_take_no_part_and_stay_masked(stage: ModuleType) -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform(1.0, 1.4, (12, 15)).astype(np.float32)
    mask = rng.random(values.shape) > 0.3
    values[~mask] = np.nan
    values[rng.random(values.shape) > 0.95] = np.nan  # unknown inside the mask, too
    values.setflags(write=False)
    smooth = stage.median(PeriodMap(values, mask, 0.02, relative=False), radius_px=2)
    known = np.isfinite(values)
    padded = np.pad(values, 2, constant_values=np.nan)
    windows = np.lib.stride_tricks.sliding_window_view(padded, (5, 5)).reshape(*values.shape, 25)
    expected = np.full(values.shape, np.nan)
    expected[known] = np.nanmedian(windows[known], axis=-1)
    np.testing.assert_allclose(smooth.period_um, expected, rtol=1e-6)
    assert smooth.period_um.dtype == np.float32
    assert (smooth.mask is mask, smooth.pixel_mm, smooth.relative) == (True, 0.02, False)


def test_an_impossible_window_is_refused_before_anything_runs(stage: ModuleType) -> None:
    with pytest.raises(InputError, match=r"radius_px is -1\s+where: +radius_px"):
        stage._check_median(radius_px=-1)


def test_the_yaml_beside_it_names_its_input_and_its_setting(stage: ModuleType) -> None:
    node = yaml.safe_load(block("yaml"))["graph"]["smooth_period"]
    assert node.pop("stage") == f"extract.{stage.median.__name__}"
    assert set(node) == set(inspect.signature(stage.median).parameters)
    stage._check_median(radius_px=node["radius_px"])
