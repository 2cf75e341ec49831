"""Run folders: which configuration, what each node's value is and what it took, in one folder a configuration."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

from pipeline.errors import InputError, PipelineError, nearest
from pipeline.storage.artifact import DamagedArtifact
from pipeline.storage.claims import store_with_claims
from pipeline.storage.files import write_text
from pipeline.storage.forms import check_manifest, read_json
from pipeline.storage.sealed import sealed, unsealed
from pipeline.storage.store import Store

FORMAT = 1
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class NodeRun:
    """One node of a run, as its manifest tells it.

    Attributes
    ----------
    name, stage, summary : str
        Name in the graph, stage, and the first line of the stage's manual.
    status : {"ran", "cached", "failed", "blocked", "absent"}
        What became of it when the run was last carried out.
    inputs : dict of str to tuple of str
        Upstream nodes by parameter.
    settings : dict
        Every setting; devices as mappings with their name under ``device``.
    written : frozenset of str
        Settings that YAML or the command line wrote.
    type, key, artifact : str
        Class of the value, digests of recipe and value.
    seconds, cpu_seconds, peak_mb : float or None
        What computing it took, whenever that was.
    host, finished : str
        Where and when it was computed.
    warnings, notes : tuple of str
        What the stage said.
    reason, error : str
        Why it ran or did not; traceback of a failure.
    blocked_by : tuple of str
        Failed nodes that it waited for.
    """

    name: str
    stage: str = ""
    summary: str = ""
    status: Literal["ran", "cached", "failed", "blocked", "absent"] = "absent"
    inputs: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    written: frozenset[str] = frozenset()
    type: str = ""
    key: str = ""
    artifact: str = ""
    seconds: float | None = None
    cpu_seconds: float | None = None
    peak_mb: float | None = None
    host: str = ""
    finished: str = ""
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    reason: str = ""
    error: str = ""
    blocked_by: tuple[str, ...] = ()


@dataclass(frozen=True, repr=False)
class Run:
    """A run of an experiment and its results.

    ``run["fit"]`` is a node's value, ``run.metrics`` are its figures, ``run.path`` is its folder; ``run.raw`` is its
    configuration before interpolation. The store keeps what was installed under ``run.environment``, and the records
    that came with somebody else's bundle under ``run.claims``.
    """

    name: str
    digest: str
    path: Path
    store: Store
    command: str
    overrides: tuple[str, ...]
    description: str
    nodes: Mapping[str, NodeRun]
    metrics: Mapping[str, float]
    config_yaml: str
    versions: Mapping[str, str]
    commit: str
    host: str
    finished: str
    total_seconds: float
    raw: Mapping[str, Any] = field(default_factory=dict)
    environment: str = ""
    claims: str = ""

    def __repr__(self) -> str:
        nodes = ", ".join(f"{name}: {node.status}" for name, node in self.nodes.items())
        return f"<Run {self.path}  {nodes}>"

    def _repr_html_(self) -> str:
        from pipeline.notebook import run_html

        return run_html(self)

    def mesh(self, name: str) -> Any:
        """The images of a node's value as a ``pyvista.ImageData``; see :func:`pipeline.meshes.as_mesh`."""
        from pipeline.meshes import as_mesh

        return as_mesh(self.value(name))

    def __getitem__(self, name: str) -> Any:
        """The value of a node, its arrays memory-mapped and read-only."""
        return self.value(name)

    def value(self, name: str) -> Any:
        """The value of a node, its arrays memory-mapped and read-only.

        Raises
        ------
        InputError
            There is no such node, or it has no value.
        DamagedArtifact
            The stored value is damaged; it was set aside, and the next run computes it again.
        """
        node = self.node(name)
        if not self.has(name):
            raise InputError(f"node '{name}' of {self.path} has no value: it is {node.status}", hint=node.reason)
        try:
            return self.store.get(node.artifact)
        except DamagedArtifact as error:
            raise DamagedArtifact(f"{error}\nRun again to compute it anew: {self.command}") from None

    def has(self, name: str) -> bool:
        """Whether a node has a value."""
        return bool(self.node(name).artifact)

    def node(self, name: str) -> NodeRun:
        """What the manifest says of a node.

        Raises
        ------
        InputError
            There is no such node.
        """
        if name not in self.nodes:
            raise InputError(f"{self.path} has no node '{name}'", hint=nearest(name, self.nodes))
        return self.nodes[name]

    def seconds(self, name: str) -> float:
        """Wall seconds that computing a node took, whenever that was."""
        seconds = self.node(name).seconds
        if seconds is None:
            raise InputError(f"node '{name}' of {self.path} was never computed")
        return seconds

    @property
    def failed(self) -> bool:
        """Whether any node failed."""
        return any(node.status == "failed" for node in self.nodes.values())

    @property
    def report(self) -> Path:
        """The report, one HTML file."""
        return self.path / "report.html"

    def ran(self) -> Iterator[str]:
        """Names of the nodes that were computed when the run was last carried out."""
        return (node.name for node in self.nodes.values() if node.status == "ran")

    def _way_to_store(self) -> str:
        """The store's folder seen from the run's, for when both are moved together; empty for one at a URL."""
        if "://" in self.store.location:
            return ""
        return os.path.relpath(self.store.location, self.path.absolute())

    def _same_values(self) -> bool:
        """Whether the manifest that lies there names the values of this run."""
        try:
            before = open_run(self.path)
        except PipelineError:
            return False
        return {n.name: n.artifact for n in before.nodes.values()} == {n.name: n.artifact for n in self.nodes.values()}

    def save(self) -> None:
        """Write ``manifest.json`` and ``config.yaml``; a report of other values goes first."""
        content = {
            "format": FORMAT,
            "experiment": self.name,
            "digest": self.digest,
            "command": self.command,
            "overrides": list(self.overrides),
            "description": self.description,
            "metrics": dict(self.metrics),
            "versions": dict(self.versions),
            "commit": self.commit,
            "host": self.host,
            "finished": self.finished,
            "total_seconds": self.total_seconds,
            "store": self.store.location,
            "store_from_here": self._way_to_store(),
            "claims": self.claims,
            "environment": self.environment,
            "raw": self.raw,
        }
        nodes = (json.dumps({**vars(node), "written": sorted(node.written)}) for node in self.nodes.values())
        lines = [*(f"{json.dumps(name)}: {json.dumps(value)}" for name, value in content.items())]
        lines.append('"nodes": [\n' + ",\n".join(nodes) + "\n]")
        if self.report.is_file() and not self._same_values():
            self.report.unlink(missing_ok=True)
        write_text(self.path / "config.yaml", self.config_yaml)
        write_text(self.path / MANIFEST, sealed("{" + ",\n".join(lines) + "}"))


def open_run(path: Path) -> Run:
    """Open the folder of an earlier run.

    Raises
    ------
    InputError
        There is no run in that folder, or its manifest is not what a run writes.
    """
    try:
        content = read_json(path / MANIFEST)
        if content.get("format", FORMAT) != FORMAT:
            raise InputError(f"{path / MANIFEST} has format {content['format']}", expected=f"format {FORMAT}")
        check_manifest(content, path / MANIFEST)
        return Run(
            name=content["experiment"],
            digest=content["digest"],
            path=path,
            store=_store_of(content, path),
            command=content["command"],
            overrides=tuple(content["overrides"]),
            description=content["description"],
            nodes={node["name"]: _node(node) for node in content["nodes"]},
            metrics=content["metrics"],
            config_yaml=(path / "config.yaml").read_text(),
            versions=content["versions"],
            commit=content["commit"],
            host=content["host"],
            finished=content["finished"],
            total_seconds=content["total_seconds"],
            raw=content.get("raw", {}),
            environment=content.get("environment", ""),
            claims=content.get("claims", ""),
        )
    except OSError:
        raise InputError(
            f"there is no run in {path}", expected="a folder such as runs/polarization_logo/3f2a91c0"
        ) from None
    except (ValueError, KeyError, TypeError) as error:
        raise PipelineError(f"{path / MANIFEST} cannot be read: {error!r}") from None


def _store_of(content: Mapping[str, Any], path: Path) -> Store:
    """The run's store: where it was, or where it would be if it was moved together with the run."""
    claims = content.get("claims", "")
    if "://" in content["store"]:
        return store_with_claims(content["store"], claims)
    wanted = {node["artifact"] for node in content["nodes"] if node["artifact"]}
    here = path.absolute()
    places = [here / content["store"], here / (content.get("store_from_here") or "."), here.parent.parent / ".store"]

    def held(root: Path) -> int:
        return sum(Store(root).object_folder(artifact).is_dir() for artifact in wanted)

    if held(places[0]) == len(wanted):
        return store_with_claims(places[0], claims)
    return store_with_claims(max(places, key=held).resolve(), claims)


def _node(content: dict[str, Any]) -> NodeRun:
    content["inputs"] = {name: tuple(upstream) for name, upstream in content["inputs"].items()}
    for name in ("warnings", "notes", "blocked_by"):
        content[name] = tuple(content[name])
    return NodeRun(**{**content, "written": frozenset(content["written"])})


def last_keys(runs: Path, experiment: str) -> dict[str, str]:
    """Recipe key of each node in the run of an experiment that was carried out last."""
    try:
        found = unsealed((runs / experiment / "last.json").read_bytes())
        return {str(name): str(key) for name, key in found.items()}
    except (OSError, ValueError, AttributeError):
        return {}


def remember_keys(runs: Path, run: Run) -> None:
    """Keep the recipe keys of a run for the next one to compare itself with."""
    before = last_keys(runs, run.name)
    keys = {**before, **{node.name: node.key for node in run.nodes.values() if node.key}}
    if keys != before:
        write_text(runs / run.name / "last.json", sealed(json.dumps(keys)))
