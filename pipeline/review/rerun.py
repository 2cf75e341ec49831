"""An experiment taken from a run or a bundle instead of from YAML files, changed or not.

Its configuration comes from the run's manifest as it was before interpolation, so that ``rig.camera.seed=1`` still
reaches every node that names ``${rig}``. Where results go and who computes them is this machine's affair and never
the bundle's, which could otherwise name folders to write to or a cluster to trust.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from pipeline.bench import Experiment
from pipeline.errors import InputError
from pipeline.execution.plan import Plan
from pipeline.graph.catalog import Catalog
from pipeline.graph.compose import (
    hydra_ready,
    opened,
    parsed,
    readable_errors,
    refuse_sweeps,
)
from pipeline.graph.config import LOCAL_SECTIONS, Configuration, groups, option_file
from pipeline.graph.nodes import DeviceRecipe, Node, plain
from pipeline.graph.sections import check_groups, check_paths, check_sections
from pipeline.review.bundle import without_places
from pipeline.review.unpack import Limits
from pipeline.review.unpack import opened as opened_run
from pipeline.review.untrusted import read_value
from pipeline.runs import NodeRun, Run
from pipeline.storage.artifact import DamagedArtifact
from pipeline.storage.claims import keep_claims, store_with_claims
from pipeline.storage.forms import plain_yaml
from pipeline.storage.record import Record
from pipeline.storage.store import Store

MOST_VALUES = 1_000_000
"""Values that a configuration may have once its interpolations are followed."""

_PLAIN = re.compile(r"\$\{(\.*)([\w.]+)\}")


@dataclass(frozen=True)
class Rerun(Experiment):
    """An experiment that also believes the records of the bundle it was taken from, and lets no bundle move devices."""

    claims: str = ""
    from_bundle: bool = False

    @cached_property
    def store(self) -> Store:
        """Where results are kept, with what the bundle says of its own."""
        return store_with_claims(str(self.configuration.content["paths"]["store"]), self.claims)

    def check_plan(self, plan: Plan) -> None:
        """Refuse to let real devices take what the bundle lacks, where nobody asked for that.

        Raises
        ------
        InputError
            They would.
        """
        for step in plan.to_run.values():
            node = step.task.node
            if self.from_bundle and node.is_source and not step.task.recapture:
                name = node.path.removeprefix("graph.")
                devices = ", ".join(recipe.entry.name for device in node.devices() for recipe in device.walk())
                raise InputError(
                    f"the bundle holds no such capture of '{name}', and real devices would take one: {devices}",
                    where=self.configuration.where(node.path),
                    hint="recapture=true takes it, with the settings of the bundle's config.yaml and yours",
                )


def rerun_of(path: Path, overrides: Sequence[str], folders: Sequence[Path] = (), limits: Limits | None = None) -> Rerun:
    """The experiment of a run's folder or a bundle, its values in this machine's store.

    Parameters
    ----------
    path : Path
        The folder or the bundle.
    overrides : sequence of str
        Changes, as on the command line.
    folders : sequence of Path
        Folders of YAML files besides ours, for options such as ``rig=NAME``.
    limits : Limits, optional
        How large a bundle may be.

    Raises
    ------
    InputError, InputErrors
        The bundle or an override is wrong; nothing has been kept of it.
    """
    with reruns_of(path, folders, limits) as origin:
        return origin.load(overrides)


@contextmanager
def reruns_of(path: Path, folders: Sequence[Path] = (), limits: Limits | None = None) -> Iterator[Origin]:
    """A run's folder or a bundle, opened once, of which any number of changed experiments can be loaded.

    Raises
    ------
    InputError
        It is no run or bundle.
    """
    claims: dict[str, str] = {}
    with opened_run(path, limits) as run:

        def load(overrides: Sequence[str], catalog: Catalog | None = None) -> Rerun:
            experiment = Experiment.of(changed_configuration(run, overrides, folders, str(path)), catalog)
            taken = not_computable(run, experiment)
            place = experiment.store.location
            if place not in claims:
                claims[place] = _taken_into(experiment.store, run, experiment)
            return Rerun(
                experiment.configuration, experiment.catalog, experiment.graph, taken, claims[place], path.is_file()
            )

        yield Origin(run.name, load, ("run", str(path)), run.digest)


@dataclass(frozen=True)
class Origin:
    """What changed experiments are loaded from.

    Attributes
    ----------
    name : str
        Name of the experiment.
    load : callable
        Gives the experiment with overrides on it.
    words : tuple of str
        What stands for it on the command line.
    digest : str
        The run's.
    """

    name: str
    load: Callable[..., Rerun]
    words: tuple[str, ...]
    digest: str


def kept_configuration(run: Run, runs: Path) -> Configuration:
    """The resolved configuration of a run, to be carried out below another folder."""
    content = plain_yaml(run.config_yaml, run.path / "config.yaml")
    content = {name: value for name, value in content.items() if name not in LOCAL_SECTIONS}
    content["paths"] = {"runs": str(runs), "store": str(runs / ".store")}
    return Configuration(run.name, content, content, (), (), origin=str(run.path))


def changed_configuration(
    run: Run, overrides: Sequence[str], folders: Sequence[Path] = (), origin: str = ""
) -> Configuration:
    """The configuration of a run with overrides on it.

    Raises
    ------
    InputError
        An override names what is not there, or the run keeps no configuration from before interpolation.
    """
    from hydra import compose as hydra_compose
    from hydra._internal.config_loader_impl import ConfigLoaderImpl
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from omegaconf import OmegaConf

    origin = origin or str(run.path)
    if not run.raw:
        raise InputError(
            f"{origin} keeps no configuration that can be changed", expected="a run made by this version or a later one"
        )
    texts = [opened(text) for text in overrides]
    for text in texts:
        if text.lstrip("+").startswith("experiment="):
            raise InputError(f"{origin} is an experiment already", where=f"override {text.lstrip('+')}")
    check_groups(texts, folders)
    refuse_sweeps(texts, ["run", origin, *overrides])
    pairs = [(text.lstrip("+").partition("=")[0], text) for text in texts]
    chosen = {name: text for name, text in pairs if name in groups(folders)}
    changes = [text for name, text in pairs if name not in chosen]
    with readable_errors(" ".join(overrides)), _bounded(origin):
        with hydra_ready(folders) as search:
            ours = hydra_compose("config", overrides=[*search, *(text.lstrip("+") for text in chosen.values())])
        merged: Any = OmegaConf.to_container(ours, resolve=False)
        kept = without_resolvers(run.raw, plain_yaml(run.config_yaml, run.path / "config.yaml"))
        merged |= {name: value for name, value in kept.items() if name not in {*LOCAL_SECTIONS, *chosen}}
        check_size(merged)
        check_paths(changes, merged)
        config = OmegaConf.create(merged)
        OmegaConf.set_struct(config, True)
        ConfigLoaderImpl._apply_overrides_to_config(OverridesParser.create().parse_overrides(changes), config)
        raw: Any = OmegaConf.to_container(config, resolve=False)
        check_size(raw)
        content: Any = OmegaConf.to_container(config, resolve=True)
    files = {name: option_file(name, text.partition("=")[2], folders) for name, text in chosen.items()}
    configuration = Configuration(
        experiment=run.name,
        content={str(name): value for name, value in content.items()},
        raw={str(name): value for name, value in raw.items()},
        overrides=tuple(parsed(text) for text in texts),
        files=tuple((file, name) for name, file in files.items() if file is not None),
        folders=tuple(folders),
        words=tuple(overrides),
        origin=origin,
    )
    check_sections(configuration)
    return configuration


@contextmanager
def _bounded(origin: str) -> Iterator[None]:
    """Refuse what refers to itself deeper than Python goes."""
    try:
        yield
    except RecursionError:
        raise InputError("the configuration refers to itself without end", where=origin) from None


def without_resolvers(raw: Any, content: Any) -> Any:
    """A configuration in which only references to its own values are left to follow.

    What a resolver gave, such as a variable of the environment, stays as it was in the run: a stranger's configuration
    shall not read this machine's.
    """
    if isinstance(raw, Mapping) and isinstance(content, Mapping):
        return {name: without_resolvers(item, content[name]) for name, item in raw.items() if name in content}
    if isinstance(raw, list) and isinstance(content, list):
        return [without_resolvers(*pair) for pair in zip(raw, content, strict=False)]
    if isinstance(raw, str) and "${" in _PLAIN.sub("", raw):
        return content
    return raw


def check_size(raw: Mapping[str, Any]) -> None:
    """Refuse a configuration whose references name each other so that following them would fill the memory.

    Raises
    ------
    InputError
        It would have more values than any experiment.
    """
    sizes: dict[tuple[str, ...], int] = {}

    def size(value: Any, place: tuple[str, ...]) -> int:
        if isinstance(value, Mapping):
            return 1 + sum(size(item, (*place, str(name))) for name, item in value.items())
        if isinstance(value, list):
            return 1 + sum(size(item, (*place, str(index))) for index, item in enumerate(value))
        if not isinstance(value, str):
            return 1
        return 1 + len(value) // 100 + sum(followed(m[1], m[2], place) for m in _PLAIN.finditer(value))

    def followed(dots: str, path: str, place: tuple[str, ...]) -> int:
        target = (*place[: len(place) - len(dots)], *path.split(".")) if dots else tuple(path.split("."))
        if target not in sizes:
            sizes[target] = 1
            sizes[target] = min(size(_at(raw, target), target), MOST_VALUES + 1)
        return sizes[target]

    if size(raw, ()) > MOST_VALUES:
        raise InputError("the configuration refers to itself without end", expected=f"at most {MOST_VALUES} values")


def _at(raw: Any, target: tuple[str, ...]) -> Any:
    for name in target:
        if isinstance(raw, list) and name.isdigit() and int(name) < len(raw):
            raw = raw[int(name)]
        elif isinstance(raw, Mapping) and name in raw:
            raw = raw[name]
        else:
            return None
    return raw


def not_computable(run: Run, experiment: Experiment) -> dict[str, Record]:
    """Records of the nodes that only the run can give: real devices captured them, or their files are not here."""
    found = {}
    recapture = bool(experiment.configuration.content.get("recapture"))
    for name, node in experiment.graph.nodes.items():
        before = run.nodes.get(name)
        if before is None or not before.artifact or not ((node.is_source and not recapture) or missing_files(node)):
            continue
        if before.stage == node.entry.name and not _changed(node, before):
            record = record_of_node(run, before)
            if record.type == node.entry.type:
                found[name] = record
    return found


def record_of_node(run: Run, node: NodeRun) -> Record:
    """The record of a node's value, or what the manifest knows of it where the record is lost."""
    known = run.store.record(node.key) if node.key else None
    if known is not None and known.artifact == node.artifact:
        return known
    return Record(node.key, node.artifact, node.type, node.stage, "", dict(node.settings), {})


def missing_files(node: Node) -> list[Path]:
    """Files and folders that a node's settings name and that are not there."""
    waiting: list[Any] = list(node.settings.values())
    missing = []
    while waiting:
        value = waiting.pop()
        if isinstance(value, DeviceRecipe):
            waiting += value.settings.values()
        elif isinstance(value, Mapping):
            waiting += value.values()
        elif isinstance(value, list):
            waiting += value
        elif isinstance(value, Path) and not value.exists():
            missing.append(value)
    return sorted(missing)


def _changed(node: Node, before: NodeRun) -> bool:
    now = without_places({name: plain(value) for name, value in node.settings.items()})
    return bool(now != without_places(before.settings))


def _taken_into(store: Store, run: Run, experiment: Experiment) -> str:
    """Bring a run's values into a store; returns under which digest the claims that come with them are kept there."""
    if store.location == run.store.location:
        return run.claims
    store.check_writable()
    records = []
    for node in run.nodes.values():
        if not node.artifact:
            continue
        try:
            value = read_value(run.store.object_folder(node.artifact), node.artifact)
        except DamagedArtifact as error:
            raise InputError(f"the value of node '{node.name}' is lost or damaged: {error}") from None
        if store.put(value) != node.artifact:
            raise InputError(f"the value of node '{node.name}' is not what its digest says", where=str(run.path))
        record = record_of_node(run, node)
        stage = experiment.catalog.stages.get(record.stage)
        if stage is not None and stage.type == type(value).__name__:
            records.append(record)
        for listing in (record.code, record.versions):
            if content := run.store.provenance(listing):
                store.keep_provenance(content)
    return keep_claims(store.root, records)
