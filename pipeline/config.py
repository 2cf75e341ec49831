"""An experiment's configuration: composed by Hydra, with the place that every value came from."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.errors import InputError, nearest

if TYPE_CHECKING:
    import yaml

OPEN_SECTIONS = ("graph", "rig", "executor")
"""Sections whose settings are checked against signatures, so that an override may name one that no YAML writes."""


@dataclass(frozen=True)
class Override:
    """One override of the command line: ``graph.fit.prenormalize=false``."""

    text: str
    path: str
    removes: bool = False


@dataclass(frozen=True)
class Configuration:
    """A composed experiment.

    Attributes
    ----------
    experiment : str
        Name of the experiment.
    content : dict
        Everything, resolved to plain values; missing values are the text ``???``.
    raw : dict
        The same before interpolation.
    overrides : tuple of Override
        What the command line changed.
    files : tuple of (Path, str)
        The YAML files it was composed of, later ones winning, and the section that each fills.
    """

    experiment: str
    content: dict[str, Any]
    raw: dict[str, Any]
    overrides: tuple[Override, ...]
    files: tuple[tuple[Path, str], ...]
    _trees: dict[Path, yaml.Node | None] = field(default_factory=dict, compare=False, repr=False)

    def written_by_override(self, path: str) -> bool:
        """Whether the command line wrote the value at a dotted path, or something inside it."""
        return any(o.path == path or o.path.startswith(path + ".") for o in self.overrides if not o.removes)

    def where(self, path: str) -> str:
        """Where a value was written, for people: the override, or file, line and YAML path."""
        path = self._followed(path)
        for override in reversed(self.overrides):
            if override.path and (path == override.path or path.startswith(override.path + ".")):
                return f"override {override.text}"
        for file, section in reversed(self.files):
            line = self._line(file, section, path)
            if line is not None:
                return f"{_shown(file)}, line {line}: {path}"
        parent = path.rpartition(".")[0]
        return self.where(parent) + f" (for {path})" if parent else path

    def _followed(self, path: str) -> str:
        """The path that an interpolation such as ``${rig}`` on the way leads to."""
        node: Any = self.raw
        parts = path.split(".")
        for index, part in enumerate(parts):
            if not isinstance(node, dict) or part not in node:
                break
            node = node[part]
            if isinstance(node, str) and (match := re.fullmatch(r"\$\{([\w.]+)\}", node)):
                return self._followed(".".join([match[1], *parts[index + 1 :]]))
        return path

    def _line(self, file: Path, section: str, path: str) -> int | None:
        import yaml

        if section and not (path == section or path.startswith(section + ".")):
            return None
        inner = path[len(section) :].lstrip(".") if section else path
        if file not in self._trees:
            self._trees[file] = yaml.compose(file.read_text(), Loader=yaml.SafeLoader)
        node: Any = self._trees[file]
        line = 1 if not inner else None
        for part in inner.split(".") if inner else ():
            if not hasattr(node, "value") or not isinstance(node.value, list):
                return None
            for key, value in (pair for pair in node.value if isinstance(pair, tuple)):
                if key.value == part:
                    node, line = value, key.start_mark.line + 1
                    break
            else:
                return None
        return line


def configs_folder() -> Path:
    """Folder of the YAML files: inside the installed package, or beside it in a checkout."""
    package = Path(__file__).resolve().parent
    inside = package / "configs"
    return inside if inside.is_dir() else package.parent / "configs"


def options(group: str, folders: Sequence[Path] = ()) -> dict[str, Path]:
    """Names and files in a config group."""
    found: dict[str, Path] = {}
    for folder in (configs_folder(), *folders):
        found |= {path.stem: path for path in sorted((folder / group).glob("*.yaml"))}
    return found


def compose(overrides: Sequence[str]) -> Configuration:
    """Compose the configuration that the overrides ask for.

    Raises
    ------
    InputError
        No or an unknown experiment, an unknown option of a group, an override or a YAML file that cannot be read.
    """
    texts = [_opened(text) for text in overrides]
    experiment = _experiment(texts)
    from hydra import compose as hydra_compose
    from hydra import initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException, MissingConfigException
    from omegaconf import OmegaConf
    from omegaconf.errors import OmegaConfBaseException
    from yaml import YAMLError

    _check_groups(texts)
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(config_dir=str(configs_folder()), version_base="1.3"):
            composed = hydra_compose("config", overrides=texts, return_hydra_config=True)
        choices = dict(composed.hydra.runtime.choices)
        with_hydra = OmegaConf.to_container(composed, resolve=False)
        OmegaConf.set_struct(composed, False)
        del composed["hydra"]
        content = OmegaConf.to_container(composed, resolve=True)
    except YAMLError as error:
        raise InputError(f"a YAML file cannot be read: {_one_line(error)}") from None
    except MissingConfigException as error:
        raise InputError(_one_line(error)) from None
    except (HydraException, OmegaConfBaseException) as error:
        cause = error.__cause__ or error
        raise InputError(
            _one_line(error if cause is error else f"{_one_line(error)}: {_one_line(cause)}"),
            where=" ".join(overrides),
        ) from None
    assert isinstance(content, dict)
    assert isinstance(with_hydra, dict)
    with_hydra.pop("hydra")
    files = [(configs_folder() / "config.yaml", "")]
    for group, choice in choices.items():
        if isinstance(choice, str) and not group.startswith("hydra"):
            files.append((configs_folder() / group / f"{choice}.yaml", "" if group == "experiment" else group))
    return Configuration(
        experiment=experiment,
        content={str(k): v for k, v in content.items()},
        raw={str(k): v for k, v in with_hydra.items()},
        overrides=tuple(_parsed(text) for text in texts),
        files=tuple(sorted((f for f in files if f[0].is_file()), key=lambda f: f[1] == "")),
    )


def _opened(text: str) -> str:
    """An override with the prefix that Hydra wants but a user need not know."""
    if text.startswith("experiment="):
        return "+" + text
    if re.match(rf"({'|'.join(OPEN_SECTIONS)})\.", text):
        return "++" + text
    return text


def _parsed(text: str) -> Override:
    bare = text.lstrip("+")
    removes = bare.startswith("~")
    path = bare.lstrip("~").split("=", 1)[0]
    return Override(bare, path, removes)


def _experiment(texts: Sequence[str]) -> str:
    known = options("experiment")
    chosen = [t.split("=", 1)[1] for t in texts if t.startswith("+experiment=")]
    if not chosen:
        raise InputError(
            "no experiment is named",
            where="command line",
            expected="+experiment=NAME",
            hint="there is: " + ", ".join(known),
        )
    if chosen[-1] not in known:
        raise InputError(
            f"there is no experiment '{chosen[-1]}'",
            where=f"override +experiment={chosen[-1]}",
            expected=f"a file in {_shown(configs_folder() / 'experiment')}",
            hint=nearest(chosen[-1], known),
        )
    return chosen[-1]


def _check_groups(texts: Sequence[str]) -> None:
    groups = {p.name for p in configs_folder().iterdir() if p.is_dir()}
    for text in texts:
        name, _, choice = text.lstrip("+").partition("=")
        if name in groups and choice and choice not in options(name) and not choice.startswith("{"):
            raise InputError(
                f"there is no {name} '{choice}'",
                where=f"override {text}",
                expected=f"a file in {_shown(configs_folder() / name)}",
                hint=nearest(choice, options(name)),
            )


def _one_line(error: object) -> str:
    return " ".join(str(error).split())


def _shown(path: Path) -> str:
    try:
        return str(path.relative_to(Path.cwd()))
    except ValueError:
        return str(path)
