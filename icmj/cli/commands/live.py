"""``icmj live``: a page that simulates a case in a browser."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import POSITIONAL, Given
from icmj.cli.overrides import Overrides
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class LiveCommand(Overrides):
    """Write a page that simulates one case live in a browser, with sliders for b, threshold, delay and noise.

    The page is one file that needs no network and no installation. Its sliders start at the values of the run file.

    Example: icmj live three-link-0.9 -o live.html
    """

    group = "Simulate"

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    out: Annotated[Path, Given(short="-o", writes=(".html",))] = Path("live.html")
    """HTML page to write."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Write the page of one case."""
        from icmj.base.files import expect_replaceable
        from icmj.case.case import prepare
        from icmj.report.live import build_live

        expect_replaceable(self.out)
        run = self.load(self.run)
        with Working(label := f"predicting {run.case.name}", err) as working:
            build_live(prepare(run), self.out, progress=lambda done: working.tell(label, done))
        out.say(f"page  {self.out}", wrap=False)


COMMAND = LiveCommand
