"""``icmj study``: cases simulated on both plants, with report and summary."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import FOLDER, POSITIONAL, PROCESSES, RESULTS
from icmj.cli.overrides import Overrides
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class StudyCommand(Overrides):
    """Simulate cases on the linear plant and in MuJoCo; write logs, report.html and summary.json.

    Example: icmj study --out runs/out
    """

    group = "Simulate"

    runs: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Run files, folders of run files, or names of shipped cases (default: the run files in the folder runs; if there
    are none, all shipped cases).
    """
    out: Annotated[Path, FOLDER] = RESULTS
    """Folder for the outputs."""
    jobs: Annotated[int | None, PROCESSES] = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also run cases that are estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Run the study with a progress bar; print the table and where the files are."""
        from icmj.cli.comparisons import plain_runs, show_page
        from icmj.study.estimate import LONGEST
        from icmj.study.run_files import find_runs
        from icmj.study.study import run_study

        runs = find_runs(self.runs, self.set, allow_code=self.allow_code)
        with Working("study", err) as working:
            longest = None if self.yes else LONGEST
            outputs = run_study(runs, self.out, jobs=self.jobs, progress=working.tell, longest=longest)
        if self.json:
            record = plain_runs(
                (*outputs.page.comparisons, *outputs.page.others), logs=outputs.logs, report=outputs.report
            )
            out.show(record | {"summary": str(outputs.summary)})
            return
        show_page(outputs.page, out, changed=bool(self.set))
        size = sum(log.stat().st_size for log in outputs.logs) / 1e6
        count = (
            f"{len(outputs.logs)} logs, {size:.0f} MB together," if len(outputs.logs) > 1 else f"1 log, {size:.0f} MB,"
        )
        out.say(f"{count} in {self.out}", wrap=False)
        out.say(f"report   {outputs.report}", wrap=False)
        out.say(f"summary  {outputs.summary}", wrap=False)


COMMAND = StudyCommand
