"""``icmj run``: one case simulated, beside its prediction."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.cli.arguments import FOLDER, POSITIONAL, RESULTS
from icmj.cli.overrides import Overrides
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.base.array import Array
    from icmj.case.result import Result
    from icmj.cli.terminal import Terminal
    from icmj.theory.prediction import Prediction


TOLD = 10.0  # s of estimated work that is announced


@dataclass(frozen=True)
class RunCommand(Overrides):
    """Simulate one case, write its log and compare the result with the prediction.

    The log contains this run alone. With --study it also contains what icmj study computes beside a prediction:
    continuous control, growth under clocks, and the amplitude law (MuJoCo) or other attractors (linear plant).

    Example: icmj run three-link-0.9 --plant mujoco --set actual.gain=0.85
    """

    group = "Simulate"

    run: Annotated[Path, POSITIONAL]
    """Run file, or name of a shipped case."""
    plant: Literal["linear", "mujoco"] | None = None
    """Plant to simulate (default: mujoco; linear if the run file gives matrices)."""
    out: Annotated[Path, FOLDER] = RESULTS
    """Folder for the log, which is named CASE.PLANT.rrd."""
    study: bool = False
    """Also compute what icmj study computes beside a prediction."""
    yes: bool = False
    """Run the case even if it is estimated to take longer than a minute."""
    json: bool = False
    """Print JSON instead of a table."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Simulate one case, write its log, and print the result beside the prediction if there is one."""
        from icmj.base.files import discard_if_failed
        from icmj.base.interruption import interrupt_once
        from icmj.base.numbers import format_duration, plain
        from icmj.base.process import import_in_background
        from icmj.case.case import prepare
        from icmj.cli.comparisons import plain_runs
        from icmj.cli.spread import find_spread, say_spread
        from icmj.study.estimate import LONGEST
        from icmj.study.study import admit, open_folder, plants_of, run_case

        run_file = self.load(self.run)
        name, plant = run_file.case.name, self.plant or plants_of(run_file)[-1]
        with Working(name, err) as working:
            case = prepare(run_file)
            seconds = admit(case, plant, None if self.yes else LONGEST, study=self.study)
            if seconds > TOLD:
                err.say(f"icmj: about {format_duration(seconds)} of work")
            log = self.out / f"{name}.{plant}.rrd"
            import_in_background("icmj.log.writer")
            with discard_if_failed(self.out), interrupt_once() as heard:
                open_folder(self.out, log.name)
                result = run_case(case, plant, lambda done: working.tell(name, done), study=self.study)
                working.tell("writing the log", 0.95)
                from icmj.log.writer import write_log  # by now it has been imported meanwhile

                with heard.postpone():
                    write_log(result, log)
        outcome = result.simulation.outcome
        if self.json:
            out.show(plain_runs([result], logs=(log,)) | {"outcome": plain({"kind": outcome.kind, "t": outcome.t})})
        else:
            spread = find_spread(case)
            _show_run(result, log, out, bool(self.set), "" if isinstance(spread, str) else say_spread(spread))
        if outcome.kind == "interrupted":
            raise KeyboardInterrupt


def _show_run(result: Result, log: Path, out: Terminal, changed: bool, spread: str = "") -> None:
    """What a run did, in a table and in words, beside the predicted spread of its intervals if there is one."""
    from icmj.base.numbers import amount, count
    from icmj.case.comparison import compare
    from icmj.cli.comparisons import show_comparisons
    from icmj.simulation.simulation import get_relative_error

    if (prediction := result.prediction) is not None:
        show_comparisons([compare(result)], out, changed=changed)
        out.say(f"The run {result.simulation.outcome.message}, with {count(len(result.simulation.events), 'event')}.")
        out.say(result.words)
        if spread:
            out.say(spread)
        out.say(_say_peaks(result, prediction))
    else:
        for notice in result.notices:
            out.note(notice)
        out.say(f"{result.words} {result.run.changes_in_words}".strip())
    for name, value in result.measures.items():
        out.say(f"{name}: {amount(value)}")
    for words in result.simulation.pressure.words if result.simulation.pressure else ():
        out.say(f"{words[0].upper()}{words[1:]}.")
    if (error := get_relative_error(result.simulation)) > 0:
        out.say(f"Relative error by the step: {error:.1g}.")
    out.say(f"log   {log}", wrap=False)
    out.say(f"show  icmj replay {log}", wrap=False)


def _say_peaks(result: Result, prediction: Prediction) -> str:
    """The largest values of the outputs, with those of the predicted cycle, if there is one, in brackets."""
    from icmj.base.numbers import amount
    from icmj.case.laid_orbit import beside
    from icmj.case.quantity import quantities

    def show(values: Array, i: int) -> str:
        unit = units[i].unit
        text = amount(units[i].factor * float(values[i]), "" if unit == "deg" else unit, 4)
        return f"{text}°" if unit == "deg" else text

    units, names = quantities(result.actual), result.actual.outputs
    found, prediction = result.motion.amplitude, beside(prediction, result.motion)
    cycle = prediction.amplitude if prediction.cycle else None
    peaks = [
        f"{name} {show(found, i)}" + ("" if cycle is None else f" ({show(cycle, i)})") for i, name in enumerate(names)
    ]
    return f"Peaks{'' if cycle is None else ', predicted ones in brackets'}: {', '.join(peaks)}."


COMMAND = RunCommand
