"""Experiments in a folder and stages in a package of the user's work like ours; the documented example is run."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import time
from contextlib import ExitStack, suppress
from pathlib import Path
from subprocess import DEVNULL

import numpy as np
import pytest

from pipeline.data.gratings import OrientationMap
from pipeline.data.metrics import Metrics
from pipeline.data.pictures import PictureSeries
from pipeline.errors import InputError
from pipeline.meshes import as_mesh
from pipeline.runs import open_run

ROOT = Path(__file__).resolve().parents[1]
SMALL = ["until=[evaluate,quality]", "graph.sample.pixel_mm=0.02", "rig.camera.pixel_mm=0.06"]


@pytest.fixture(scope="module")
def lab(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The example, its package installed into a folder."""
    folder = tmp_path_factory.mktemp("lab")
    shutil.copytree(ROOT / "examples" / "mylab", folder / "mylab")
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--no-build-isolation", "--no-index"]
    subprocess.run([*command, "--target", str(folder / "site"), str(folder / "mylab")], check=True, capture_output=True)
    return folder


def bench(lab: Path, *words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(lab / "site"), str(ROOT)])}
    command = [sys.executable, "-m", "pipeline", *words]
    return subprocess.run(command, cwd=lab, env=environment, capture_output=True, text=True, check=False)


def test_the_example_runs_is_fingerprinted_and_reported(lab: Path) -> None:
    words = ["--config-dir", str(lab / "mylab" / "configs"), "+experiment=warming_panel", *SMALL]
    done = bench(lab, *words)
    assert done.returncode == 0, done.stderr
    run = open_run(lab / Path(done.stdout.splitlines()[-1].removeprefix("report: ")).parent)
    assert run.nodes["smooth"].stage == "smooth.axial_median"
    assert run.nodes["photos"].settings["rig"]["light"]["device"] == "panels.WarmingPanel"
    assert run.versions["mylab"] == "1.0"
    assert run.metrics["orientation_error_mean_deg"] < 2
    assert "axial_median" in run.report.read_text()
    assert "--config-dir" in run.command
    why = bench(lab, "why", *words).stdout
    assert "0 would run" in why
    helper = lab / "site" / "mylab" / "windows.py"
    helper.write_text(helper.read_text().replace("2 * radius + 1", "1 + 2 * radius"))
    why = bench(lab, "why", *words).stdout
    assert "code changed: mylab/windows.py" in why
    assert "1 would run, 1 depend on these" in why


def test_lists_and_manuals_know_them(lab: Path) -> None:
    assert "smooth.axial_median" in bench(lab, "list", "stages").stdout
    assert "panels.WarmingPanel" in bench(lab, "list", "devices").stdout
    assert "radius_px: int = 2" in bench(lab, "show", "smooth.axial_median").stdout
    listed = bench(lab, "list", "experiments", "--config-dir", str(lab / "mylab" / "configs")).stdout
    assert "warming_panel" in listed
    assert "polarization_logo" in listed


def address_in(scheduler_file: Path) -> str:
    """Where the scheduler listens, as soon as its file says so."""
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        with suppress(FileNotFoundError, json.JSONDecodeError):
            return str(json.loads(scheduler_file.read_text())["address"])
        time.sleep(0.1)
    pytest.fail("the scheduler did not start")


def test_a_cluster_at_an_address_runs_them_and_refuses_other_code(lab: Path) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(lab / "site"), str(ROOT)])}
    with ExitStack() as stack:

        def start(*words: str) -> None:
            command = [sys.executable, "-m", "distributed.cli." + words[0], *words[1:]]
            process = subprocess.Popen(command, cwd=lab, env=environment, stdout=DEVNULL, stderr=DEVNULL)
            stack.callback(process.wait)
            stack.callback(process.terminate)

        start("dask_scheduler", "--port", "0", "--no-dashboard", "--scheduler-file", str(lab / "scheduler.json"))
        start("dask_worker", "--no-dashboard", "--nthreads", "2", "--scheduler-file", str(lab / "scheduler.json"))
        address = address_in(lab / "scheduler.json")
        words = ["--config-dir", str(lab / "mylab" / "configs"), "+experiment=warming_panel", *SMALL]
        words += ["paths.runs=cluster", "executor=distributed", f"executor.address={address}"]
        done = bench(lab, *words)
        assert done.returncode == 0, done.stderr
        assert "7 stages run, 0 from the store" in done.stdout
        with_other_code = lab / "site" / "mylab" / "windows.py"
        text = with_other_code.read_text()
        with_other_code.write_text(text.replace("radius: int", "radius: float"))
        done = bench(lab, *words)
        with_other_code.write_text(text)
        assert done.returncode == 1
        assert "the worker's mylab.windows is not the code that the run was planned with" in done.stderr


def test_a_check_of_theirs_refuses_before_anything_runs(lab: Path) -> None:
    words = ["--config-dir", str(lab / "mylab" / "configs"), "+experiment=warming_panel", "graph.smooth.radius_px=99"]
    done = bench(lab, *words, "paths.runs=elsewhere")
    assert done.returncode == 2
    assert "radius_px is 99" in done.stderr
    assert not list((lab / "elsewhere").rglob("*.npy"))


def test_an_experiment_without_its_first_line_is_explained(tmp_path: Path) -> None:
    from pipeline.graph.compose import compose

    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "mine.yaml").write_text("graph: {fit: {stage: fit.cosine}}\n")
    with pytest.raises(InputError, match=r"fills a section 'experiment'[\s\S]*# @package _global_"):
        compose(["+experiment=mine"], [tmp_path])
    with pytest.raises(InputError, match="there is no folder"):
        compose(["+experiment=mine"], [tmp_path / "nowhere"])


def test_images_become_meshes_with_y_up() -> None:
    pytest.importorskip("pyvista")
    angle = np.arange(6, dtype=np.float32).reshape(2, 3)
    mesh = as_mesh(OrientationMap(angle, angle, angle, angle > 0, pixel_mm=0.5))
    assert mesh.dimensions == (4, 3, 1)
    assert mesh.bounds == pytest.approx((-0.75, 0.75, -0.5, 0.5, 0.0, 0.0))
    top_left = mesh.find_containing_cell((-0.7, 0.4, 0.0))
    assert mesh.cell_data["orientation_rad"][top_left] == angle[0, 0]
    rgb = np.random.default_rng(0).random((2, 4, 5, 3)).astype(np.float32)
    series = as_mesh(PictureSeries(rgb, light_mm=np.zeros((2, 3)), camera_mm=np.zeros(3), pixel_mm=1.0))
    np.testing.assert_array_equal(series.cell_data["rgb_1"][0], rgb[1, -1, 0])
    with pytest.raises(InputError, match="holds no image"):
        as_mesh(Metrics({"a": 1.0}))


def test_a_reader_who_has_gone_is_no_error(lab: Path) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "pipeline", "list", "stages"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(
        command, cwd=lab, env=environment, stdout=writer, stderr=subprocess.PIPE, text=True, check=False
    )
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
