"""Types of inputs and settings as signatures write them, and values checked against them."""

from __future__ import annotations

import ast
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pipeline.errors import InputError, closest

_SCALARS = {"int", "float", "bool", "str", "Path", "None", "object", "Any"}


@dataclass(frozen=True)
class Annotation:
    """A parsed annotation.

    Attributes
    ----------
    kind : str
        A scalar's name, ``union``, ``list``, ``dict``, ``literal`` or ``class``.
    items : tuple of Annotation
        Alternatives of a union, element of a list, value of a dict.
    choices : tuple
        Values of a literal.
    name : str
        Full name of a class.
    """

    kind: str
    items: tuple[Annotation, ...] = ()
    choices: tuple[Any, ...] = ()
    name: str = ""

    def __str__(self) -> str:
        if self.kind == "union":
            return " or ".join(str(item) for item in self.items)
        if self.kind == "list":
            return f"list of {self.items[0]}"
        if self.kind == "dict":
            return f"mapping to {self.items[0]}"
        if self.kind == "literal":
            return "one of " + ", ".join(repr(choice) for choice in self.choices)
        return self.name.rpartition(".")[2] if self.kind == "class" else self.kind

    @property
    def optional(self) -> bool:
        """Whether None is allowed."""
        return self.kind in {"None", "object"} or any(item.optional for item in self.items if self.kind == "union")

    @property
    def is_list(self) -> bool:
        """Whether a list is allowed."""
        return self.kind == "list" or (self.kind == "union" and any(item.is_list for item in self.items))

    def classes(self) -> frozenset[str]:
        """Full names of the classes that this annotation names anywhere."""
        own = frozenset({self.name} if self.kind == "class" else ())
        return own.union(*(item.classes() for item in self.items))


def parse_annotation(text: str, names: Mapping[str, str]) -> Annotation:
    """Parse an annotation; ``names`` tells where each imported name comes from.

    Raises
    ------
    InputError
        The annotation is of a form that settings and inputs cannot have.
    """
    return _parse(ast.parse(text, mode="eval").body, names, text)


def _parse(node: ast.expr, names: Mapping[str, str], text: str) -> Annotation:
    if isinstance(node, ast.Constant):
        if node.value is None:
            return Annotation("None")
        if isinstance(node.value, str):
            return parse_annotation(node.value, names)
    if isinstance(node, ast.Name):
        if node.id in {"Any", "object"}:
            return Annotation("object")
        if node.id in _SCALARS:
            return Annotation(node.id)
        return Annotation("class", name=names.get(node.id, node.id))
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return Annotation("class", name=f"{names.get(node.value.id, node.value.id)}.{node.attr}")
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
        parts: list[Annotation] = []
        for side in (node.left, node.right):
            parsed = _parse(side, names, text)
            parts += parsed.items if parsed.kind == "union" else [parsed]
        return Annotation("union", tuple(parts))
    if isinstance(node, ast.Subscript) and isinstance(node.value, ast.Name):
        outer = node.value.id
        inner = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
        if outer == "Literal":
            return Annotation("literal", choices=tuple(ast.literal_eval(item) for item in inner))
        if outer in {"list", "tuple", "Sequence"}:
            return Annotation("list", (_parse(inner[0], names, text),))
        if outer in {"dict", "Mapping"}:
            return Annotation("dict", (_parse(inner[-1], names, text),))
    raise InputError(f"the annotation '{text}' is of no known form", expected="plain types, lists, unions, literals")


def check_setting(value: Any, annotation: Annotation, name: str) -> Any:
    """The value of a plain setting in its canonical type: ints given for floats become floats, paths absolute.

    Raises
    ------
    InputError
        The value does not fit; says what was expected, and the nearest choice.
    """
    kind = annotation.kind
    if kind == "object":
        return value
    if kind == "union":
        return _check_union(value, annotation, name)
    if kind == "None" and value is None:
        return None
    if kind == "bool" and isinstance(value, bool):
        return value
    if kind == "int" and isinstance(value, int) and not isinstance(value, bool):
        return value
    if kind == "int" and isinstance(value, float) and value.is_integer() and math.isfinite(value):
        return int(value)
    if kind == "float" and isinstance(value, int | float) and not isinstance(value, bool):
        if not math.isfinite(value):
            raise InputError(f"{name} is {value}", expected="a finite number")
        return float(value)
    if kind == "str" and isinstance(value, str):
        return value
    if kind == "Path" and isinstance(value, str | Path) and str(value).strip():
        return Path(value).expanduser().absolute()
    if kind == "literal" and any(value == c and type(value) is type(c) for c in annotation.choices):
        return value
    if kind == "list" and isinstance(value, list | tuple):
        _check_depth(value, annotation, name)
        return [check_setting(item, annotation.items[0], f"{name}[{i}]") for i, item in enumerate(value)]
    if kind == "dict" and isinstance(value, Mapping):
        return {str(k): check_setting(v, annotation.items[0], f"{name}.{k}") for k, v in value.items()}
    hint = ""
    if kind == "literal" and isinstance(value, str):
        hint = closest(value, (str(choice) for choice in annotation.choices))
    if kind == "list" and isinstance(value, bool | int | float | str):
        hint = f"did you mean [{value}]?"
    raise InputError(f"{name} is {_shown(value)}", expected=str(annotation), hint=hint)


def _check_depth(value: Sequence[object], annotation: Annotation, name: str) -> None:
    """A list that would be right as the only one of a list of lists."""
    item = annotation.items[0]
    if item.kind != "list" or not value or any(isinstance(entry, list | tuple) for entry in value):
        return
    try:
        check_setting(value, item, name)
    except InputError:
        return
    raise InputError(f"{name} is {_shown(value)}", expected=str(annotation), hint=f"did you mean [{list(value)}]?")


def _check_union(value: Any, annotation: Annotation, name: str) -> Any:
    """The first alternative of the value's own type, or else the first that can take it."""
    deepest: InputError | None = None
    exact = [i for i in annotation.items if i.kind == type(value).__name__ or (value is None and i.kind == "None")]
    for item in [*exact, *annotation.items]:
        try:
            return check_setting(value, item, name)
        except InputError as error:
            if item.kind in {"list", "dict", "literal"} and isinstance(value, list | tuple | Mapping | str):
                deepest = error
    if deepest is not None and deepest.hint:
        raise InputError(deepest.what, expected=str(annotation), hint=deepest.hint)
    raise InputError(f"{name} is {_shown(value)}", expected=str(annotation))


def _shown(value: Any) -> str:
    if value is None:
        return "null"
    text = repr(value)
    return f"{text if len(text) < 60 else text[:57] + '...'} ({type(value).__name__})"
