"""What may stand in a configuration and in the overrides on it, with the nearest right name for what may not."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from pipeline.errors import InputError, nearest
from pipeline.graph.config import Configuration, configs_folder, groups, option_file, options, shown

OPEN_SECTIONS = ("graph", "rig", "executor", "tradeoff", "maps")
"""Sections whose settings are checked afterwards, so that an override may name one that no YAML writes."""

FURTHER_RIG = "_rig"
"""End of the names of the sections in which an experiment keeps rigs besides its own."""

SECTIONS = (
    "description",
    "graph",
    "rig",
    "executor",
    "paths",
    "recapture",
    "until",
    "from",
    "force",
    "objective",
    "tradeoff",
    "maps",
)
"""What may stand at the top of a configuration, besides what others refer to."""

SECTION_KINDS = (
    ("description", (str, type(None)), "text"),
    ("graph", dict, "nodes: {stage: ..., ...}"),
    ("executor", (dict, type(None)), "{kind: threads, ...}"),
    ("paths", dict, "{runs: DIR, store: DIR}"),
    ("recapture", bool, "true or false"),
)


def check_groups(texts: Sequence[str], folders: Sequence[Path]) -> None:
    """Refuse an option that a config group does not have."""
    for text in texts:
        name, _, choice = text.lstrip("+").partition("=")
        name = name.partition("@")[0]
        if name in groups(folders) and choice and not choice.startswith("{"):
            known = options(name, folders)
            if choice not in known:
                raise InputError(
                    f"there is no {name} '{choice}'",
                    where=f"override {text.lstrip('+')}",
                    expected=f"a file in {shown(configs_folder() / name)}",
                    hint=nearest(choice, known),
                )


def check_paths(texts: Sequence[str], content: Mapping[str, Any]) -> None:
    """Refuse an override of what the configuration does not have, where Hydra would advise to append it.

    Parameters
    ----------
    texts : sequence of str
        Overrides; those of what is checked against signatures begin with ``+`` by now.
    content : mapping
        The configuration without them, the experiment's own sections included.
    """
    for text in texts:
        path = text.partition("=")[0].partition("@")[0]
        if not path.startswith(("+", "~", "hydra")):
            _check_path(text, path.split("."), content)


def _check_path(text: str, path: Sequence[str], content: Mapping[str, Any]) -> None:
    place: Any = content
    for depth, name in enumerate(path):
        if not isinstance(place, Mapping):
            return
        if name in place:
            place = place[name]
            continue
        known = [str(key) for key in place]
        if depth:
            raise InputError(
                f"'{'.'.join(path[:depth])}' has no '{name}'",
                where=f"override {text}",
                expected="a name from: " + ", ".join(known),
                hint=nearest(name, known),
            )
        is_node = name in (content.get("graph") or ())
        raise InputError(
            f"there is no section '{name}'",
            where=f"override {text}",
            expected="graph.NODE.SETTING=VALUE, or a section from: " + ", ".join(known),
            hint=f"did you mean 'graph.{text}'?" if is_node else nearest(name, known),
        )


def check_sections(configuration: Configuration) -> None:
    """Refuse what stands at the top of a configuration and means nothing."""
    if "experiment" in configuration.content:
        file = option_file("experiment", configuration.experiment, configuration.folders)
        raise InputError(
            f"the experiment '{configuration.experiment}' fills a section 'experiment' instead of the configuration",
            where=shown(file) if file else "",
            expected="'# @package _global_' as the first line of the file",
        )
    for name, kinds, expected in SECTION_KINDS:
        value = configuration.content.get(name)
        if not isinstance(value, kinds):
            raise InputError(f"'{name}' is {value!r}", where=configuration.where(name), expected=expected)
    for name in ("runs", "store"):
        value = configuration.content["paths"].get(name)
        if not isinstance(value, str) or not value.strip():
            raise InputError(f"'{name}' is {value!r}", where=configuration.where(f"paths.{name}"), expected="a folder")
    for name in configuration.content:
        if name not in SECTIONS and not _referred_to(name, configuration):
            raise InputError(
                f"there is no section '{name}', and nothing refers to it",
                where=configuration.where(name),
                expected="a section from: " + ", ".join(SECTIONS) + ", or a name that ${NAME} is used for",
                hint=nearest(name, SECTIONS),
            )


def _referred_to(name: str, configuration: Configuration) -> bool:
    """Whether ``${name}`` stands in the configuration, or did in its files where an override took its place."""
    reference = re.compile(rf"\$\{{{re.escape(name)}\b")
    if reference.search(json.dumps(configuration.raw)):
        return True
    return any(reference.search(file.read_text()) for file, _ in configuration.files)
