"""What a result was made with: versions, git state, platform, date."""

from __future__ import annotations

import platform
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from icmj.base.version import VERSION

PACKAGES = ("mujoco", "numpy", "scipy", "control", "numba", "rerun-sdk")
DECISIVE = ("icmj", "mujoco", "numpy", "scipy", "numba", "pyarrow")
"""Those that decide the bits of results, and of their files."""
_PATIENCE = 60.0  # s on the clock for one word of git


def provenance(folder: Path) -> dict[str, str]:
    """Facts that let someone repeat a run; ``folder`` is where the run file lies, its git state is taken."""
    facts = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "icmj": VERSION} | versions(PACKAGES)
    facts["python"] = platform.python_version()
    facts["platform"] = f"{platform.system()} {platform.machine()}"
    facts["git"] = git_state(folder)
    return facts


def versions(packages: Iterable[str] = DECISIVE) -> dict[str, str]:
    """Version of each package, or ``not installed``."""
    return {package: _version(package) for package in packages}


def _version(package: str) -> str:
    """From the head of its metadata, most of which is a readme that Python would parse as a letter."""
    try:
        found = distribution(package)
    except PackageNotFoundError:
        return "not installed"
    head = (found.read_text("METADATA") or "").partition("\n\n")[0]
    stated = [line.partition(":")[2].strip() for line in head.splitlines() if line.startswith("Version:")]
    return stated[0] if stated else found.version


def git_state(folder: Path) -> str:
    """Commit of the checkout around ``folder``, with ``+changes`` if tracked files differ; or ``no checkout``.

    Where git does not answer in time, as on a slow disk, the state is unknown, and this says so. A folder that the
    checkout ignores is none of it: an environment there holds a package from elsewhere.
    """
    try:
        commit = _git(folder, "rev-parse", "HEAD")
        if _ignored(folder):
            return "no checkout"
        return commit + (" +changes" if _git(folder, "status", "--porcelain", "--untracked-files=no") else "")
    except subprocess.TimeoutExpired:
        return f"unknown: git did not answer within {_PATIENCE:g} s"
    except (OSError, subprocess.SubprocessError):
        return "no checkout"


def _ignored(folder: Path) -> bool:
    try:
        return bool(_git(folder, "check-ignore", "."))
    except subprocess.CalledProcessError:  # how it says no
        return False


def _git(folder: Path, *words: str) -> str:
    command = ["git", "-C", str(folder), *words]
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=_PATIENCE).stdout.strip()
