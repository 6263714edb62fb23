"""``{commands}``: the help of every command, as the program prints it."""

from __future__ import annotations

import os
import subprocess
import sys

from docutils import nodes
from docutils.statemachine import StringList
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

from icmj.cli.commands import COMMANDS


class Commands(SphinxDirective):
    """A section for each command of ``icmj``."""

    def run(self) -> list[nodes.Node]:
        holder = nodes.section()
        holder.document = self.state.document
        self.state.nested_parse(
            StringList(write_reference(), "commands"), self.content_offset, holder, match_titles=True
        )
        return holder.children


def write_reference() -> list[str]:
    """The lines of all sections."""
    lines: list[str] = []
    for name in COMMANDS.names:
        lines += [f"## icmj {name}", "", "```text", *_help(name), "```", ""]
    return lines


def _help(name: str) -> list[str]:
    plain = os.environ | {"COLUMNS": "96", "NO_COLOR": "1", "TERM": "dumb", "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(
        [sys.executable, "-m", "icmj.cli", name, "--help"], capture_output=True, text=True, check=True, env=plain
    )
    return [line.rstrip() for line in done.stdout.strip().splitlines()]


def setup(app: Sphinx) -> dict[str, bool]:
    """Offer the directive to Sphinx."""
    app.add_directive("commands", Commands)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
