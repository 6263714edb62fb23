"""``icmj report``: the report page of logs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import PAGE, POSITIONAL, RESULTS, Command
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class ReportCommand(Command):
    """Build the comparison report from logs.

    Example: icmj report runs/out/simple-0.8.linear.rrd runs/out/simple-0.8.mujoco.rrd --out report.html
    """

    group = "Use the logs"

    logs: Annotated[tuple[Path, ...], POSITIONAL]
    """Logs, folders of logs or of sweeps, names of cases with logs in runs/out, or branches of cycles (Parquet). Logs
    of one case on both plants are shown together.
    """
    out: Annotated[Path | None, PAGE] = None
    """HTML page to write; its figures go into a folder beside it (default: report.html, in the folder of logs if one is
    given).
    """
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Build the report page from logs."""
        from icmj.base.files import expect_replaceable
        from icmj.cli.comparisons import plain_runs, show_page
        from icmj.cycle.branch import read_branches
        from icmj.log.selection import find_logs
        from icmj.study.page import report as build
        from icmj.work.workers import Workers, processors

        swept = [path for path in self.logs if (path / "sweep.json").exists()]
        others = [path for path in self.logs if path not in swept]
        home = others[0] if len(others) == 1 and others[0].is_dir() else Path()
        page_file = home / "report.html" if self.out is None else self.out
        expect_replaceable(page_file)
        with Working(label := "building the report", err) as working, Workers(processors()) as workers:
            sweeps = []
            if swept:
                from icmj.study.sweep_folder import read_sweep

                sweeps = [read_sweep(folder) for folder in swept]
            branches, logs = read_branches(find_logs(others, RESULTS))
            page = build(
                logs, page_file, sweeps=sweeps, branches=branches, workers=workers,
                progress=lambda done: working.tell(label, done),
            )  # fmt: skip
        if self.json:
            out.show(plain_runs((*page.comparisons, *page.others), report=page_file))
            return
        show_page(page, out)
        out.say(f"report  {page_file}", wrap=False)


COMMAND = ReportCommand
