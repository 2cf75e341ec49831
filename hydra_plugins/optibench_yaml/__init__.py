"""Folders of YAML files read with libyaml, and graphs past OmegaConf where it has nothing to do with them.

OmegaConf's own loader is in Python, and its containers cost half a millisecond a node: most of a large graph's time.
Hydra takes plugins from the package ``hydra_plugins`` only, so this stands here.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from typing import Any

import yaml
from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra.plugins.config_source import ConfigLoadError, ConfigResult
from omegaconf import OmegaConf
from omegaconf._utils import get_yaml_loader

SCHEME = "optibench"


class LibyamlConfigSource(FileConfigSource):
    """Hydra's source for folders, but for the loader."""

    @staticmethod
    def scheme() -> str:
        """What stands before ``://`` in a search path."""
        return SCHEME

    def load_config(self, config_path: str) -> ConfigResult:
        """Read a file."""
        path = os.path.realpath(os.path.join(self.path, self._normalize_file_name(config_path)))
        if not os.path.exists(path):
            raise ConfigLoadError(f"Config not found : {path}")
        with open(path, encoding="utf-8") as file:
            header = self._get_header_dict(file.read(512))
            file.seek(0)
            content = yaml.load(file, Loader=loader())
        graphs = _apart.get()
        if graphs is not None and header["package"] == "_global_" and isinstance(content, dict):
            graph = content.get("graph")
            if isinstance(graph, dict) and _is_plain(graph):
                graphs.append(graph)
                content["graph"] = {}
        return ConfigResult(
            config=OmegaConf.create({} if content is None else content),
            path=f"{SCHEME}://{self.path}",
            provider=self.provider,
            header=header,
        )


_apart: ContextVar[list[Any] | None] = ContextVar("graphs set apart", default=None)


@contextmanager
def graphs_apart() -> Iterator[list[Any]]:
    """Give the graphs of the files that are read inside the block apart, where they are plain; they are empty to Hydra.

    Whoever asks for it must see to it that nothing was to be merged into them, and that nothing refers to them.
    """
    graphs: list[Any] = []
    token = _apart.set(graphs)
    try:
        yield graphs
    finally:
        _apart.reset(token)


def _is_plain(value: Any) -> bool:
    """Whether OmegaConf would find nothing in it to resolve, and nothing to refuse."""
    if type(value) is dict:
        return all(type(name) is str and _is_plain(item) for name, item in value.items())
    if type(value) is list:
        return all(_is_plain(item) for item in value)
    if type(value) is str:
        return "${" not in value
    return value is None or type(value) in {bool, int, float}


@cache
def loader() -> Any:
    """OmegaConf's loader with libyaml for its parser; that loader itself where PyYAML came without."""
    ours = get_yaml_loader()
    if not yaml.__with_libyaml__:
        return ours

    class Loader(yaml.cyaml.CParser, ours):  # type: ignore[misc]
        def __init__(self, stream: Any) -> None:
            yaml.cyaml.CParser.__init__(self, stream)
            yaml.constructor.SafeConstructor.__init__(self)
            yaml.resolver.Resolver.__init__(self)

    return Loader
