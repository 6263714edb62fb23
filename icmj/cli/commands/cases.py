"""``icmj cases``: what comes with icmj, by name, with title and one sentence each."""

from __future__ import annotations

import textwrap
from dataclasses import dataclass
from typing import TYPE_CHECKING

from icmj.cli.arguments import Command

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


LISTED = {
    "cases": "Cases of the study: icmj run NAME, icmj analyse NAME",
    "rivals": "Cases under other controllers: icmj run NAME",
    "joystick": "Plants that a person controls by a joystick, for experiments: icmj run NAME",
    "sweeps": "Sweeps: icmj sweep NAME",
    "experiments": "Experiments: icmj experiment NAME",
    "families": "Families of controllers: icmj fit RECORDING --model NAME",
}


@dataclass(frozen=True)
class CasesCommand(Command):
    """List the cases, rival controllers, sweeps, experiments and families that come with icmj.

    Example: icmj cases
    """

    group = "Begin"

    json: bool = False
    """Print JSON instead of a list."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """List what comes with icmj, by name, with title and one sentence each."""
        from icmj.work.shipped import describe_shipped

        found = describe_shipped()
        if self.json:
            keys = ("name", "title", "about", "file")
            out.show(
                {kind: [{key: str(getattr(one, key)) for key in keys} for one in ones] for kind, ones in found.items()}
            )
            return
        for kind, ones in found.items():
            out.say(LISTED.get(kind, kind), style="bold")
            for one in ones:
                _say_paragraph(out, f"{one.name}: {one.title}", "  ")
                _say_paragraph(out, one.about, "      ", style="dim")
            out.say("")


def _say_paragraph(out: Terminal, words: str, indent: str, style: str | None = None) -> None:
    """Print words wrapped to the terminal, at most 100 columns wide."""
    width = min(out.width, 100)
    for line in textwrap.wrap(words, width, initial_indent=indent, subsequent_indent=" " * 6, break_on_hyphens=False):
        out.say(line, style=style, wrap=False)


COMMAND = CasesCommand
