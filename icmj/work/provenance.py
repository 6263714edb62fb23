"""What a result was made with: versions of packages, the commit around the run file, platform and date."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from icmj.base import VERSION
from icmj.base.files import read_bytes
from icmj.errors import IcmjError

PACKAGES = ("mujoco", "numpy", "scipy", "control", "numba", "rerun-sdk")
DECISIVE = ("icmj", "mujoco", "numpy", "scipy", "numba", "pyarrow")
"""Those that decide the bits of results, and of their files."""
_ENVIRONMENTS = ("pyvenv.cfg", "conda-meta")  # by which a folder of installed packages is known
_LINKS = 6  # references that lead to a commit, one to the next
_LONGEST_WORD, _MOST_REFERENCES = 10_000, 100e6  # bytes of a file with one reference, and of one with all


def provenance(folder: Path) -> dict[str, str]:
    """Facts that let someone repeat a run; ``folder`` is where the run file lies."""
    facts = {"date": datetime.now(UTC).isoformat(timespec="seconds"), "icmj": VERSION} | versions(PACKAGES)
    facts["python"] = platform.python_version()
    facts["platform"] = f"{platform.system()} {platform.machine()}"
    facts["git"] = find_commit(folder)
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


def expect_minor(package: str, minor: str, error: type[IcmjError]) -> None:
    """See that the installed version of a package is of the minor version that icmj is tested with, such as ``4.0``.

    Raises:
        IcmjError: of the class ``error``, if it is another, or the package is missing.
    """
    found = _version(package)
    if found.split(".")[:2] != minor.split("."):
        raise error(f"icmj needs {package} {minor}, found {found}; pip install '{package}=={minor}.*'")


def find_commit(folder: Path) -> str:
    """The commit that is checked out around ``folder``; ``no checkout`` where there is none, ``unknown`` if unreadable.

    It is read from files. git itself is not run: it would run programs that a configuration beside somebody else's data
    names. Whether files differ from the commit is therefore not said; logs and descriptions hold texts and digests. An
    environment inside a checkout holds packages from elsewhere, and is none of it.
    """
    for place in (folder.resolve() / "any").parents:
        if any(os.path.lexists(place / name) for name in _ENVIRONMENTS):
            break
        if os.path.lexists(place / ".git"):
            try:
                return _read_commit(place / ".git")
            except (OSError, ValueError):  # damaged, without a commit, or with references in a database
                return "unknown"
    return "no checkout"


def _read_commit(git: Path) -> str:
    """See git's documentation of its repository layout: ``.git`` may be a file, and a worktree shares references."""
    if not git.is_dir():
        git = git.parent / _read_word(git).removeprefix("gitdir: ")
    common = git / _read_word(git / "commondir") if os.path.lexists(git / "commondir") else git
    found = _read_word(git / "HEAD")
    for _ in range(_LINKS):
        if re.fullmatch(r"[0-9a-f]{40}([0-9a-f]{24})?", found):
            return found
        name = found.removeprefix("ref: ")
        if not name.startswith("refs/") or ".." in name:
            break
        places = [place / name for place in (git, common) if (place / name).is_file()]
        found = _read_word(places[0]) if places else _find_packed(common / "packed-refs", name)
    raise ValueError(f"{git}: no commit")


def _find_packed(path: Path, name: str) -> str:
    lines = read_bytes(path, _MOST_REFERENCES).decode(errors="replace").splitlines()
    return next((line.partition(" ")[0] for line in lines if line.endswith(f" {name}")), "")


def _read_word(path: Path) -> str:
    return os.fsdecode(read_bytes(path, _LONGEST_WORD)).rstrip("\r\n")
