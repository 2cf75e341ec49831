"""Many runs of one or more experiments as a single graph: what they share is computed once."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from pipeline.bench import Experiment, carry_out, check_writable, plan_of
from pipeline.errors import InputError, InputErrors, PipelineError, nearest
from pipeline.execution.again import least_seconds
from pipeline.execution.executors import executor_of
from pipeline.execution.merge import Labelled, merge
from pipeline.execution.outcome import Listener, Outcome, Silent
from pipeline.execution.plan import recheck
from pipeline.graph.catalog import Catalog, Entry
from pipeline.graph.compose import hydra_ready, is_sweep, opened, readable_errors
from pipeline.graph.config import groups
from pipeline.graph.nodes import Node
from pipeline.graph.selection import forced
from pipeline.graph.studies import Tradeoff, maps_of, together, tradeoff_of, unknown_figures
from pipeline.runs import Run, last_keys
from pipeline.storage.keys import digest
from pipeline.storage.record import Record
from pipeline.storage.store import Store
from pipeline.sweep_results import Point, Sweep

if TYPE_CHECKING:
    from hydra.core.utils import JobReturn

DIGEST_CHARACTERS = 8


class Origin(Protocol):
    """A run or a bundle whose experiment is swept."""

    @property
    def name(self) -> str:
        """Name of the experiment."""

    @property
    def digest(self) -> str:
        """The run's digest."""

    @property
    def words(self) -> tuple[str, ...]:
        """What stands for it on the command line."""

    @property
    def load(self) -> Callable[..., Experiment]:
        """Gives the experiment with overrides on it."""


def sweep(
    name: str,
    overrides: Iterable[str] = (),
    *,
    config_dir: str | Path | None = None,
    listener: Listener | None = None,
) -> Sweep:
    """Run an experiment for every combination of values, as ``python -m pipeline -m +experiment=NAME OVERRIDES`` does.

    Parameters
    ----------
    name : str
        Name of the experiment, or several with commas between.
    overrides : iterable of str
        Overrides in Hydra's syntax for sweeps, such as ``"graph.photos.count=4,6,12"``.
    config_dir : path, optional
        A folder of your own experiments and rigs, laid out as ``configs/``.
    listener : Listener, optional
        Hears how the stages go on.

    Raises
    ------
    InputError, InputErrors
        Something is wrong with any of the points; nothing has run.
    """
    folders = [] if config_dir is None else [Path(config_dir)]
    return run_sweep([f"+experiment={name}", *overrides], folders, listener or Silent())


def run_sweep(
    words: Sequence[str],
    folders: Sequence[Path],
    listener: Listener,
    log: Callable[[str], None] = lambda text: None,
    origin: Origin | None = None,
) -> Sweep:
    """Let Hydra's sweeper propose points, and run each batch of them as one graph; write table and page.

    Parameters
    ----------
    words, folders, listener, log
        As for a run.
    origin : Origin, optional
        Run or bundle whose experiment the words change, where they name none.

    Raises
    ------
    InputError, InputErrors
        Something is wrong with any of the points; or all were computed, and none has a figure that is to be charted.
    """
    from hydra._internal.callbacks import Callbacks
    from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
    from hydra.core.global_hydra import GlobalHydra
    from hydra.core.plugins import Plugins
    from hydra.types import HydraContext, RunMode
    from omegaconf import open_dict

    from pipeline.report.sweep_page import write_sweep

    start = time.perf_counter()
    catalog = Catalog(_sources(words))
    load = partial(Experiment.load, folders=folders, catalog=catalog)
    if origin is not None:
        load = partial(_reloaded, origin, catalog)
        words = [f"++{word.lstrip('+')}" if _names_a_value(word, folders) else word for word in words]
    texts = [opened(word) for word in words]
    texts = [_globbed(text, texts, load, catalog) for text in texts]
    batches = _Batches(load, catalog, listener, log, Sweep(_folder(words, origin), _command(words, folders, origin)))
    with readable_errors(" ".join(words)), hydra_ready(folders) as search:
        hydra = GlobalHydra.instance().hydra
        assert hydra is not None
        own = ["hydra/launcher=optibench", f"hydra.sweep.dir='{batches.sweep.folder}'"]
        config = hydra.compose_config("config", [*search, *own, *texts], RunMode.MULTIRUN, with_log_configuration=False)
        with open_dict(config):
            params = config.hydra.sweeper.get("params") or {}
            config.hydra.sweeper.params = {opened(str(name)): value for name, value in params.items()}
        context = HydraContext(config_loader=hydra.config_loader, callbacks=Callbacks(config))
        batches.objective = _objectives(config.get("objective"))
        batches.sweep.folder.mkdir(parents=True, exist_ok=True)
        sweeper = Plugins.instance().instantiate_sweeper(config=config, hydra_context=context, task_function=batches)
        if type(sweeper) is BasicSweeper:
            sweeper.validate_batch_is_legal = lambda batch: None  # ours checks more
        ours = set(own) | set(search)
        sweeper.sweep(arguments=[str(word) for word in config.hydra.overrides.task if word not in ours])
    batches.time()
    done = batches.sweep
    done.seconds = time.perf_counter() - start
    drawing = "drawing the report"
    log(drawing)
    listener.started(drawing)
    write_sweep(done)
    listener.ended(Outcome(drawing, "cached"))
    if done.metrics and (unknown := unknown_figures(done.tradeoff, done.maps, done.metrics)):
        raise InputErrors(unknown)
    return done


@dataclass
class _Batches:
    """Hydra's task function: carries out batches of points on one store."""

    load: Callable[[Sequence[str]], Experiment]
    catalog: Catalog
    listener: Listener
    log: Callable[[str], None]
    sweep: Sweep
    objective: tuple[str, ...] = ()
    experiments: list[Experiment] = field(default_factory=list)

    def __call__(self, config: Any) -> Any:
        raise NotImplementedError("points are run in batches")

    def launch(self, jobs: Sequence[Sequence[str]]) -> list[JobReturn]:
        """Run a batch of points as one graph, and answer the sweeper."""
        from hydra.core.utils import JobReturn, JobStatus

        answers = []
        for words, run in zip(jobs, self.run(jobs), strict=True):
            answer = JobReturn(overrides=list(words))
            missing = [name for name in self.objective if name not in run.metrics]
            if run.failed or missing:
                answer.status = JobStatus.FAILED if self.objective else JobStatus.COMPLETED
                answer.return_value = PipelineError(f"{run.path} has no {', '.join(missing)}") if missing else None
            else:
                figures = [run.metrics[name] for name in self.objective]
                answer.status = JobStatus.COMPLETED
                answer.return_value = figures[0] if len(figures) == 1 else figures or None
            answers.append(answer)
        return answers

    def run(self, jobs: Sequence[Sequence[str]]) -> list[Run]:
        """Run a batch of points as one graph."""
        start = time.perf_counter()
        experiments = self._experiments(jobs)
        first = experiments[0]
        merged = merge([experiment.graph for experiment in experiments])
        content = first.configuration.content
        last: dict[str, str] = {}
        anew: dict[str, str] = {}
        taken: dict[str, Record] = {}
        for experiment, names in zip(experiments, merged.names, strict=True):
            keys = last_keys(experiment.runs, experiment.name)
            last = {**{names[name]: key for name, key in keys.items() if name in names}, **last}
            wanted = forced(experiment.graph, content.get("from"), content.get("force"))
            anew |= {names[name]: reason for name, reason in wanted.items()}
            taken |= {names[name]: record for name, record in experiment.taken.items()}
        with first.store.in_use():
            plan = plan_of(first, merged.graph, last=last, forced=anew, taken=taken)
            executor = executor_of(content.get("executor") or {}, self.log)
            check_writable(first.runs)
            listener = Labelled(self.listener, merged.labels(jobs))
            outcomes = carry_out(recheck(plan, first.store), first.store, self.catalog.sources, executor, listener)
            seconds = time.perf_counter() - start
            runs = [
                experiment.finish(merged.outcomes_of(index, outcomes), seconds)
                for index, experiment in enumerate(experiments)
            ]
        self.sweep.stages_run += sum(outcome.status == "ran" for outcome in outcomes.values())
        self.sweep.stages_found += sum(outcome.status == "cached" for outcome in outcomes.values())
        self.sweep.points += [Point(tuple(words), run) for words, run in zip(jobs, runs, strict=True)]
        self.experiments += experiments
        return runs

    def time(self) -> None:
        """Carry out each recipe of the trade-off's nodes again, alone, and keep the seconds."""
        wanted = self.sweep.tradeoff
        if wanted is None:
            return
        recipes: dict[str, tuple[Node, dict[str, str]]] = {}
        for experiment, point, nodes in zip(self.experiments, self.sweep.points, self.sweep.timed_nodes, strict=True):
            can_run = all(point.run.has(name) and name not in experiment.taken for name in nodes)
            if not can_run or not any(error in point.run.metrics for error in wanted.errors):
                continue
            for node in (experiment.graph.nodes[name] for name in nodes):
                artifacts = {name: point.run.nodes[name].artifact for name in node.upstream()}
                recipes.setdefault(point.run.nodes[node.name].key, (node, artifacts))
        name = f"timing {wanted.timed}"
        self.log(f"{name}: {len(recipes)} recipes, each alone and {wanted.repeats} times after one that does not count")
        self.listener.started(name)
        with self.experiments[0].store.in_use():
            for done, (key, (node, artifacts)) in enumerate(recipes.items()):
                self.listener.advanced(name, done, len(recipes))
                self.sweep.timed[key] = least_seconds(node, artifacts, self.experiments[0].store, wanted.repeats)
        self.listener.ended(Outcome(name, "cached"))

    def _experiments(self, jobs: Sequence[Sequence[str]]) -> list[Experiment]:
        """All points composed and checked; everything that is wrong with any of them is told at once."""
        found, problems = [], []
        common = set(jobs[0]).intersection(*jobs)
        for words in jobs:
            place = "point " + " ".join(word.lstrip("+") for word in words if word not in common)
            try:
                found.append(self.load(words))
            except InputError as error:
                problems.append(error.at(place))
            except InputErrors as several:
                problems += [error.at(place) for error in several.errors]
        if found:
            problems += self._charts(jobs, found)
        stores = {experiment.store.location for experiment in found}
        if len(stores) > 1:
            problems.append(InputError("a sweep has one store", where="paths.store", expected="one value"))
        if problems:
            raise InputErrors(problems)
        return found

    def _charts(self, jobs: Sequence[Sequence[str]], experiments: Sequence[Experiment]) -> list[InputError]:
        """Read what the page shall chart; what is wrong with it is found before anything runs."""
        written = experiments[0].configuration
        swept = {word.lstrip("+").partition("=")[0] for words in jobs for word in words}
        problems: list[InputError] = []
        asked: list[Tradeoff] = []
        try:
            for experiment in experiments:  # what is timed may differ between points
                wanted = tradeoff_of(experiment.configuration, swept, [experiment.graph])
                asked += [wanted] if wanted else []
        except InputErrors as several:
            problems += several.errors
        if asked:
            self.sweep.timed_nodes += [one.nodes for one in asked]
            self.sweep.tradeoff = together(asked)
        try:
            self.sweep.maps = maps_of(written, swept)
        except InputErrors as several:
            problems += several.errors
        return problems


def _objectives(written: Any) -> tuple[str, ...]:
    if written is None:
        return ()
    return (written,) if isinstance(written, str) else tuple(str(name) for name in written)


def _reloaded(origin: Origin, catalog: Catalog, words: Sequence[str]) -> Experiment:
    """A point of a run or a bundle, whose own overrides need no plus."""
    return origin.load([word.lstrip("+") for word in words], catalog)


def _names_a_value(word: str, folders: Sequence[Path]) -> bool:
    """Whether a word changes what Hydra, which knows nothing of the run, would not find in our YAML files."""
    name = word.lstrip("+").partition("=")[0]
    return not word.startswith("~") and not name.startswith("hydra") and name not in groups(folders)


def _globbed(text: str, texts: Sequence[str], load: Callable[[Sequence[str]], Experiment], catalog: Catalog) -> str:
    """``graph.NODE.stage=glob(fit.*)`` with the stages that fit in the node's place written out."""
    import fnmatch
    import re

    match = re.fullmatch(r"\+*graph\.(\w+)\.stage=glob\((.+)\)", text)
    if match is None:
        return text
    name, pattern = match[1], match[2].strip("\"'")
    plain_words = [t for t in texts if t != text and not is_sweep(t)]
    node = load(plain_words).graph.nodes.get(name)
    if node is None:
        raise InputError(f"there is no node '{name}'", where=f"override {text.lstrip('+')}", hint=nearest(name, []))
    given = {parameter for parameter, upstream in node.inputs.items() if upstream is not None}
    fitting = [
        stage
        for stage, entry in sorted(catalog.stages.items())
        if fnmatch.fnmatchcase(stage, pattern)
        and not entry.signature.fault
        and entry.returns.name == node.entry.returns.name
        and _takes(entry, given, set(node.settings))
    ]
    if not fitting:
        raise InputError(
            f"no stage fits '{pattern}' in the place of {node.entry.name}",
            where=f"override {text.lstrip('+')}",
            expected=f"stages that take {', '.join(sorted(given))} and give {node.entry.type}",
        )
    return f"++graph.{name}.stage={','.join(fitting)}"


def _takes(entry: Entry, given: set[str], set_already: set[str]) -> bool:
    """Whether a stage can stand in the place of one that is given these inputs and has these settings."""
    needed = {name for name, (parameter, _) in entry.inputs.items() if parameter.required}
    needs_settings = {name for name, (parameter, _) in entry.settings.items() if parameter.required}
    return needed <= given and bool(set(entry.inputs) & given) == bool(given) and needs_settings <= set_already


def _sources(words: Sequence[str]) -> Any:
    from pipeline.codebase.source import Sources

    return Sources(Store.at(_written(words, "paths.store", f"{_runs(words)}/.store")).memory / "sources.json")


def _runs(words: Sequence[str]) -> str:
    return _written(words, "paths.runs", "runs")


def _written(words: Sequence[str], name: str, default: str) -> str:
    return next(
        (word.partition("=")[2] for word in reversed(words) if word.lstrip("+").startswith(f"{name}=")), default
    )


def _folder(words: Sequence[str], origin: Origin | None) -> Path:
    """Folder of a sweep: the same for the same words, on the same run where they change one."""
    bare = [word.lstrip("+") for word in words]
    counted = sorted(word for word in bare if not word.startswith(("paths.", "executor")))
    experiments = origin.name if origin else _written(bare, "experiment", "several")
    name = experiments if experiments.isidentifier() else "several"
    identity = [f"run {origin.digest}", *counted] if origin else counted
    return Path(_runs(words)) / name / "sweeps" / digest(identity)[:DIGEST_CHARACTERS]


def _command(words: Sequence[str], folders: Sequence[Path], origin: Origin | None) -> str:
    import shlex

    places = [f"--config-dir={folder}" for folder in folders]
    if origin is not None:
        words = [*origin.words, *(word.removeprefix("++") for word in words)]
    return shlex.join(["python", "-m", "pipeline", "-m", *places, *words])
