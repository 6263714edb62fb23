"""``icmj experiment``: a standard experiment on simulated cases, or on recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import FOLDER, POSITIONAL, PROCESSES, RESULTS, Command, Given
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import StudyError

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.study.experiment import Experiment as Done


@dataclass(frozen=True)
class ExperimentCommand(Command):
    """Carry out a standard experiment on simulated cases or on recordings; an interrupted one can be resumed.

    Example: icmj experiment intersection-point --out runs/out/intersection-point
    """

    group = "Simulate"

    experiment: Annotated[Path, POSITIONAL]
    """Experiment file, or name of a shipped experiment."""
    out: Annotated[Path | None, FOLDER] = None
    """Folder for trials, results and figure (default: runs/out/NAME, of recordings
    runs/out/NAME-RECORDING). The same command resumes an interrupted
    experiment.
    """
    jobs: Annotated[int | None, PROCESSES] = None
    """Number of processes (default: one per core)."""
    yes: bool = False
    """Also start trials that are estimated to take longer than a minute altogether."""
    recording: Annotated[tuple[Path, ...], Given(repeated=True, metavar="FILE")] = ()
    """Recording to analyse (CSV, Parquet, npz) instead of simulating the cases. Repeat the option for further
    trials of the same condition.
    """
    rate: float | None = None
    """Rate of a recording without times [Hz]."""
    since: float | None = None
    """Time from which each recording is analysed [s] (default: all of it, or what the experiment file says)."""
    until: float | None = None
    """Time up to which it is analysed [s]."""
    allow_code: bool = False
    """Run Python code that the experiment file or run files name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Carry out an experiment, or analyse recordings as it says; what was finished stays, however it ends."""
        from icmj.study.estimate import LONGEST
        from icmj.study.experiment import FIGURE, PAGE, analyse_recordings, run_experiment, summary
        from icmj.study.experiment import RESULTS as NUMBERS
        from icmj.study.experiment_file import load_experiment

        for option in ("rate", "since", "until"):
            if getattr(self, option) is not None and not self.recording:
                raise StudyError(f"--{option} is of recordings; give --recording, or leave it out")
        file = load_experiment(self.experiment, allow_code=self.allow_code)
        name = file.experiment.name
        whose = [f"-{self.recording[0].stem}"] if self.recording else []
        whose += [f"-and-{len(self.recording) - 1}-more"] if len(self.recording) > 1 else []
        folder = self.out or RESULTS / "".join([name, *whose])
        with Working(name, err) as working:
            if self.recording:
                done = analyse_recordings(
                    file, self.recording, folder, rate=self.rate, since=self.since, until=self.until
                )
            else:
                longest = None if self.yes else LONGEST
                done = run_experiment(file, folder, jobs=self.jobs, progress=working.tell, longest=longest)
        if self.json:
            out.show({**summary(done), "folder": str(folder)})
            return
        _show_experiment(done, out)
        for what, path in (("results", NUMBERS), ("figure", f"{FIGURE}.svg"), ("page", PAGE)):
            out.say(f"{what:<8} {folder / path}", wrap=False)


def _show_experiment(done: Done, out: Terminal) -> None:
    """One table, cases and plants as columns; then what was found, in words."""
    from icmj.base.numbers import amount, count
    from icmj.report.experiment import plant_name

    found = [told for told in done.found if told.finding is not None]
    names = list(dict.fromkeys(name for told in found if told.finding for name in told.finding.numbers))
    columns = (Column(""), *(Column(f"{told.case}, {plant_name(told.plant)}", "right") for told in found))
    rows = [
        (name, *(amount((told.finding.numbers if told.finding else {}).get(name), figures=4) for told in found))
        for name in names
    ]
    if rows:
        show_table(columns, rows, out, title=done.file.experiment.title or done.file.experiment.name)
    for told in done.found:
        out.say(f"{told.case}, {plant_name(told.plant)}, {count(told.trials, 'trial')}: {told.words}")
    for note in done.notes:
        out.note(note)


COMMAND = ExperimentCommand
