"""``icmj schema``: the JSON Schema of a kind of file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.cli.arguments import ALSO, POSITIONAL, Command, Given

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class SchemaCommand(Command):
    """Print the JSON Schema of run, sweep, experiment or family files; editors use it to complete and check them.

    Example: icmj schema run --out run.schema.json
    """

    group = ALSO

    kind: Annotated[Literal["run", "sweep", "experiment", "family"], POSITIONAL] = "run"
    """Kind of file."""
    out: Annotated[Path | None, Given(writes=(".json",))] = None
    """File to write instead of printing."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Print the JSON Schema of a kind of file, or write it."""
        import json

        from icmj.base.files import expect_replaceable, write_text
        from icmj.study.file_kinds import json_schema

        record = json_schema(self.kind)
        if self.out is None:
            out.show(record)
            return
        expect_replaceable(self.out)
        write_text(self.out, json.dumps(record, indent=2) + "\n")
        out.say(f"schema   {self.out}", wrap=False)


COMMAND = SchemaCommand
