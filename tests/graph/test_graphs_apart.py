"""A graph that goes past OmegaConf comes out as one that goes through it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from pipeline.graph.compose import _composed, opened

PLAIN = """\
graph:
  raw: {stage: toy.source, size: 3, value: 1e-3, folder: null}
  big: {stage: toy.scale, maps: [raw], up: true}
"""

APART = {
    "plain": PLAIN,
    "with a section beside it": PLAIN + "lights: [1, 2]\nrig: {size: 3, more: '${lights}'}\n",
    "with missing values": PLAIN + "  more: {stage: '???'}\n",
    "with an alias": "graph:\n  raw: &a {stage: toy.source, tags: [1, {b: c}]}\n  other: *a\n",
}
THROUGH = {
    "that refers to a section": PLAIN + "  lit: {stage: toy.lit, lights: '${lights}'}\nlights: [1, 2]\n",
    "that a section refers to": PLAIN + "size: ${graph.raw.size}\nuse: ${size}\n",
    "that a resolver may refer to": PLAIN + "size: '${oc.select:graph.raw.size}'\nuse: ${size}\n",
    "upon another": "defaults: [base, _self_]\n" + PLAIN,
    "that is null": "graph: null\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "experiment").mkdir()
    (tmp_path / "experiment" / "base.yaml").write_text(
        "# @package _global_\ngraph:\n  raw: {stage: toy.source, seed: 7}\n  first: {stage: toy.source}\n"
    )
    return tmp_path


def both_ways(
    folder: Path, text: str, monkeypatch: pytest.MonkeyPatch, *words: str
) -> tuple[list[dict[str, Any]], dict[str, Any], dict[str, Any]]:
    """What was set apart, the content composed with it apart, and composed as Hydra would."""
    (folder / "experiment" / "one.yaml").write_text("# @package _global_\n" + text)
    texts = ["+experiment=one", *(opened(word) for word in words)]
    seen: list[dict[str, Any]] = []
    from hydra_plugins import optibench_yaml

    original = optibench_yaml.graphs_apart

    @contextmanager
    def watched() -> Iterator[list[Any]]:
        with original() as graphs:
            yield graphs
        seen.extend(graphs)

    @contextmanager
    def never() -> Iterator[list[Any]]:
        yield []

    monkeypatch.setattr(optibench_yaml, "graphs_apart", watched)
    apart = _composed(texts, texts, [folder])
    monkeypatch.setattr(optibench_yaml, "graphs_apart", never)
    through = _composed(texts, texts, [folder])
    assert repr(apart) == repr(through)
    return seen, apart["content"], through["content"]


@pytest.mark.parametrize("text", [*APART.values(), *THROUGH.values()], ids=[*APART, *THROUGH])
def test_graphs_come_out_the_same(folder: Path, monkeypatch: pytest.MonkeyPatch, text: str) -> None:
    seen, apart, through = both_ways(folder, text, monkeypatch)
    assert apart == through
    if text in APART.values():
        assert seen == [through["graph"]]


@pytest.mark.parametrize(
    "word", ["graph.raw.size=4", "+graph.new={stage: toy.source}", "~graph.big", "graph={}", "++graph.raw.value=2"]
)
def test_overrides_reach_into_a_plain_graph(folder: Path, monkeypatch: pytest.MonkeyPatch, word: str) -> None:
    seen, apart, through = both_ways(folder, PLAIN, monkeypatch, word)
    assert apart == through
    assert not seen
