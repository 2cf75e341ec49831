"""From overrides to results: compose, check, plan, execute, keep."""

from __future__ import annotations

import platform
import shlex
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

from pipeline import report
from pipeline.codebase.freshness import bring_up_to_date
from pipeline.codebase.source import Sources
from pipeline.errors import InputError, PipelineError
from pipeline.execution.execute import check_before_running, execute
from pipeline.execution.executors import Executor, executor_of
from pipeline.execution.outcome import Listener, Outcome, Silent
from pipeline.execution.plan import Plan, make_plan, recheck
from pipeline.execution.provenance import commit, environment, versions
from pipeline.execution.workbench import Workbench
from pipeline.graph.catalog import Catalog
from pipeline.graph.checks import build_graph
from pipeline.graph.compose import compose, remember
from pipeline.graph.config import LOCAL_SECTIONS, Configuration
from pipeline.graph.nodes import Graph, Node, plain
from pipeline.graph.selection import forced, until
from pipeline.runs import NodeRun, Run, last_keys, open_run, remember_keys
from pipeline.storage.files import FileDigests, as_yaml
from pipeline.storage.keys import digest
from pipeline.storage.record import Record
from pipeline.storage.store import Store, data_types

RUN_DIGEST_CHARACTERS = 8
_FIRST = {"evaluate": 0, "fit": 1}
"""Whose figures lead."""


class RunFailed(PipelineError):
    """Some stages failed; ``run`` holds what was finished."""

    def __init__(self, run: Run) -> None:
        self.run = run
        super().__init__(run)

    def __str__(self) -> str:
        lines = []
        for node in self.run.nodes.values():
            if node.status == "failed":
                lines.append(f"stage '{node.name}' ({node.stage}) failed:\n{_indented(node.error)}")
                lines.append(f"  under a debugger: python -m pipeline debug {self.run.path} {node.name}")
        blocked = [node for node in self.run.nodes.values() if node.status == "blocked"]
        if blocked:
            names = ", ".join(node.name for node in blocked)
            lines.append(f"not run, since they wait for what failed: {names}")
        return "\n".join(lines)


@dataclass(frozen=True)
class Experiment:
    """A composed and checked experiment, ready to be planned and run; ``taken`` stands for what cannot be computed."""

    configuration: Configuration
    catalog: Catalog
    graph: Graph
    taken: Mapping[str, Record] = field(default_factory=dict)

    @classmethod
    def load(
        cls, overrides: Sequence[str], folders: Sequence[Path] = (), *, catalog: Catalog | None = None
    ) -> Experiment:
        """Compose and check.

        Parameters
        ----------
        overrides : sequence of str
            Words of the command line.
        folders : sequence of Path
            Folders of YAML files besides ours.
        catalog : Catalog, optional
            What stages and devices there are, where that is known already.

        Raises
        ------
        InputError, InputErrors
            Whatever is wrong with the configuration.
        """
        return cls.of(compose(overrides, folders), catalog)

    @classmethod
    def of(cls, configuration: Configuration, catalog: Catalog | None = None) -> Experiment:
        """Check a composed configuration."""
        if catalog is None:
            paths = configuration.content.get("paths", {})
            catalog = Catalog(Sources(Store.at(str(paths.get("store", "runs/.store"))).memory / "sources.json"))
        executor_of(configuration.content.get("executor") or {})
        graph = until(build_graph(configuration, catalog), configuration.content.get("until"))
        return cls(configuration, catalog, graph)

    @property
    def name(self) -> str:
        """Name of the experiment."""
        return self.configuration.experiment

    @property
    def runs(self) -> Path:
        """Folder of all runs."""
        return Path(str(self.configuration.content["paths"]["runs"]))

    @cached_property
    def store(self) -> Store:
        """Where results are kept."""
        return Store.at(str(self.configuration.content["paths"]["store"]))

    @property
    def digest(self) -> str:
        """Digest of the configuration as a run keeps it, leaving out where results go and who computes them."""
        ignored = {*LOCAL_SECTIONS} | (set() if self.configuration.content.get("until") else {"until"})
        content = {k: v for k, v in self.kept(self.configuration.content).items() if k not in ignored}
        return digest({"experiment": self.name, **content})[:RUN_DIGEST_CHARACTERS]

    @property
    def command(self) -> str:
        """The command that runs it again."""
        words = self.configuration.words
        folders = [f"--config-dir={folder}" for folder in self.configuration.folders]
        origin = ["run", self.configuration.origin] if self.configuration.origin else []
        return shlex.join(["python", "-m", "pipeline", *origin, *folders, *words])

    def kept(self, content: Mapping[str, Any]) -> dict[str, Any]:
        """A configuration as a run keeps it, without the settings that a swapped stage does not have."""
        graph = content["graph"]
        if isinstance(graph, dict):
            graph = {
                name: {key: value for key, value in node.items() if key not in self.graph.dropped.get(name, ())}
                if isinstance(node, dict)
                else node
                for name, node in graph.items()
            }
        return {**content, "graph": graph}

    def plan(self) -> Plan:
        """Find out what would run.

        Raises
        ------
        InputErrors
            Files that settings name are missing or cannot be read.
        """
        content = self.configuration.content
        return plan_of(
            self,
            self.graph,
            last=last_keys(self.runs, self.name),
            forced=forced(self.graph, content.get("from"), content.get("force")),
            taken=self.taken,
        )

    def check_plan(self, plan: Plan) -> None:
        """Refuse a plan that nobody asked for, before anything runs; here, none."""

    def run(self, listener: Listener, log: Callable[[str], None] = lambda text: None) -> Run:
        """Run what is not in the store yet, and keep the manifest; failures are in the run.

        Parameters
        ----------
        listener : Listener
            Hears how the run goes on.
        log : callable, optional
            Is told what else the user may want to know.

        Raises
        ------
        InputError, InputErrors
            Something is wrong that was found before any stage ran.
        """
        start = time.perf_counter()
        executor = executor_of(self.configuration.content.get("executor") or {}, log)
        with self.store.in_use():
            plan = self.plan()
            known = None if plan.to_run else self._finished(plan)
            if known is not None:
                for name, step in plan.steps.items():
                    listener.ended(Outcome(name, "cached", step.record, step.reason))
                self._remember()
                return known
            check_writable(self.runs)
            outcomes = carry_out(recheck(plan, self.store), self.store, self.catalog.sources, executor, listener)
            run = self.finish(outcomes, time.perf_counter() - start)
            write_report(run)
        return run

    def finish(self, outcomes: Mapping[str, Outcome], seconds: float) -> Run:
        """Keep the manifest of a run that ended so."""
        run = self._run(outcomes, seconds)
        run.save()
        remember_keys(self.runs, run)
        self._remember()
        return run

    def _remember(self) -> None:
        """Keep what composing and reading sources gave, so that the next command need not do it again."""
        with suppress(OSError):
            self.catalog.sources.remember()
            remember(self.configuration)

    def _finished(self, plan: Plan) -> Run | None:
        """The run as it lies in its folder, where that is complete and all its values are those of the plan."""
        try:
            run = open_run(self.runs / self.name / self.digest)
        except PipelineError:
            return None
        artifacts = {name: step.record.artifact for name, step in plan.steps.items() if step.record}
        same = artifacts == {n.name: n.artifact for n in run.nodes.values() if n.artifact}
        if not same or run.failed or not (run.report.is_file() and report.is_current(run.path)):
            return None
        run = replace(run, store=self.store)
        nodes = {
            n.name: replace(n, status="cached", reason=plan.steps[n.name].reason) if n.artifact else n
            for n in run.nodes.values()
        }
        return replace(run, nodes=nodes)

    def _run(self, outcomes: Mapping[str, Outcome], seconds: float) -> Run:
        nodes = {name: _node_run(node, outcomes[name]) for name, node in self.graph.nodes.items()}
        nodes |= {name: NodeRun(name, reason=reason) for name, reason in self.graph.absent.items()}
        return Run(
            name=self.name,
            digest=self.digest,
            path=self.runs / self.name / self.digest,
            store=self.store,
            command=self.command,
            overrides=tuple(o.text for o in self.configuration.overrides),
            description=str(self.configuration.content.get("description") or "").strip(),
            nodes=nodes,
            metrics=_metrics(sorted(nodes.values(), key=lambda n: _FIRST.get(n.name, len(_FIRST))), self.store),
            config_yaml=as_yaml(self.kept(self.configuration.content)),
            versions=versions(),
            commit=commit(),
            host=platform.node(),
            finished=datetime.now(UTC).isoformat(timespec="seconds"),
            total_seconds=round(seconds, 3),
            raw=self.kept(self.configuration.raw),
            environment=self.store.keep_provenance(environment()),
            claims=getattr(self.store, "claims", ""),
        )


def plan_of(experiment: Experiment, graph: Graph, **options: Any) -> Plan:
    """Plan a graph on an experiment's store, and remember what looking at files and sources cost."""
    files = FileDigests(experiment.store.memory / "files.json")
    sources = experiment.catalog.sources
    recapture = bool(experiment.configuration.content.get("recapture", False))
    plan = make_plan(graph, sources, experiment.store, files, recapture=recapture, **options)
    experiment.check_plan(plan)
    if experiment.store.root.is_dir():
        with suppress(OSError):
            files.remember()
    return plan


def check_writable(runs: Path) -> None:
    """Find out before work starts whether run folders can be made.

    Raises
    ------
    InputError
        They cannot.
    """
    try:
        runs.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=runs):
            pass
    except OSError as error:
        raise InputError(
            f"the folder {runs} cannot be written to: {error.strerror}",
            where="paths.runs",
            expected="a folder on a disk that can be written to",
        ) from None


def carry_out(plan: Plan, store: Store, sources: Sources, executor: Executor, listener: Listener) -> dict[str, Outcome]:
    """Check what is left to run, and run it.

    Raises
    ------
    InputError, InputErrors
        Something is wrong that was found before any stage ran.
    """
    if plan.to_run:
        store.check_writable()
        bring_up_to_date((step.task.code for step in plan.to_run.values()), sources)
        check_before_running(plan)
    workbench = Workbench(store, listener, commit(), store.keep_provenance(versions()) if plan.to_run else "")
    return execute(plan, workbench, executor)


def write_report(run: Run) -> None:
    """Write the files that a person opens."""
    report.write_outputs(run)
    report.write(run)


def run(
    name: str,
    overrides: Iterable[str] = (),
    *,
    config_dir: str | Path | None = None,
    listener: Listener | None = None,
) -> Run:
    """Run an experiment, as ``python -m pipeline +experiment=NAME OVERRIDES`` does.

    Parameters
    ----------
    name : str
        Name of the experiment.
    overrides : iterable of str
        Overrides as on the command line, such as ``"graph.photos.count=6"``.
    config_dir : path, optional
        A folder of your own experiments and rigs, laid out as ``configs/``.
    listener : Listener, optional
        Hears how the run goes on.

    Returns
    -------
    Run
        With every value, figure and second of it.

    Raises
    ------
    InputError, InputErrors
        Something is wrong that was found before any stage ran.
    RunFailed
        A stage failed; ``error.run`` holds what was finished.
    """
    words = [overrides] if isinstance(overrides, str) else list(overrides)
    folders = [] if config_dir is None else [Path(config_dir)]
    done = Experiment.load([f"+experiment={name}", *words], folders).run(listener or Silent())
    if done.failed:
        raise RunFailed(done)
    return done


def _node_run(node: Node, outcome: Outcome) -> NodeRun:
    record = outcome.record
    return NodeRun(
        name=node.name,
        stage=node.entry.name,
        summary=node.entry.summary,
        status=outcome.status,
        inputs={parameter: upstream or () for parameter, upstream in node.inputs.items()},
        settings={name: plain(value) for name, value in node.settings.items()},
        written=node.written,
        type=node.entry.type,
        key=record.key if record else "",
        artifact=record.artifact if record else "",
        seconds=record.seconds if record else None,
        cpu_seconds=record.cpu_seconds if record else None,
        peak_mb=record.peak_mb if record else None,
        host=record.host if record else "",
        finished=record.finished if record else "",
        warnings=record.warnings if record else (),
        notes=record.notes if record else (),
        reason=outcome.reason,
        error=outcome.error,
        blocked_by=outcome.blocked_by,
    )


def _metrics(nodes: Iterable[NodeRun], store: Store) -> dict[str, float]:
    """Figures of every node that has some.

    A name that several share is led by the node's, but for ``evaluate``'s, whose figure others need not repeat.
    """
    types = data_types()
    figures = {
        node.name: store.get(node.artifact).metrics
        for node in nodes
        if node.artifact and node.type in types and any(f.name == "metrics" for f in fields(types[node.type]))
    }
    times = Counter(name for of_node in figures.values() for name in of_node)
    judged = figures.get("evaluate", {})
    return {
        name if times[name] == 1 or node == "evaluate" else f"{node}.{name}": float(figure)
        for node, of_node in figures.items()
        for name, figure in of_node.items()
        if node == "evaluate" or judged.get(name) != figure
    }


def _indented(text: str) -> str:
    return "\n".join("  " + line for line in text.rstrip().splitlines())
