"""Provenance: versions that are installed, and a git state where there is a checkout."""

import re
import subprocess
from importlib.metadata import version

from icmj.work import folder as ours
from icmj.work.folder import git_state, provenance


def test_versions_are_those_installed(tmp_path):
    facts = provenance(tmp_path)
    assert facts["mujoco"] == version("mujoco")
    assert re.match(r"\d{4}-\d\d-\d\dT", facts["date"])


def test_git_state_is_the_commit_and_tells_changes(tmp_path):
    assert git_state(tmp_path) == "no checkout"

    def git(*words):
        identity = ["-c", "user.name=a", "-c", "user.email=a@example.org"]
        return subprocess.run(["git", "-C", tmp_path, *identity, *words], check=True, capture_output=True, text=True)

    git("init")
    (tmp_path / "a").write_text("1")
    git("add", "a")
    git("commit", "-m", "a")
    commit = git("rev-parse", "HEAD").stdout.strip()
    assert git_state(tmp_path) == commit
    (tmp_path / "a").write_text("2")
    assert git_state(tmp_path) == f"{commit} +changes"
    # an environment inside a checkout is none of it
    (tmp_path / ".gitignore").write_text("env/")
    (tmp_path / "env" / "runs").mkdir(parents=True)
    assert git_state(tmp_path / "env" / "runs") == "no checkout"


def test_a_git_that_does_not_answer_leaves_the_state_unknown(tmp_path, monkeypatch):
    """It was said to be no checkout, which a busy machine made of one."""
    monkeypatch.setattr(ours, "_GIT_PATIENCE", 1e-6)
    assert git_state(tmp_path) == "unknown: git did not answer within 1e-06 s"
