"""What one file of code says, read from its syntax tree: signatures, imports, and a digest that ignores prose."""

from __future__ import annotations

import ast
import hashlib
import json
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from typing import Any

from pipeline.storage.keys import DIGEST_CHARACTERS

REQUIRED = "<required>"


@dataclass(frozen=True)
class Parameter:
    """One parameter as its signature writes it."""

    name: str
    annotation: str
    default: Any = REQUIRED
    keyword_only: bool = False

    @property
    def required(self) -> bool:
        """Whether a value has to be given."""
        return isinstance(self.default, str) and self.default == REQUIRED


@dataclass(frozen=True)
class Signature:
    """A public function or class of a module: its parameters (the constructor's, for a class) and its manual."""

    name: str
    doc: str
    parameters: tuple[Parameter, ...]
    returns: str = ""
    is_class: bool = False
    constants: dict[str, Any] = field(default_factory=dict)
    fault: str = ""
    decorated: bool = False
    tolerance: Any = None


TOLERANCE = "_tolerance_"
"""What precedes a stage's name in that of the dict that says by how much its fields may differ on another machine."""


@lru_cache(maxsize=4096)
def parse(module: str, text: bytes, *, is_package: bool) -> dict[str, Any]:
    """Code digest, imports, origins of names, and public signatures of a module, as plain values that nobody changes.

    Tolerances that only :mod:`pipeline.review.verification` looks at change no value, and are no part of the code.

    Raises
    ------
    SyntaxError, ValueError
        The text is no Python.
    """
    tree = ast.parse(text)
    imports, names = _imports(tree, module, is_package=is_package)
    signatures = [asdict(c) for c in _public_signatures(tree)]
    _strip_docstrings(tree)
    _strip_tolerances(tree)
    sha = hashlib.sha256()
    for piece in _canonical(tree):
        sha.update(piece.encode("utf-8", "surrogatepass"))
    return {
        "code_digest": sha.hexdigest()[:DIGEST_CHARACTERS],
        "imports": imports,
        "names": names,
        "signatures": signatures,
    }


def _canonical(node: object) -> Iterator[str]:
    """The tree as text, without positions and empty fields, which differ between versions of Python."""
    if isinstance(node, ast.AST):
        yield type(node).__name__ + "("
        for name in node._fields:
            value = getattr(node, name, None)
            if value is None and not isinstance(node, ast.Constant):
                continue
            if value == [] or name in {"type_comment", "kind", "ctx"}:
                continue
            yield name + "="
            yield from _canonical(value)
        yield ")"
    elif isinstance(node, list):
        yield "["
        for item in node:
            yield from _canonical(item)
            yield ","
        yield "]"
    else:
        yield f"{type(node).__name__}:{node!r};"


def _strip_docstrings(tree: ast.AST) -> None:
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            node.body = [s for s in node.body if not _is_prose(s)] or [ast.Pass()]


def _strip_tolerances(tree: ast.Module) -> None:
    """Leave out tolerances written as literals, unless something else in the module names them."""
    stated = {name for name, value in _stated_tolerances(tree).items() if _literal(value) is not None}
    uses = Counter(node.id for node in ast.walk(tree) if isinstance(node, ast.Name))
    alone = {name for name in stated if uses[name] == 1}
    tree.body = [s for s in tree.body if _assigned(s) not in alone]


def _stated_tolerances(tree: ast.Module) -> dict[str, ast.expr]:
    """What is assigned to ``_tolerance_<function>`` at the top of a module that has such a function."""
    functions = {TOLERANCE + s.name for s in tree.body if isinstance(s, ast.FunctionDef)}
    return {
        name: s.value
        for s in tree.body
        if isinstance(s, ast.Assign | ast.AnnAssign) and s.value and (name := _assigned(s)) in functions
    }


def _assigned(statement: ast.stmt) -> str:
    """The one name that a statement assigns to; empty where it is none."""
    if isinstance(statement, ast.Assign) and len(statement.targets) == 1:
        target = statement.targets[0]
    elif isinstance(statement, ast.AnnAssign):
        target = statement.target
    else:
        return ""
    return target.id if isinstance(target, ast.Name) else ""


def _literal(expression: ast.expr) -> Any:
    """The value of an expression made of literals that JSON can hold; None for any other."""
    try:
        value = ast.literal_eval(expression)
        json.dumps(value)
    except (ValueError, TypeError):
        return None
    return value


def _is_prose(statement: ast.stmt) -> bool:
    return (
        isinstance(statement, ast.Expr)
        and isinstance(statement.value, ast.Constant)
        and isinstance(statement.value.value, str)
    )


def _imports(tree: ast.AST, module: str, *, is_package: bool) -> tuple[list[str], dict[str, str]]:
    """Candidate module names that the tree imports, and where each imported name comes from."""
    package = module if is_package else module.rpartition(".")[0]
    found: set[str] = set()
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                parent = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*parent, *([node.module] if node.module else [])])
            found.add(base)
            for alias in node.names:
                found.add(f"{base}.{alias.name}")
                names[alias.asname or alias.name] = f"{base}.{alias.name}"
    return sorted(found), names


def _public_signatures(tree: ast.Module) -> Iterator[Signature]:
    stated = _stated_tolerances(tree)
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            parameters, fault = _parameters(node.args)
            returns = ast.unparse(node.returns) if node.returns else ""
            written = stated.get(TOLERANCE + node.name)
            literal = None if written is None else _literal(written)
            yield Signature(
                node.name,
                ast.get_docstring(node) or "",
                parameters,
                returns,
                fault=fault,
                tolerance=ast.unparse(written) if literal is None and written is not None else literal,
            )
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            yield _class(node)


def _class(node: ast.ClassDef) -> Signature:
    constants: dict[str, Any] = {}
    parameters: tuple[Parameter, ...] = ()
    fault = ""
    for item in node.body:
        if isinstance(item, ast.FunctionDef) and item.name == "__init__":
            args = item.args
            parameters, fault = _parameters(
                ast.arguments(
                    posonlyargs=[],
                    args=args.args[1:],
                    vararg=args.vararg,
                    kwonlyargs=args.kwonlyargs,
                    kw_defaults=args.kw_defaults,
                    kwarg=args.kwarg,
                    defaults=args.defaults,
                )
            )
        elif isinstance(item, ast.Assign | ast.AnnAssign) and isinstance(item.value, ast.Constant):
            targets = item.targets if isinstance(item, ast.Assign) else [item.target]
            if isinstance(item.value.value, str | int | float | None):
                constants |= {t.id: item.value.value for t in targets if isinstance(t, ast.Name)}
    return Signature(
        node.name,
        ast.get_docstring(node) or "",
        parameters,
        node.name,
        is_class=True,
        constants=constants,
        fault=fault,
        decorated=bool(node.decorator_list),
    )


def _parameters(args: ast.arguments) -> tuple[tuple[Parameter, ...], str]:
    """Parameters in order, and what keeps this signature from being a stage's, if anything."""
    fault = ""
    found = []
    if args.vararg or args.kwarg:
        fault = "takes *args or **kwargs, so its inputs and settings cannot be named"
    positional = args.posonlyargs + args.args
    defaults: list[ast.expr | None] = [None] * (len(positional) - len(args.defaults)) + list(args.defaults)
    pairs = [(arg, default, False) for arg, default in zip(positional, defaults, strict=True)]
    pairs += [(arg, default, True) for arg, default in zip(args.kwonlyargs, args.kw_defaults, strict=True)]
    for arg, default, keyword_only in pairs:
        value: Any = REQUIRED
        if default is not None:
            try:
                value = ast.literal_eval(default)
                json.dumps(value)
            except (ValueError, TypeError):
                value, fault = None, f"the default of '{arg.arg}' is not a literal"
        annotation = ast.unparse(arg.annotation) if arg.annotation else ""
        if not annotation:
            fault = f"'{arg.arg}' has no annotation"
        found.append(Parameter(arg.arg, annotation, value, keyword_only))
    return tuple(found), fault
