"""Code digests: what counts as a change of code, and what is only prose."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.codebase.source import Sources
from pipeline.codebase.syntax import REQUIRED, parse

CODE = '''
"""Module."""
import math
from . import sibling
from .below import leaf as blade


def area(radius: float, *, factor: float = 2.0) -> float:
    """Area."""
    # how
    return math.pi * radius**2 * factor
'''


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "circles"
    (folder / "below").mkdir(parents=True)
    for path in (folder / "__init__.py", folder / "below" / "__init__.py"):
        path.touch()
    (folder / "round.py").write_text(CODE)
    (folder / "sibling.py").write_text("def f():\n    from circles.deep import g\n    return g()\n")
    (folder / "below" / "leaf.py").write_text("x = 1\n")
    (folder / "deep.py").write_text("def g():\n    return 1\n")
    (folder / "stranger.py").write_text("y = 1\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr("pipeline.codebase.source.declared", lambda group: ["circles"])
    return folder


def digest_of(package: Path) -> str:
    module = Sources().module("circles.round")
    assert module is not None
    return module.code_digest


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ('"""Area."""', '"""The area of a disc.\n\n    More.\n    """'),
        ("# how", "# why, at length"),
        ("    # how\n", ""),
        ("math.pi * radius**2 * factor", "(math.pi *\n            radius ** 2 * factor)"),
        ('"""Module."""', ""),
    ],
)
def test_prose_and_layout_do_not_count(package: Path, before: str, after: str) -> None:
    original = digest_of(package)
    (package / "round.py").write_text(CODE.replace(before, after))
    assert digest_of(package) == original


@pytest.mark.parametrize(
    ("before", "after"),
    [
        ("radius**2", "radius**3"),
        ("factor: float = 2.0", "factor: float = 2"),
        ("radius: float", "radius: int"),
        ("def area", "def areas"),
        ("* factor", ""),
        ("import math", "import cmath as math"),
    ],
)
def test_code_counts(package: Path, before: str, after: str) -> None:
    original = digest_of(package)
    (package / "round.py").write_text(CODE.replace(before, after))
    assert digest_of(package) != original


def test_the_golden_digest_of_code() -> None:
    parsed = parse("circles.round", CODE.encode(), is_package=False)
    assert parsed["code_digest"] == "c8b44b6cb6faf0668d667f2deab148f489eacf6c"


TOLERANCES = "_tolerance_area = {'radius': 1e-5}\n"


def test_a_stages_tolerance_does_not_count_and_is_read(package: Path) -> None:
    original = digest_of(package)
    for text in (TOLERANCES, TOLERANCES.replace("1e-5", "1e-3"), TOLERANCES.replace(" =", ": dict[str, float] =")):
        (package / "round.py").write_text(CODE + text)
        assert digest_of(package) == original
    module = Sources().module("circles.round")
    assert module is not None
    assert module.signatures["area"].tolerance == {"radius": 1e-5}


@pytest.mark.parametrize(
    "text",
    [
        TOLERANCES.replace("_area", "_volume"),
        TOLERANCES.replace("1e-5", "math.pi"),
        TOLERANCES + "print(_tolerance_area)\n",
        TOLERANCES + TOLERANCES,
        "if math.pi:\n    " + TOLERANCES,
    ],
)
def test_a_tolerance_that_could_change_a_value_counts(package: Path, text: str) -> None:
    original = digest_of(package)
    (package / "round.py").write_text(CODE + text)
    assert digest_of(package) != original


def test_data_beside_a_module_counts(package: Path) -> None:
    original = digest_of(package)
    (package / "round.eds").write_text("[1000]")
    assert digest_of(package) != original


def test_the_closure_follows_relative_absolute_and_inner_imports(package: Path) -> None:
    assert list(Sources().closure(["circles.round"])) == [
        "circles",
        "circles.below",
        "circles.below.leaf",
        "circles.deep",
        "circles.round",
        "circles.sibling",
    ]


def test_the_packages_above_a_module_belong_to_its_closure(package: Path) -> None:
    """Importing ``circles.below.leaf`` runs ``circles/__init__.py`` and ``circles/below/__init__.py`` too."""
    (package / "below" / "__init__.py").write_text("from circles import stranger\n")
    assert "circles.stranger" in Sources().closure(["circles.round"])


def test_what_was_parsed_is_remembered_and_never_stale(package: Path, tmp_path: Path) -> None:
    memory = tmp_path / "memory" / "sources.json"
    first = Sources(memory)
    modules = first.closure(["circles.round"])
    first.remember()
    assert {n: m.code_digest for n, m in Sources(memory).closure(["circles.round"]).items()} == {
        n: m.code_digest for n, m in modules.items()
    }
    (package / "deep.py").write_text("def g():\n    return 2\n")
    changed = Sources(memory).closure(["circles.round"])["circles.deep"]
    assert changed.code_digest != modules["circles.deep"].code_digest
    memory.write_text("{broken")
    assert Sources(memory).module("circles.round") == first.module("circles.round")


def test_signatures_are_read_without_importing(package: Path) -> None:
    (package / "round.py").write_text("raise RuntimeError\n" + CODE)
    module = Sources().module("circles.round")
    assert module is not None
    radius, factor = module.signatures["area"].parameters
    assert (radius.name, radius.annotation, radius.default, radius.keyword_only) == ("radius", "float", REQUIRED, False)
    assert (factor.name, factor.default, factor.keyword_only) == ("factor", 2.0, True)


@pytest.mark.parametrize(
    ("signature", "fault"),
    [
        ("a, *, b: int = 1", "'a' has no annotation"),
        ("*args: int", r"takes \*args"),
        ("*, b: float = math.pi", "default of 'b' is not a literal"),
    ],
)
def test_signatures_that_cannot_be_stages_say_why(package: Path, signature: str, fault: str) -> None:
    import re

    (package / "round.py").write_text(f"def f({signature}) -> int:\n    return 1\n")
    module = Sources().module("circles.round")
    assert module is not None
    assert re.search(fault, module.signatures["f"].fault)


def test_stages_do_not_depend_on_the_core() -> None:
    sources = Sources()
    everything = [m.name for p in sources.subpackages("pipeline.stages") for m in sources.modules_in(p)]
    theirs = {"data", "devices", "errors", "limits", "optics", "parallel", "progress", "stages", "steps"}
    assert everything
    assert {name.split(".")[1] for name in sources.closure(everything)} <= theirs
