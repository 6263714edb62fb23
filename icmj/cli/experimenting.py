"""What ``icmj experiment`` does and shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.numbers import amount
from icmj.cli.arguments import Experiment
from icmj.cli.tables import Column, show_table
from icmj.cli.terminal import ERR, OUT, Terminal
from icmj.cli.working import Working
from icmj.errors import StudyError

if TYPE_CHECKING:
    from icmj.study.experiment import Experiment as Done


def experiment(command: Experiment) -> None:
    """Carry out an experiment, or analyse recordings as it says; what was finished stays, however it ends."""
    from icmj.runfile.experiment_tables import load_experiment
    from icmj.study.estimate import LONGEST
    from icmj.study.experiment import analyse_recordings, run_experiment
    from icmj.study.trials import FIGURE, PAGE, RESULTS, summary

    if command.jobs is not None and command.jobs < 1:
        raise StudyError(f"--jobs {command.jobs}: expected at least 1")
    file = load_experiment(command.experiment, allow_code=command.allow_code)
    name = file.experiment.name
    folder = command.out or Path("runs/out") / (f"{name}-recording" if command.recording else name)
    with Working(name, ERR) as working:
        if command.recording:
            done = analyse_recordings(file, command.recording, folder, rate=command.rate)
        else:
            longest = None if command.yes else LONGEST
            done = run_experiment(file, folder, jobs=command.jobs, progress=working.tell, longest=longest)
    if command.json:
        OUT.show({**summary(done), "folder": str(folder)})
        return
    _show(done, OUT)
    for what, path in (("results", RESULTS), ("figure", f"{FIGURE}.svg"), ("page", PAGE)):
        OUT.say(f"{what:<8} {folder / path}", wrap=False)


def _show(done: Done, out: Terminal) -> None:
    """One table, cases and plants as columns; then what was found, in words."""
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
        out.say(f"{told.case}, {plant_name(told.plant)}, {told.trials} trials: {told.words}")
