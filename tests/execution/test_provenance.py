"""The commit of a checkout, as git itself tells it."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

from pipeline.execution.provenance import head

pytestmark = pytest.mark.skipif(shutil.which("git") is None, reason="there is no git here")


def git(folder: Path, *words: str) -> str:
    identity = ["-c", "user.name=A", "-c", "user.email=a@example.org"]
    return subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    folder = tmp_path / "checkout"
    folder.mkdir()
    git(folder, "init", "--quiet")
    git(folder, "commit", "--quiet", "--allow-empty", "--message", "First")
    return folder


def test_the_head_of_a_branch_loose_packed_and_detached(checkout: Path) -> None:
    expected = git(checkout, "rev-parse", "HEAD").strip()
    assert head(checkout) == expected
    git(checkout, "pack-refs", "--all", "--prune")
    assert head(checkout) == expected
    git(checkout, "checkout", "--quiet", "--detach")
    assert head(checkout) == expected


def test_the_head_of_a_linked_worktree(checkout: Path, tmp_path: Path) -> None:
    git(checkout, "worktree", "add", "--quiet", "-b", "other", str(tmp_path / "linked"))
    git(tmp_path / "linked", "commit", "--quiet", "--allow-empty", "--message", "Second")
    assert head(tmp_path / "linked") == git(tmp_path / "linked", "rev-parse", "HEAD").strip() != head(checkout)


def test_no_checkout_and_no_commit_have_no_head(tmp_path: Path) -> None:
    assert head(tmp_path) == ""
    git(tmp_path, "init", "--quiet")
    assert head(tmp_path) == ""
