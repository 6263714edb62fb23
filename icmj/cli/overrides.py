"""A run file of which a command changes values for once."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import Command, Given

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.runfile.schema import RunFile


@dataclass(frozen=True, kw_only=True)
class Overrides(Command):
    """A command that takes a run file, and other values than those in it."""

    set: Annotated[tuple[str, ...], Given(repeated=True, metavar="KEY=VALUE")] = ()
    """Replace a value of the run file for this run, as in --set actual.gain=0.85. May be repeated."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""

    def load(self, path: Path) -> RunFile:
        """The run file, with the values that were given.

        Raises:
            RunFileError: if it or they are wrong.
        """
        from icmj.runfile.reading import load_run
        from icmj.runfile.schema import overridden

        return overridden(load_run(path, allow_code=self.allow_code), self.set)


def say_changes(run: RunFile, out: Terminal) -> None:
    """Say beneath the title of a case which of its values are not the file's."""
    if run.changes_in_words:
        out.say(run.changes_in_words)
