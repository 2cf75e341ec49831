"""Whatever the graph: parallel equals serial, pruned full, and merged separate; YAML survives a round trip."""

from __future__ import annotations

import math
import uuid
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from toys import Toys

from pipeline.bench import Experiment
from pipeline.codebase.source import Sources
from pipeline.execution.outcome import Silent
from pipeline.graph.catalog import Catalog
from pipeline.graph.compose import recomposed
from pipeline.graph.config import Configuration
from pipeline.runs import Run
from pipeline.storage.files import as_yaml

FEW = settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)

FACTORS = st.sampled_from([0.5, 1.0, 2.0, 3.0])


@st.composite
def graphs(draw: st.DrawFn) -> dict[str, dict[str, Any]]:
    """A random graph of toys: sources, then scalings and clippings of any earlier node, then means of some."""
    nodes: dict[str, dict[str, Any]] = {"n0": {"stage": "toy.source", "size": draw(st.integers(1, 3))}}
    for index in range(1, draw(st.integers(2, 9))):
        upstream = f"n{draw(st.integers(0, index - 1))}"
        kind = draw(st.sampled_from(["source", "scale", "clip"]))
        if kind == "source":
            nodes[f"n{index}"] = {"stage": "toy.source", "value": draw(FACTORS)}
        elif kind == "scale":
            nodes[f"n{index}"] = {"stage": "toy.scale", "maps": upstream, "factor": draw(FACTORS)}
        else:
            nodes[f"n{index}"] = {"stage": "toy.clip", "maps": upstream, "most": draw(FACTORS)}
    picked = draw(st.lists(st.sampled_from(sorted(nodes)), min_size=1, max_size=4))
    nodes["means"] = {"stage": "toy.mean", "maps": picked}
    return nodes


def experiment(toys: Toys, graph: dict[str, Any], store: Path, executor: str = "serial", **more: Any) -> Experiment:
    content = {
        "graph": graph,
        "executor": {"kind": executor},
        "paths": {"runs": str(store / "runs"), "store": str(store)},
        **more,
    }
    return Experiment.of(Configuration("toy", content, content, (), ()), catalog(toys))


@cache
def catalog(toys: Toys) -> Catalog:
    return Catalog(Sources())


def artifacts(run: Run) -> dict[str, str]:
    assert not run.failed
    return {name: node.artifact for name, node in run.nodes.items() if node.artifact}


def fresh(toys: Toys) -> Path:
    return toys.folder / uuid.uuid4().hex


@FEW
@given(graphs())
def test_parallel_equals_serial(toys: Toys, graph: dict[str, Any]) -> None:
    serial = experiment(toys, graph, fresh(toys)).run(Silent())
    parallel = experiment(toys, graph, fresh(toys), "threads").run(Silent())
    assert artifacts(parallel) == artifacts(serial)


@FEW
@given(graphs(), st.data())
def test_pruned_equals_full(toys: Toys, graph: dict[str, Any], data: st.DataObject) -> None:
    full = artifacts(experiment(toys, graph, fresh(toys)).run(Silent()))
    store = fresh(toys)
    wanted = data.draw(st.lists(st.sampled_from(sorted(graph)), min_size=1, max_size=2))
    part = experiment(toys, graph, store, until=wanted).run(Silent())
    assert artifacts(part).items() <= full.items()
    assert set(wanted) <= set(artifacts(part))
    rest = experiment(toys, graph, store).run(Silent())
    assert artifacts(rest) == full
    assert not {node.name for node in rest.nodes.values() if node.status == "ran"} & set(artifacts(part))


@FEW
@given(st.lists(graphs(), min_size=2, max_size=3))
def test_merged_equals_separate(toys: Toys, several: list[dict[str, Any]]) -> None:
    from pipeline.bench import carry_out, plan_of
    from pipeline.execution.executors import executor_of
    from pipeline.execution.merge import merge

    separate = [artifacts(experiment(toys, graph, fresh(toys)).run(Silent())) for graph in several]
    store = fresh(toys)
    experiments = [experiment(toys, graph, store) for graph in several]
    merged = merge([one.graph for one in experiments])
    plan = plan_of(experiments[0], merged.graph)
    outcomes = carry_out(plan, experiments[0].store, Sources(), executor_of({"kind": "threads"}), Silent())
    for index, alone in enumerate(separate):
        assert {name: o.artifact for name, o in merged.outcomes_of(index, outcomes).items()} == alone
    recipes = [
        (step.task.node.entry.name, str(step.task.settings), step.task.node.inputs) for step in plan.steps.values()
    ]
    assert all(recipes.count(recipe) == 1 for recipe in recipes)


SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**63), 2**63)
    | st.floats(allow_nan=False)
    | st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), max_size=12)
)
CONTENT = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text("abc_1 :#-é", max_size=5), inner, max_size=3),
    max_leaves=12,
)


@settings(max_examples=150, deadline=None)
@given(st.dictionaries(st.text("abc_", min_size=1, max_size=5), CONTENT, min_size=1, max_size=4))
def test_a_configuration_survives_yaml(content: dict[str, Any]) -> None:
    again = recomposed("toy", as_yaml(content), Path("config.yaml")).content
    assert again == content
    assert repr(again) == repr(content)  # 1 and 1.0 and True differ, -0.0 too


@settings(max_examples=60, deadline=None)
@given(st.floats(allow_nan=True, allow_infinity=True))
def test_every_float_survives_yaml(value: float) -> None:
    found = yaml.safe_load(as_yaml({"a": value}))["a"]
    assert found == value or (math.isnan(found) and math.isnan(value))
