"""docs/tutorial.md: every command on the page is run as it stands, in an empty folder, and shows what the page shows.

The environment that the page makes borrows what icmj needs from this one; ``pytest --from-nothing`` installs all of it.
"""

import os
import re
import shlex
import subprocess
import sys
import sysconfig
from ctypes.util import find_library
from itertools import pairwise
from pathlib import Path

import pytest

CHECKOUT = ("pyproject.toml", "README.md", "LICENSE", "icmj", "models", "runs", "sweeps")
ROUNDING = re.compile(r"[+-]\d\.\de-1\d")  # differs from machine to machine


def blocks(page: str) -> list[tuple[str, str]]:
    """Language and text of each block."""
    return re.findall(r"^```(\w+)\n(.*?)^```$", page, flags=re.S | re.M)


def words(text: str) -> str:
    """Without what depends on the width of the terminal, or on rounding."""
    return " ".join(re.sub(r"[─\s]+", " ", ROUNDING.sub("rounding", text)).split())


def renderer_is_there() -> bool:
    return find_library("vulkan") is not None and any(Path("/usr/share/vulkan/icd.d").glob("*.json"))


class Newcomer:
    """Somebody at a shell in a folder that looks like a checkout."""

    def __init__(self, folder: Path, root: Path, alone: bool):
        self.folder, self.alone = folder, alone
        for name in CHECKOUT:
            if (root / name).exists():
                (folder / name).symlink_to(root / name)
        hidden = ("PYTHONPATH", "PYTHONHOME", "VIRTUAL_ENV")
        self.environment = {key: value for key, value in os.environ.items() if key not in hidden}
        if not alone:
            self.environment |= {"PIP_NO_DEPS": "1", "PIP_NO_BUILD_ISOLATION": "0", "COLUMNS": "100"}

    def shell(self, text: str) -> str:
        """What a block of commands prints; the environment that it makes is active from then on."""
        shown = ""
        for line in text.strip().splitlines():
            if line.startswith(". "):
                self.environment["PATH"] = f"{self.folder / '.venv' / 'bin'}{os.pathsep}{self.environment['PATH']}"
                continue
            if "--screenshot" in line and not renderer_is_there():
                continue
            shown += self.run(["bash", "-c", line])
            if line.endswith("venv .venv") and not self.alone:
                there = next((self.folder / ".venv" / "lib").glob("python*/site-packages"))
                # before its own, which may have an older setuptools; editable installs of the lender are not lent
                lender = sysconfig.get_path("purelib")
                (there / "lent.pth").write_text(f"import sys; sys.path.insert(1, {lender!r})\n")
        return shown

    def python(self, text: str) -> str:
        return self.run(["python", "-c", text])

    def run(self, command: list[str]) -> str:
        done = subprocess.run(command, cwd=self.folder, env=self.environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{command}: {done.stderr}"
        return done.stdout


@pytest.mark.slow
def test_every_command_of_the_first_five_minutes(root, tmp_path, request):
    newcomer = Newcomer(tmp_path, root, request.config.getoption("--from-nothing"))
    newcomer.environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{newcomer.environment['PATH']}"
    shown, compared = "", 0
    for language, text in blocks((root / "docs" / "tutorial.md").read_text(encoding="utf-8")):
        if language == "text":
            for line in text.strip().splitlines():
                assert words(line) in words(shown), line
            compared += 1
        else:
            shown = {"sh": newcomer.shell, "python": newcomer.python}[language](text)
    assert compared >= 4
    assert Path(newcomer.run(["which", "icmj"]).strip()).parent == tmp_path / ".venv" / "bin"
    made = {path.relative_to(tmp_path).as_posix() for path in tmp_path.glob("*/*") if path.is_file()}
    assert {"first/report.html", "first/summary.json", "second/report.html", "second/three-link-0.9.mujoco.csv"} <= made
    if renderer_is_there():
        assert all((tmp_path / f"{name}.png").stat().st_size > 100_000 for name in ("first", "second"))


def test_the_page_has_commands_and_what_they_show(root):
    kinds = [language for language, _ in blocks((root / "docs" / "tutorial.md").read_text(encoding="utf-8"))]
    assert set(kinds) == {"sh", "python", "text"}
    assert kinds.count("sh") >= 5


def test_commands_of_the_questions_name_what_is_there(root):
    """They named files that a clone does not have; a file that one command writes serves the next."""
    from icmj.cli.parsing import parse

    page = (root / "docs" / "questions.md").read_text(encoding="utf-8")
    table = page.partition("## From question to command")[2].partition("## Answers")[0]
    commands = re.findall(r"^\|.*?`((?:icmj|python) [^`]*)`", table, flags=re.M)
    assert len(commands) >= 15
    written: set[str] = set()
    for command in map(shlex.split, commands):
        files = [word for word in command if re.search(r"\.(csv|py|toml|xml|html)$", word) and not word[:3].isupper()]
        if command[0] == "icmj":
            parse(command[1:])
            written |= {after for word, after in pairwise(command) if word in ("--out", "-o")}
        assert all((root / file).is_file() for file in files if file not in written), command


def test_links_of_readme_and_of_the_questions_lead_to_what_a_clone_has(root):
    """A page that only the site has, or one written for its generator alone, reads badly or not at all on a forge."""
    for page in (root / "README.md", root / "docs" / "questions.md"):
        links = re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)|href=\"([^\"#:]+)", page.read_text(encoding="utf-8"))
        paths = [page.parent / (one or other) for one, other in links]
        assert len(paths) > 10
        for path in paths:
            assert path.exists(), f"{page.name}: {path}"
            assert path != root / "docs" / "index.md"


def test_rounding_is_no_difference():
    assert words("a  +7.0e-14\n ──") == words("a -1.2e-13") != words("a +2.0e-04")
