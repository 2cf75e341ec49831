"""Folders of YAML files read with libyaml: OmegaConf's own loader is in Python, and takes most of a large graph's time.

Hydra takes plugins from the package ``hydra_plugins`` only, so it stands here.
"""

from __future__ import annotations

import os
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
        return ConfigResult(
            config=OmegaConf.create({} if content is None else content),
            path=f"{SCHEME}://{self.path}",
            provider=self.provider,
            header=header,
        )


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
