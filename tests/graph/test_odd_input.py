"""Odd words, odd YAML, odd code: one clear error each, before anything runs."""

from __future__ import annotations

from pathlib import Path

import pytest
from toys import Toys

from pipeline.bench import Experiment
from pipeline.errors import InputError, PipelineError
from pipeline.graph.compose import compose, quoted


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["graph.big.factor=nan"], r"factor is nan[\s\S]*a finite number"),
        (["graph.big.factor=inf"], r"factor is inf[\s\S]*a finite number"),
        (["graph.raw.folder="], r"folder is ''"),
        (["paths=null"], r"'paths' is None[\s\S]*override paths=null"),
        (["paths.store=null"], r"'store' is None"),
        (["recapture=maybe"], r"'recapture' is 'maybe'[\s\S]*true or false"),
        (["graph=null"], r"'graph' is None"),
        (["executor.kind=thraeds"], r"no executor of kind 'thraeds'[\s\S]*'threads'\?"),
        (["recaptur=true"], r"no section 'recaptur'[\s\S]*did you mean 'recapture'\?"),
        (["big.factor=3"], r"no section 'big'[\s\S]*did you mean 'graph.big.factor=3'\?"),
        (["graph.bgi.factor=3"], r"no node 'bgi'[\s\S]*did you mean 'big'\?"),
        (["+foo=1"], r"no section 'foo', and nothing refers to it"),
        (["graph.raw={stage: toy.source, 3: 4}"], r"no setting or input '3'"),
    ],
)
def test_odd_words(toys: Toys, words: list[str], message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        toys.load(*words)


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("size_px=240", r"size_px is 240 [\s\S]*expected: \[columns, rows\], [\s\S]*for example \[240, 240\]"),
        ("tiles=3", r"tiles is 3 [\s\S]*expected: \[columns, rows\], [\s\S]*for example \[3, 3\]"),
        ("camera_mm=500", r"camera_mm is 500 [\s\S]*expected: \[x, y, z\], list of float$"),
        (
            "evaluator=fast",
            r"evaluator is 'fast'[\s\S]*'tabulated'\s+hint: +python -m pipeline show render.point_light",
        ),
        ("evaluator=table", r"evaluator is 'table'[\s\S]*did you mean 'tabulated'"),
    ],
)
def test_a_wrong_setting_is_answered_from_the_manual_of_its_stage(word: str, message: str) -> None:
    with pytest.raises(PipelineError, match=message):
        Experiment.load(["+experiment=render_point_light", f"graph.rendering.{word}"])


@pytest.mark.parametrize("name", ["größe", "写真", "my photos (1)", "a=b", "it's"])
def test_paths_need_no_quotes(toys: Toys, name: str) -> None:
    (toys.folder / name).mkdir()
    word = f"graph.raw.folder={toys.folder / name}"
    assert toys.load(word).graph.nodes["raw"].settings["folder"] == toys.folder / name


def test_words_that_hydra_understands_stay_as_they_are() -> None:
    for text in ("a=1,2", "a=[1,2]", "a='x y'", "a=range(1,3)", "~a", "a=null"):
        assert quoted(text) == text


def test_the_command_is_kept_as_it_was_written(toys: Toys) -> None:
    toys.experiment.write_text(toys.experiment.read_text() + "width: 3\n")
    toys.experiment.write_text(toys.experiment.read_text().replace("size: 3", "size: '${width}'"))
    command = toys.load("+graph.big.mode=up", "width=2").command
    assert command.startswith("python -m pipeline +experiment=toy")
    assert command.endswith("+graph.big.mode=up width=2")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"# @package _global_\ngraph: {a: \xff}\n", "not UTF-8"),
        (b"# @package _global_\ngraph: {a: [}\n", r"YAML file cannot be read[\s\S]*odd.yaml, line 2"),
        (b"# @package _global_\na: 1\na: 2\ngraph: {}\n", r"YAML file cannot be read: .*duplicate key"),
        (b"# @package _global_\ndefaults: 3\ngraph: {}\n", "cannot be composed|Defaults"),
        (b"# @package _global_\ndefaults: [{override /executor: nope}]\ngraph: {}\n", "nope"),
        (b"graph: {}\n", r"fills a section 'experiment'[\s\S]*# @package _global_"),
    ],
)
def test_odd_files(tmp_path: Path, content: bytes, message: str) -> None:
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "odd.yaml").write_bytes(content)
    with pytest.raises(InputError, match=message):
        compose(["+experiment=odd"], [tmp_path])


def test_broken_code_is_named(toys: Toys) -> None:
    toys.stages.with_name("broken.py").write_text("def f(:\n")
    with pytest.raises(PipelineError, match=r"code cannot be read[\s\S]*broken.py, line 1"):
        toys.load()


def test_odd_constants_and_defaults_hurt_only_who_names_them(toys: Toys) -> None:
    toys.stages.with_name("odd.py").write_text(
        "LIMIT = b'x'\n\nclass Odd:\n    kind = ...\n\ndef odd(*, names: list[str] = {1, 2}) -> 'int':\n    return 1\n"
    )
    toys.run()
    with pytest.raises(PipelineError, match=r"'toy.odd' cannot be used as a stage: the default of 'names'"):
        toys.load("graph.raw.stage=toy.odd")


def test_files_that_editors_leave_do_not_count(toys: Toys) -> None:
    toys.run()
    for name in ("maps.py~", "maps.py.orig", "maps.md"):
        toys.stages.with_name(name).write_text("left over")
    toys.stages.with_name("maps.yaml").mkdir()
    assert toys.ran() == []


def test_settings_of_the_experiments_own_section_need_no_plus(toys: Toys) -> None:
    text = toys.experiment.read_text().replace("size: 3", "size: '${print.dots.across}'")
    toys.experiment.write_text(text + "print: {dots: {across: 3, down: 2}}\n")
    assert toys.load("print.dots.across=5").graph.nodes["raw"].settings["size"] == 5
    with pytest.raises(InputError, match=r"'print\.dots' has no 'acros'[\s\S]*across, down[\s\S]*mean 'across'\?"):
        toys.load("print.dots.acros=5")
    with pytest.raises(InputError, match=r"no section 'pirnt'[\s\S]*did you mean 'print'\?"):
        toys.load("pirnt.dots.across=5")
    with pytest.raises(InputError, match=r"'paths' has no 'rnus'[\s\S]*did you mean 'runs'\?"):
        toys.load("paths.rnus=elsewhere")


def test_what_refers_to_a_section_may_be_overridden(toys: Toys) -> None:
    toys.experiment.write_text(toys.experiment.read_text().replace("factor: 3", "factor: ${times}") + "times: 3\n")
    assert toys.run("times=5")["big"].period_um[0, 0] == 5
    assert toys.run("graph.big.factor=4")["big"].period_um[0, 0] == 4
