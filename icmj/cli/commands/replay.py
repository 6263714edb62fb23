"""``icmj replay``: logs in the viewer, or a picture of one."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import POSITIONAL, RESULTS, Command, Given
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class ReplayCommand(Command):
    """Open a log in the rerun viewer, serve it to a browser on this machine, or render a picture of it.

    Example: icmj replay runs/out/three-link-0.9.mujoco.rrd --screenshot pose.png --time 20
    """

    group = "Use the logs"

    log: Annotated[Path, POSITIONAL]
    """Log to show, folder of logs, or name of a case with logs in runs/out; a picture is of one log, of a case that in
    MuJoCo. A truncated log is shown as far as it can be read.
    """
    web: bool = False
    """Serve the log to a browser on this machine (loopback address only), and print the address."""
    screenshot: Annotated[Path | None, Given(writes=(".png",))] = None
    """PNG file to render; no screen is needed."""
    time: float | None = None
    """Time of the screenshot [s]."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Open or serve logs, or picture one."""
        from icmj.log.replay import replay as show
        from icmj.log.selection import find_log, find_logs

        logs = [find_log(self.log, RESULTS)] if self.screenshot else find_logs([self.log], RESULTS)
        with Working(f"rendering {self.screenshot}", err) if self.screenshot else nullcontext():
            show(*logs, web=self.web, screenshot=self.screenshot, time=self.time, say=err.say)


COMMAND = ReplayCommand
