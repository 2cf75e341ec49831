"""Recomputing a run in a fresh store, and saying of every node whether it came out as it did then."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pipeline.bench import Experiment, carry_out, plan_of
from pipeline.errors import InputError, PipelineError
from pipeline.execution.executors import executor_of
from pipeline.execution.messages import Messages
from pipeline.execution.outcome import Listener, Outcome, Silent
from pipeline.execution.plan import Plan, inputs_of
from pipeline.execution.provenance import commit, versions
from pipeline.execution.workbench import call_stage
from pipeline.graph.nodes import Node
from pipeline.review.compare import Difference, checked_tolerance, compare
from pipeline.review.rerun import kept_configuration, missing_files, record_of_node
from pipeline.review.unpack import Limits, opened
from pipeline.review.untrusted import read_value
from pipeline.runs import NodeRun, Run
from pipeline.storage.artifact import DamagedArtifact, content_of, digest_of
from pipeline.storage.record import Record

_NOT_AT_HAND = "the run's value is not at hand, so that only its digest could be compared"

Verdict = Literal["identical", "within tolerance", "different", "taken over", "failed"]


@dataclass(frozen=True)
class NodeVerdict:
    """What became of one node.

    Attributes
    ----------
    name, stage : str
        Name in the graph, and stage.
    verdict : {"identical", "within tolerance", "different", "taken over", "failed"}
        How its value compares with the run's.
    differences : tuple of Difference
        How it differs, field by field; within tolerance and different only.
    changed_inputs : tuple of str
        Upstream nodes whose values did not come out as they did in the run.
    alone : str
        What the stage gave on the run's own inputs, where its inputs were changed.
    remark : str
        Why it failed, what was not at hand, which files it read have changed.
    """

    name: str
    stage: str
    verdict: Verdict
    differences: tuple[Difference, ...] = ()
    changed_inputs: tuple[str, ...] = ()
    alone: str = ""
    remark: str = ""

    @property
    def good(self) -> bool:
        """Whether nothing speaks against the run."""
        return self.verdict in {"identical", "within tolerance", "taken over"}

    @property
    def culprit(self) -> bool:
        """Whether a deviation starts here."""
        return not self.good and not self.changed_inputs


@dataclass(frozen=True)
class Verification:
    """What recomputing a run gave; ``str`` of it is what the command prints.

    Attributes
    ----------
    path : Path
        The run or bundle.
    nodes : dict of str to NodeVerdict
        Every node, each after its inputs.
    versions : dict of str to (str, str)
        Libraries whose versions differ, then and now; empty where there was none.
    code : dict of str to tuple of str
        Modules whose code differs, and the nodes that stand on them.
    commits : (str, str)
        Of the checkout, then and now.
    """

    path: Path
    nodes: Mapping[str, NodeVerdict]
    versions: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    code: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    commits: tuple[str, str] = ("", "")

    @property
    def ok(self) -> bool:
        """Whether every node that could be recomputed is identical or within its stage's tolerance."""
        return all(node.good for node in self.nodes.values())

    @property
    def culprits(self) -> tuple[str, ...]:
        """Nodes at which deviations start: their inputs were as they were in the run."""
        return tuple(name for name, node in self.nodes.items() if node.culprit)

    def __str__(self) -> str:
        from pipeline.review.verification_text import verification_text

        return verification_text(self)


def verify(path: str | Path, *, limits: Limits | None = None, listener: Listener | None = None) -> Verification:
    """Recompute everything of a run or a bundle in a fresh store, and compare every node with what the run says.

    Parameters
    ----------
    path : path
        Folder of a run, or a bundle.
    limits : Limits, optional
        How large a bundle may be.
    listener : Listener, optional
        Hears how recomputing goes on.

    Raises
    ------
    PipelineError
        It cannot be verified: there is no run, the bundle is not what a bundle should be, its stages are not here, a
        capture that cannot be recomputed is lost, or none of its nodes can be recomputed.
    """
    with opened(Path(path), limits) as run, tempfile.TemporaryDirectory(prefix="optibench-") as folder:
        experiment = Experiment.of(kept_configuration(run, Path(folder)))
        if not any(run.has(name) for name in experiment.graph.nodes):
            raise InputError(f"no node of {path} has a value", expected="a run that gave something")
        taken = _taken_over(run, experiment)
        if set(taken) >= {name for name in experiment.graph.nodes if name in run.nodes and run.has(name)}:
            raise InputError(
                f"nothing of {path} can be recomputed here: {', '.join(taken)} came from real devices or absent files"
            )
        plan = plan_of(experiment, experiment.graph, taken=taken)
        outcomes = carry_out(plan, experiment.store, experiment.catalog.sources, executor_of({}), listener or Silent())
        judge = _Judge(run, experiment, plan, outcomes, taken)
        nodes = {name: judge.verdict(node) for name, node in experiment.graph.nodes.items()}
        records = {n.name: record_of_node(run, n) for n in run.nodes.values() if n.artifact}
        return Verification(
            Path(path), nodes, _versions(run, records.values()), _code(run, records, plan), (run.commit, commit())
        )


def _taken_over(run: Run, experiment: Experiment) -> dict[str, Record]:
    """Records of what cannot be recomputed, their values brought into the experiment's store."""
    taken = {}
    for name, node in experiment.graph.nodes.items():
        missing = missing_files(node)
        if not (node.is_source or missing):
            continue
        try:
            value = read_value(run.store.object_folder(run.node(name).artifact), run.node(name).artifact)
        except (DamagedArtifact, InputError) as error:
            why = f"{missing[0]} is not here" if missing else "real devices captured it"
            raise InputError(
                f"'{name}' cannot be recomputed, since {why}, and its value is lost or damaged", hint=str(error)
            ) from None
        experiment.store.put(value)
        taken[name] = record_of_node(run, run.node(name))
    return taken


@dataclass
class _Judge:
    """Compares nodes with those of the run."""

    run: Run
    experiment: Experiment
    plan: Plan
    outcomes: Mapping[str, Outcome]
    taken: Mapping[str, Record]

    def verdict(self, node: Node) -> NodeVerdict:
        """What became of a node."""
        before, outcome = self.run.nodes.get(node.name), self.outcomes[node.name]
        name, stage = node.name, node.entry.name
        if before is None or not before.artifact:
            was = "absent" if before is None else before.status
            return NodeVerdict(name, stage, "failed", remark=f"the run has no value of it: it is {was} there")
        changed = tuple(n for n in node.upstream() if not self._same(n))
        if name in self.taken:
            return NodeVerdict(name, stage, "taken over", remark=self._why_taken(node))
        if outcome.status in {"failed", "blocked"}:
            alone = self._alone(node, before) if changed else ""
            return NodeVerdict(name, stage, "failed", (), changed, alone, self._why_failed(outcome))
        then, remark = self._then(before)
        if self._same(name) and (then is not None or remark == _NOT_AT_HAND):
            return NodeVerdict(name, stage, "identical", (), changed)
        alone = self._alone(node, before) if changed else ""
        if then is None:
            same = "; its digest is that of the value recomputed" if self._same(name) else ""
            return NodeVerdict(name, stage, "different", (), changed, alone, remark + same)
        found = compare(then, self.experiment.store.get(outcome.artifact), self._tolerance(node))
        verdict: Verdict = "within tolerance" if found and all(d.tolerated for d in found) else "different"
        return NodeVerdict(name, stage, verdict, found, changed, alone, self._changed_files(node, before))

    def _same(self, name: str) -> bool:
        outcome = self.outcomes[name]
        return outcome.record is not None and outcome.artifact == self.run.node(name).artifact

    def _then(self, before: NodeRun) -> tuple[Any, str]:
        """The run's value, or what is wrong with it."""
        folder = self.run.store.object_folder(before.artifact)
        if not folder.is_dir():
            return None, _NOT_AT_HAND
        try:
            return read_value(folder, before.artifact), ""
        except DamagedArtifact as error:
            return None, f"the run's value is not what its digest says: {error}"

    def _alone(self, node: Node, before: NodeRun) -> str:
        """What the stage gives on the inputs that it had in the run."""
        inputs = inputs_of(node, {name: self.run.node(name).artifact for name in node.upstream()})
        try:
            values = {
                parameter: [self._input(a) for a in given] if isinstance(given, tuple) else given and self._input(given)
                for parameter, given in inputs.items()
            }
        except DamagedArtifact:
            return "not at hand"
        try:
            with Messages():
                value = call_stage(node, values)
        except Exception as error:
            return f"failed with {type(error).__name__}: {error}"
        if digest_of(content_of(value)[0]) == before.artifact:
            return "identical"
        then, remark = self._then(before)
        found = () if remark else compare(then, value, self._tolerance(node))
        if found and all(difference.tolerated for difference in found):
            return "within tolerance"
        return "different" + (f" ({'; '.join(map(str, found))})" if found else "")

    def _input(self, artifact: str) -> Any:
        return read_value(self.run.store.object_folder(artifact), artifact)

    def _tolerance(self, node: Node) -> Mapping[str, float]:
        return checked_tolerance(node.entry.signature.tolerance, node.entry.name)

    def _why_taken(self, node: Node) -> str:
        missing = missing_files(node)
        return f"{missing[0].name} is not here" if missing else "real devices captured it"

    def _why_failed(self, outcome: Outcome) -> str:
        if outcome.blocked_by:
            return f"it waited for {', '.join(outcome.blocked_by)}"
        return (outcome.error.strip().splitlines() or ["it failed"])[-1]

    def _changed_files(self, node: Node, before: NodeRun) -> str:
        """Which files that the stage reads have another content than they had."""
        then = record_of_node(self.run, before).settings
        found = _changed_contents(then, self.plan.steps[node.name].task.settings)
        return f"files changed: {', '.join(found)}" if found else ""


def _changed_contents(then: Any, now: Any, path: str = "") -> list[str]:
    if not isinstance(then, Mapping) or not isinstance(now, Mapping):
        return []
    if set(then) == set(now) == {"content"}:
        return [path] if then != now else []
    return [
        c
        for name in now
        if name in then
        for c in _changed_contents(then[name], now[name], f"{path}.{name}".lstrip("."))
    ]


def _versions(run: Run, records: Iterable[Record]) -> dict[str, tuple[str, str]]:
    """Libraries that differ between all that computed the run and what is here."""
    then: dict[str, set[str]] = {}
    known = [run.store.provenance(name) for name in sorted({record.versions for record in records}) if name]
    for listing in [listing for listing in known if listing] or [run.versions]:
        for name, version in listing.items():
            then.setdefault(name.lower(), set()).add(str(version))
    now = {name.lower(): version for name, version in versions().items()}
    return {
        name: (", ".join(sorted(then.get(name, ()))), now.get(name, ""))
        for name in sorted({*then, *now})
        if then.get(name) != {now.get(name)}
    }


def _code(run: Run, records: Mapping[str, Record], plan: Plan) -> dict[str, tuple[str, ...]]:
    """Modules whose code differs, with the nodes that stand on them."""
    found: dict[str, list[str]] = {}
    for name, step in plan.steps.items():
        then = run.store.provenance(records[name].code) if name in records and records[name].code else {}
        if not then:
            continue
        now = step.task.code.modules
        for module in sorted({*then, *now}):
            if module not in then or module not in now or then[module][0] != now[module][0]:
                found.setdefault(module, []).append(name)
    return {module: tuple(names) for module, names in sorted(found.items())}


def counts(verification: Verification) -> str:
    """How many nodes came out how."""
    found = Counter(node.verdict for node in verification.nodes.values())
    order: tuple[Verdict, ...] = ("identical", "within tolerance", "different", "taken over", "failed")
    return ", ".join(f"{found[verdict]} {verdict}" for verdict in order if found[verdict])


def verified(path: Path, limits: Limits | None, listener: Listener) -> Verification:
    """As :func:`verify`, with every reason why it cannot be done as wrong input.

    Raises
    ------
    InputError
        It cannot be verified.
    """
    try:
        return verify(path, limits=limits, listener=listener)
    except InputError:
        raise
    except PipelineError as error:
        raise InputError(f"{path} cannot be verified: {error}") from None
