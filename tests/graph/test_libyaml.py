"""The fast loader reads YAML as OmegaConf's own does."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from omegaconf._utils import get_yaml_loader

from hydra_plugins.optibench_yaml import LibyamlConfigSource, loader
from pipeline.graph.config import configs_folder

TEXTS = [
    "a: [1, 1.0, 1e5, 1e-5, 1_000, 0x10, 010, 1:30, .5, -.inf, .nan, +3]",
    "a: {yes: no, on: off, ~: null, true: True, y: n}",
    "day: 2020-01-02\ntime: 2020-01-02 03:04:05\n",
    "text: \"a\\tb \\u00e9\"\nother: 'it''s'\nfolded: >\n  a\n  b\nkept: |\n  a\n  b\n",
    "base: &b {x: 1}\nmore: {<<: *b, y: 2}\n",
    "path: !!python/object/apply:pathlib.Path [a, b]\n",
    "a: ${rig}\nb: ${oc.env:HOME}\nc: ???\n",
    "",
    "# nothing\n",
]
WRONG = ["a: 1\na: 2\n", "a: [", "a: !!python/object/apply:os.system [ls]\n", "a:\n\t- b\n", "{a: 1, b: {c: 1, c: 2}}"]


def read(text: str, kind: object) -> object:
    return yaml.load(text, Loader=kind)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", [*TEXTS, *(path.read_text() for path in configs_folder().rglob("*.yaml"))])
def test_it_reads_what_omegaconf_reads(text: str) -> None:
    assert repr(read(text, loader())) == repr(read(text, get_yaml_loader()))


@pytest.mark.parametrize("text", WRONG)
def test_it_refuses_what_omegaconf_refuses(text: str) -> None:
    for kind in (get_yaml_loader(), loader()):
        with pytest.raises(yaml.MarkedYAMLError, match=r"line \d"):
            read(text, kind)


@given(st.text(alphabet="0123456789.eE+-_xo:~", max_size=8))
def test_it_sees_the_same_numbers(text: str) -> None:
    try:
        theirs = repr(read(f"a: {text}", get_yaml_loader()))
    except (yaml.YAMLError, ValueError):
        with pytest.raises((yaml.YAMLError, ValueError), match=r"\w"):
            read(f"a: {text}", loader())
        return
    assert repr(read(f"a: {text}", loader())) == theirs


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    from hydra.plugins.config_source import ConfigLoadError

    with pytest.raises(ConfigLoadError, match="Config not found"):
        LibyamlConfigSource("test", f"optibench://{tmp_path}").load_config("none")
