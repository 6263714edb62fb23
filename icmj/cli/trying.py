"""What ``icmj run`` does under a controller that is not intermittent."""

from __future__ import annotations

from typing import TYPE_CHECKING

from icmj.base.imports import meanwhile
from icmj.base.signals import heard_once
from icmj.cli.working import Working

if TYPE_CHECKING:
    from icmj.cli.arguments import Run
    from icmj.cli.terminal import Terminal
    from icmj.runfile.schema import RunFile

TOLD = 10.0  # s of estimated work that is announced


def carry_out(command: Run, run: RunFile, out: Terminal, err: Terminal) -> None:
    """Simulate the run, write its log and say what it did."""
    from icmj.case.trial import prepare_trial
    from icmj.study.estimate import LONGEST, in_words, refuse_long
    from icmj.study.study import open_folder, plants_of
    from icmj.study.trial import estimate_trial, startable_trial, try_law

    plant = command.plant or plants_of(run)[-1]
    with Working(run.case.name, err) as working:
        trial = prepare_trial(run)
        startable_trial(trial, plant)
        seconds = estimate_trial(trial, plant)
        refuse_long(trial, plant, seconds, None if command.yes else LONGEST)
        if seconds > TOLD:
            err.say(f"icmj: about {in_words(seconds)} of work")
        log = command.out / f"{run.case.name}.{plant}.rrd"
        open_folder(command.out, log.name)
        meanwhile("icmj.log.writer")
        with heard_once() as heard:
            result = try_law(trial, plant, lambda done: working.tell(run.case.name, done))
            working.tell("writing the log", 0.95)
            from icmj.log.writer import write_log  # by now it has been imported meanwhile

            with heard.postponed():
                write_log(result, log)
    for notice in result.notices:
        out.say(f"note: {notice}", style="yellow")
    out.say(result.words)
    for name, value in result.measures.items():
        out.say(f"{name}: {value:.6g}")
    out.say(f"log  {log}")
    if result.simulation.outcome.kind == "interrupted":
        raise KeyboardInterrupt
