"""YAML read by hand, so that whatever is wrong with it is told with its line."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from pipeline.errors import InputError, InputErrors, nearest

LONGEST_NAME = 255
_NULL = "tag:yaml.org,2002:null"


def root_of(path: Path) -> yaml.Node | None:
    """Outermost node of a YAML file; None where it is empty.

    Raises
    ------
    InputErrors
        The file cannot be read or is no YAML.
    """
    try:
        root: yaml.Node | None = yaml.compose(path.read_text(encoding="utf-8"), Loader=yaml.SafeLoader)
    except (OSError, UnicodeDecodeError) as error:
        raise InputErrors([InputError(f"{path.name} cannot be read: {error}", where=str(path))]) from None
    except RecursionError:
        raise InputErrors([InputError("no valid YAML: nested too deeply", where=str(path))]) from None
    except yaml.MarkedYAMLError as error:
        line = error.problem_mark.line + 1 if error.problem_mark else 1
        raise InputErrors([InputError(f"no valid YAML: {error.problem}", where=f"{path}:{line}")]) from None
    except yaml.YAMLError as error:
        raise InputErrors([InputError(f"no valid YAML: {error}", where=str(path))]) from None
    return root


@dataclass(eq=False)
class YamlReader:
    """Takes values out of the nodes of a YAML file, collecting problems with their lines.

    Attributes
    ----------
    path : Path
        The file.
    problems : list of InputError
        What was wrong so far.
    """

    path: Path
    problems: list[InputError] = field(default_factory=list)

    def fields(
        self, root: yaml.Node | None, known: Mapping[str, Callable[[yaml.Node], Any]], *, required: tuple[str, ...]
    ) -> dict[str, Any] | None:
        """All of a ``capture.yaml`` but its kind; None where anything is wrong with it."""
        if root is None:
            self.problems.append(
                InputError(f"{self.path.name} is empty", where=str(self.path), expected=", ".join(required))
            )
            return None
        values = self.mapping(root, known, required=required, what="capture.yaml")
        if values is None or self.problems:
            return None
        del values["kind"]
        return values

    def mapping(
        self,
        node: yaml.Node,
        known: Mapping[str, Callable[[yaml.Node], Any]],
        *,
        required: tuple[str, ...],
        what: str,
    ) -> dict[str, Any] | None:
        """A mapping, each value taken by what ``known`` says for its key; keys without a value are left out."""
        if not isinstance(node, yaml.MappingNode):
            self.problem(node, f"{what} is {described(node)}", f"a mapping with {', '.join(known)}")
            return None
        values: dict[str, Any] = {}
        for key, value in node.value:
            name = str(key.value)
            if name not in known:
                self.problem(key, f"{what} has no '{name}'", ", ".join(known), nearest(name, known))
            elif name in values:
                self.problem(key, f"'{name}' stands twice", "one")
            elif value.tag != _NULL or name in required:
                values[name] = known[name](value)
        for name in required:
            if name not in values:
                self.problem(node, f"{what} lacks '{name}'", ", ".join(required))
        return values

    def positive(self, node: yaml.Node) -> float | None:
        """A number above 0."""
        text = self.text(node)
        try:
            value = math.nan if text is None else float(text)
        except ValueError:
            value = math.nan
        if not 0 < value < math.inf:
            self.problem(node, f"'{text}' is no positive number", "a number above 0")
            return None
        return value

    def boolean(self, node: yaml.Node) -> bool | None:
        """True or false."""
        text = self.text(node)
        if text not in ("true", "false"):
            self.problem(node, f"'{text}' is neither true nor false", "true or false")
        return text == "true"

    def file(self, node: yaml.Node) -> Path | None:
        """A file, relative to the folder of the YAML."""
        text = self.text(node)
        if not text:
            self.problem(node, "a file without a name", "a file name relative to the folder")
            return None
        parts = Path(text).parts
        if Path(text).is_absolute() or any(part.startswith(".") for part in parts):
            self.problem(
                node,
                f"'{text}' is hidden or lies outside the folder, so that a change of it would go unnoticed",
                "a visible file in the folder, or in a folder below it",
            )
            return None
        if any(len(part.encode()) > LONGEST_NAME for part in parts):
            self.problem(node, "a file name longer than any file system takes", f"at most {LONGEST_NAME} bytes")
            return None
        return self.path.parent / text

    def files(self, node: yaml.Node) -> tuple[Path, ...]:
        """A file, or a list of files."""
        items = node.value if isinstance(node, yaml.SequenceNode) else [node]
        return tuple(path for path in map(self.file, items) if path is not None)

    def texts(self, node: yaml.Node) -> dict[str, str]:
        """A mapping to texts."""
        if not isinstance(node, yaml.MappingNode):
            self.problem(node, f"metadata is {described(node)}", "a mapping of texts")
            return {}
        return {str(key.value): str(self.text(value)) for key, value in node.value}

    def text(self, node: yaml.Node) -> str | None:
        """One value as it is written."""
        if not isinstance(node, yaml.ScalarNode):
            self.problem(node, f"{described(node)} stands where one value is due", "one value")
            return None
        return str(node.value)

    def place(self, node: yaml.Node) -> str:
        """File and line of a node."""
        return f"{self.path}:{node.start_mark.line + 1}"

    def problem(self, node: yaml.Node, what: str, expected: str, hint: str = "") -> None:
        """Note what is wrong with a node."""
        self.problems.append(InputError(what, where=self.place(node), expected=expected, hint=hint))


def described(node: yaml.Node) -> str:
    """A node in words."""
    if isinstance(node, yaml.ScalarNode):
        return f"'{node.value}'" if node.value else "empty"
    size = len(node.value)
    return f"a {'list' if isinstance(node, yaml.SequenceNode) else 'mapping'} of {size}"
