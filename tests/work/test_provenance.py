"""Provenance: versions that are installed, and the commit where there is a checkout."""

import os
import re
import shutil
import subprocess
from importlib.metadata import version
from pathlib import Path

import pytest

from icmj.work.provenance import find_commit, provenance

IDENTITY = ("-c", "user.name=a", "-c", "user.email=a@example.org", "-c", "protocol.file.allow=always")
git_is_here = pytest.mark.skipif(shutil.which("git") is None, reason="no git here")


def test_versions_are_those_installed(tmp_path):
    facts = provenance(tmp_path)
    assert facts["mujoco"] == version("mujoco")
    assert re.match(r"\d{4}-\d\d-\d\dT", facts["date"])
    assert facts["git"] == "no checkout"


def git(folder: Path, *words: str) -> str:
    command = ["git", "-C", str(folder), *IDENTITY, *words]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()


def checkout(folder: Path, *options: str) -> Path:
    """A checkout with two commits, a branch and a tag, and a folder within."""
    (folder / "within").mkdir(parents=True)
    git(folder, "init", "-b", "main", *options)
    for content in "12":
        (folder / "within" / "a").write_text(content)
        git(folder, "add", ".")
        git(folder, "commit", "-m", content)
    git(folder, "tag", "first", "HEAD~1")
    return folder


# what git is told to do in ``place``, and where the commit is asked for
KINDS: dict[str, tuple[str, ...]] = {
    "a branch": ("place",),
    "a branch with slashes": ("checkout -b a/b/c", "place"),
    "packed references": ("pack-refs --all", "place"),
    "a packed branch that went on": ("pack-refs --all", "commit --allow-empty -m 3", "place"),
    "a detached head": ("checkout first", "place"),
    "a reference to a reference": (
        "symbolic-ref refs/heads/other refs/heads/main", "symbolic-ref HEAD refs/heads/other", "place"
    ),
    "a worktree": ("worktree add -b b ../tree first", "tree"),
    "a worktree of a packed branch": ("worktree add -b b ../tree first", "pack-refs --all", "tree"),
    "a repository elsewhere": ("init --separate-git-dir ../store", "place"),
    "a submodule": ("init ../whole", "-C ../whole submodule add ../place part", "whole/part"),
}  # fmt: skip


@git_is_here
@pytest.mark.parametrize("kind", KINDS)
def test_the_commit_is_the_one_that_git_says(kind, tmp_path):
    checkout(tmp_path / "place")
    *commands, place = KINDS[kind]
    for command in commands:
        git(tmp_path / "place", *command.split())
    commit = git(tmp_path / place, "rev-parse", "HEAD")
    assert re.fullmatch("[0-9a-f]{40}", commit)
    assert find_commit(tmp_path / place) == find_commit(tmp_path / place / "within") == commit


@git_is_here
def test_the_commit_of_longer_digests_is_read_too(tmp_path):
    try:
        place = checkout(tmp_path / "place", "--object-format=sha256")
    except subprocess.CalledProcessError:
        pytest.skip("a git that has no such format")
    assert find_commit(place) == git(place, "rev-parse", "HEAD")


def test_an_environment_inside_a_checkout_is_none_of_it(tmp_path):
    (tmp_path / ".git").mkdir()
    (tmp_path / ".git" / "HEAD").write_text("a" * 40)
    runs = tmp_path / "env" / "lib" / "runs"
    runs.mkdir(parents=True)
    assert find_commit(runs) == "a" * 40
    (tmp_path / "env" / "pyvenv.cfg").touch()
    assert find_commit(runs) == "no checkout"


@pytest.mark.parametrize("head", [
    "", "ref: ", "ref: refs/heads/main", "ref: refs/heads/.invalid", "ref: refs/../../secret", "ref: refs/heads/round",
    "ref: /etc/passwd", "a" * 39, "a" * 41, "A" * 40, "a" * 100_000, "ref: refs/\udcff\0", None, "pipe", "folder",
])  # fmt: skip
def test_what_holds_no_commit_is_unknown(head, tmp_path):
    """Nothing is waited for, and nothing of another file is said."""
    (tmp_path / "secret").write_text("b" * 40)
    path = tmp_path / ".git" / "HEAD"
    (path.parent / "refs" / "heads").mkdir(parents=True)
    (path.parent / "refs" / "heads" / "round").write_text("ref: refs/heads/round\n")
    if head == "pipe":
        if not hasattr(os, "mkfifo"):
            pytest.skip("no pipes here")
        os.mkfifo(path)
    elif head == "folder":
        path.mkdir()
    elif head is not None:
        path.write_text(head + "\n", errors="surrogateescape")
    assert find_commit(tmp_path) == "unknown"
