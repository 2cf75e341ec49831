"""Overrides and YAML files to one configuration, by Hydra; what it gave is remembered while nothing changes."""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from pipeline.errors import InputError, nearest
from pipeline.graph.config import Configuration, Override, configs_folder, groups, option_file, options, shown
from pipeline.graph.sections import FURTHER_RIG, OPEN_SECTIONS, SECTIONS, check_groups, check_paths, check_sections
from pipeline.storage.files import settled, stamp, write_text
from pipeline.storage.keys import digest
from pipeline.storage.sealed import sealed, unsealed
from pipeline.storage.store import Store

MOST_REMEMBERED = 200
_FORMAT = 2


def compose(overrides: Sequence[str], folders: Sequence[Path] = ()) -> Configuration:
    """Compose the configuration that the overrides ask for.

    Parameters
    ----------
    overrides : sequence of str
        Words of the command line.
    folders : sequence of Path
        More folders of YAML files, laid out as ``configs/``.

    Raises
    ------
    InputError
        No or an unknown experiment, an unknown option of a group, a section that does not exist, an override or a YAML
        file that cannot be read.
    """
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"there is no folder {folder}", where="--config-dir", expected="a folder of YAML files")
    texts = [opened(text) for text in overrides]
    experiment = chosen_experiment(texts, folders)
    check_groups(texts, folders)
    memory = _memory_file(texts, folders)
    recalled = _recalled(memory)
    known = recalled or _composed(texts, overrides, folders)
    configuration = Configuration(
        experiment=experiment,
        content=known["content"],
        raw=known["raw"],
        overrides=tuple(_override(text, folders) for text in texts),
        files=tuple((Path(file), section) for file, section in known["files"]),
        folders=tuple(folders),
        words=tuple(f"+{word}" if word.startswith("experiment=") else word for word in overrides),
        sweeps=bool(known["sweeps"]),
        memory=None if recalled else memory,
    )
    check_sections(configuration)
    return configuration


def recomposed(experiment: str, config_yaml: str, file: Path) -> Configuration:
    """The configuration that a run kept, without looking at any other file.

    Raises
    ------
    InputError
        The text is not YAML, or no configuration.
    """
    import yaml

    try:
        content = yaml.load(config_yaml, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    except yaml.YAMLError as error:
        raise InputError(f"a YAML file cannot be read: {_one_line(error)}", where=shown(file)) from None
    if not isinstance(content, dict):
        raise InputError("a configuration is missing", where=shown(file), expected="sections such as graph and rig")
    return Configuration(experiment, content, content, (), ((file, ""),))


def _package(file: Path) -> str:
    """The section that a YAML file says it fills, ``# @package graph.surface``; empty where it says nothing."""
    with file.open(encoding="utf-8") as lines:
        found = re.match(r"# @package ([\w.]+)", lines.readline())
    return found[1] if found else ""


@contextmanager
def hydra_ready(folders: Sequence[Path]) -> Iterator[list[str]]:
    """Hydra initialised on our folder; gives the overrides that add the others."""
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra

    GlobalHydra.instance().clear()
    with initialize_config_dir(config_dir=str(configs_folder()), version_base="1.3"):
        yield [f"hydra.searchpath=[{','.join(f'optibench://{f.absolute()}' for f in folders)}]"] if folders else []


@contextmanager
def readable_errors(where: str) -> Iterator[None]:
    """Turn Hydra's and OmegaConf's errors into ours."""
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf.errors import OmegaConfBaseException
    from yaml import MarkedYAMLError, YAMLError

    try:
        yield
    except MarkedYAMLError as error:
        mark = error.problem_mark
        place = f"{shown(Path(mark.name))}, line {mark.line + 1}" if mark else where
        raise InputError(f"a YAML file cannot be read: {_one_line(error.problem or error)}", where=place) from None
    except YAMLError as error:
        raise InputError(f"a YAML file cannot be read: {_one_line(error)}", where=where) from None
    except MissingConfigException as error:
        raise InputError(_one_line(error)) from None
    except (HydraException, OmegaConfBaseException) as error:
        cause = error.__cause__ or error
        what = _one_line(error if cause is error else f"{_one_line(error)}: {_one_line(cause)}")
        what, _, _ = what.partition(" To append to your config use ")
        if missing := re.search(r"Missing mandatory value: ([\w.]+)", what):
            raise InputError(f"'{missing[1]}' is not given", where=where, expected=f"{missing[1]}=VALUE") from None
        unknown = re.search(r"Could not override '([\w.]+)'", what)
        hint = nearest(unknown[1].split(".")[0], SECTIONS) if unknown else ""
        raise InputError(what, where=where, hint=hint) from None
    except UnicodeDecodeError as error:
        raise InputError(f"a YAML file is not UTF-8: {error.reason}", where=where) from None
    except (AssertionError, AttributeError, TypeError, ValueError) as error:
        raise InputError(f"the YAML files cannot be composed: {_one_line(error) or repr(error)}", where=where) from None


def opened(text: str) -> str:
    """An override with the prefix that Hydra wants but a user need not know."""
    if text.startswith("experiment="):
        return "+" + text
    if re.match(rf"({'|'.join(OPEN_SECTIONS)}|\w+{FURTHER_RIG})\.", text):
        return "++" + text
    return text


def quoted(text: str) -> str:
    """An override with its value in quotes where Hydra's grammar would not take it as it stands, as a path may be."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    try:
        OverridesParser.create().parse_override(text)
    except HydraException:
        name, equals, value = text.partition("=")
        if equals and value and not value.startswith(("[", "{", "'", '"')):
            escaped = value.replace("\\", "\\\\").replace("'", "\\'")
            return f"{name}='{escaped}'"
    return text


def parsed(text: str) -> Override:
    """An override as the rest of the bench sees it."""
    bare = text.lstrip("+")
    removes = bare.startswith("~")
    path = bare.lstrip("~").split("=", 1)[0]
    return Override(bare, path, removes)


def _override(text: str, folders: Sequence[Path]) -> Override:
    """The same, where an option that fills another section than its group's name is no value of a section's."""
    override = parsed(text)
    group, _, choice = override.text.partition("=")
    file = option_file(group, choice, folders) if group in groups(folders) else None
    return replace(override, path="") if file and _package(file) not in ("", group) else override


def is_sweep(text: str) -> bool:
    """Whether an override has several values, each for a run of its own."""
    from hydra.core.override_parser.overrides_parser import OverridesParser
    from hydra.errors import HydraException

    try:
        return bool(OverridesParser.create().parse_override(text).is_sweep_override())
    except HydraException:
        return False


def refuse_sweeps(texts: Sequence[str], command: Sequence[str]) -> None:
    """Refuse an override with several values, which takes a sweep: ``command`` with ``-m``.

    Raises
    ------
    InputError
        There is one.
    """
    for text in texts:
        if is_sweep(text):
            bare = text.lstrip("+")
            raise InputError(
                f"'{bare.partition('=')[0]}' has several values, and one run takes one",
                where=f"override {bare}",
                expected="one value, or -m for a sweep over all of them",
                hint=shlex.join(["python", "-m", "pipeline", "-m", *command]),
            )


def chosen_experiment(texts: Sequence[str], folders: Sequence[Path] = ()) -> str:
    """Name of the experiment that the overrides choose.

    Raises
    ------
    InputError
        None, or one that does not exist.
    """
    known = options("experiment", folders)
    chosen = [t.split("=", 1)[1] for t in texts if t.startswith("+experiment=")]
    if not chosen:
        raise InputError(
            "no experiment is named",
            where="command line",
            expected="+experiment=NAME",
            hint="there is: " + ", ".join(known),
        )
    if chosen[-1] not in known:
        places = " or ".join(shown(folder / "experiment") for folder in (configs_folder(), *folders))
        raise InputError(
            f"there is no experiment '{chosen[-1]}'",
            where=f"override +experiment={chosen[-1]}",
            expected=f"a file in {places}" + ("" if folders else ", or --config-dir=FOLDER with experiment/NAME.yaml"),
            hint=nearest(chosen[-1], known),
        )
    return chosen[-1]


def _composed(texts: Sequence[str], overrides: Sequence[str], folders: Sequence[Path]) -> dict[str, Any]:
    from omegaconf import OmegaConf

    command = [*(f"--config-dir={folder}" for folder in folders), *overrides]
    with readable_errors(" ".join(overrides)), _checked_paths(texts, folders, command):
        composed, graph = _by_hydra(texts, folders)
        choices = dict(composed.hydra.runtime.choices)
        sweeps = str(composed.hydra.mode).endswith("MULTIRUN")
        OmegaConf.set_struct(composed, False)
        del composed["hydra"]
        raw = OmegaConf.to_container(composed, resolve=False)
        content = OmegaConf.to_container(composed, resolve=True)
    assert isinstance(content, dict)
    assert isinstance(raw, dict)
    if graph is not None:
        raw["graph"] = content["graph"] = graph
    files = [(configs_folder() / "config.yaml", "")]
    for name, choice in choices.items():
        if isinstance(choice, str) and not name.startswith("hydra"):
            group, _, section = name.partition("@")
            file = option_file(group, choice, folders)
            if file is None:
                hint = nearest(choice, options(group, folders))
                raise InputError(f"there is no {group} '{choice}'", where="the experiment's defaults", hint=hint)
            files.append((file, "" if group == "experiment" else section or _package(file) or group))
    return {
        "content": {str(k): v for k, v in content.items()},
        "raw": {str(k): v for k, v in raw.items()},
        "sweeps": sweeps,
        "files": [[str(file), section] for file, section in sorted(files, key=lambda f: f[1] == "")],
    }


@contextmanager
def _checked_paths(texts: Sequence[str], folders: Sequence[Path], command: Sequence[str]) -> Iterator[None]:
    """Where Hydra refuses the overrides, look first for one that sweeps, or names what the files do not have."""
    from hydra import compose
    from hydra.errors import HydraException
    from omegaconf import OmegaConf

    try:
        yield
    except HydraException:
        refuse_sweeps(texts, command)
        chosen = [text for text in texts if text.startswith("+") or text.partition("=")[0] in groups(folders)]
        with suppress(HydraException), hydra_ready(folders) as search:
            files = OmegaConf.to_container(compose("config", overrides=[*search, *map(quoted, chosen)]), resolve=False)
            assert isinstance(files, dict)
            check_paths(texts, {str(name): section for name, section in files.items()})
        raise


def _by_hydra(texts: Sequence[str], folders: Sequence[Path]) -> tuple[Any, dict[str, Any] | None]:
    """What Hydra composes; the graph apart, where it is one file's and nothing else concerns it, else None."""
    from hydra import compose
    from omegaconf import OmegaConf

    from hydra_plugins.optibench_yaml import graphs_apart

    with hydra_ready(folders) as search:
        words = [*search, *(quoted(text) for text in texts)]
        if not any(text.lstrip("+~").startswith("graph") for text in texts):
            with graphs_apart() as graphs:
                composed = compose("config", overrides=words, return_hydra_config=True)
            if not graphs:
                return composed, None
            rest = OmegaConf.masked_copy(composed, [name for name in composed if name != "hydra"])
            text = str(OmegaConf.to_container(rest, resolve=False))
            if len(graphs) == 1 and not composed.get("graph") and not re.search(r"\$\{[^}]*(graph|:)", text):
                return composed, graphs[0]
        return compose("config", overrides=words, return_hydra_config=True), None


def _memory_file(texts: Sequence[str], folders: Sequence[Path]) -> Path | None:
    """Where the composition is remembered: in the store, named by all that it depends on; None while files change."""
    runs = next((t.partition("=")[2] for t in reversed(texts) if t.startswith("paths.runs=")), "runs")
    store = next((t.partition("=")[2] for t in reversed(texts) if t.startswith("paths.store=")), f"{runs}/.store")
    memory = Store.at(store).memory / "composed"
    files = [path for folder in (configs_folder(), *folders) for path in sorted(folder.rglob("*.yaml"))]
    stamps = {str(path.absolute()): stamp(path) for path in files}
    if not settled(stamps.values()):
        return None
    name = digest({"format": _FORMAT, "overrides": list(texts), "folders": [str(f) for f in folders], "files": stamps})
    return memory / f"{name}.json"


def _recalled(memory: Path | None) -> dict[str, Any] | None:
    if memory is None:
        return None
    try:
        known = unsealed(memory.read_bytes())
        return known if {"content", "raw", "files", "sweeps"} <= set(known) else None
    except (OSError, ValueError):
        return None


def remember(configuration: Configuration) -> None:
    """Keep a composition, unless it depends on more than files and words, or JSON cannot hold it."""
    memory = configuration.memory
    if memory is None or re.search(r"\$\{[^}]*:", str(configuration.raw)):
        return
    known = {
        "content": configuration.content,
        "raw": configuration.raw,
        "sweeps": configuration.sweeps,
        "files": [[str(file), section] for file, section in configuration.files],
    }
    try:
        text = json.dumps(known)
        if json.loads(text) != known:
            return
    except (TypeError, ValueError):
        return
    with suppress(OSError):
        write_text(memory, sealed(text))
        others = sorted(memory.parent.glob("*.json"), key=lambda path: path.stat().st_mtime)
        for path in others[:-MOST_REMEMBERED]:
            path.unlink(missing_ok=True)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())
