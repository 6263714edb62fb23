"""``icmj identify``: the model error that explains a measured motion."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, get_args

from icmj.cli.arguments import POSITIONAL, RESULTS
from icmj.cli.overrides import Overrides
from icmj.cli.progress import Working
from icmj.errors import IdentificationError

if TYPE_CHECKING:
    from icmj.case.case import PlantKind
    from icmj.cli.terminal import Terminal
    from icmj.identification.identification import Identification
    from icmj.identification.observed import Observed
    from icmj.identification.unknown import Unknown
    from icmj.runfile.schema import RunFile


@dataclass(frozen=True)
class IdentifyCommand(Overrides):
    """Estimate a model error and its uncertainty from a measured motion, or say that the motion does not determine it.

    The motion is a log; or, with --run, a file of event times, one per line, or of sampled outputs with their times.

    Example: icmj identify runs/out/three-link-0.9.mujoco.rrd
    """

    group = "Use the logs"

    motions: Annotated[tuple[Path, ...], POSITIONAL]
    """Logs, folders of logs, names of cases with logs in runs/out, or files of event times or outputs."""
    run: Path | None = None
    """Run file that describes plant and controller (default: that of the log). Its value of the unknown is ignored."""
    unknown: str = "actual.gain"
    """Unknown parameter: a key of the run file, or a change and its target, such as "mass trunk" (its factor)."""
    low: float = 0.5
    """Lower end of the search."""
    high: float = 1.5
    """Upper end of the search."""
    timing: float | None = None
    """Standard deviation of timing errors [s] (default: that of rounding to the sampling interval)."""
    reading: float | None = None
    """Standard deviation of the measurement errors of outputs [rad, or the unit of the plant] (default: a hundredth of
    the size of the outputs).
    """
    plant: Literal["linear", "mujoco"] | None = None
    """Plant that made the motion (default: that of the log; mujoco for other files)."""
    json: bool = False
    """Print JSON instead of sentences."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Say of each motion which value of the unknown made it."""
        from icmj.identification.identification import identify
        from icmj.log.selection import find_logs

        if not self.motions:
            raise IdentificationError("no motion given: expected logs, or files of event times or outputs")
        found, motions = [], find_logs(self.motions, RESULTS)
        with Working("identifying", err) as working:
            for i, path in enumerate(motions):
                working.tell(f"identifying from {path.name}", i / len(motions))
                unknown, observed, plant = _read_motion(self, path)
                observed = observed.with_errors(self.timing, self.reading)
                result = identify(unknown, observed, plant=plant)
                found.append((path, result))
        if self.json:
            out.show([_plain(path, result) for path, result in found])
            return
        for path, result in found:
            name = f"{path.name}: " if len(found) > 1 else ""
            out.say(f"{name}{result.words}", wrap=False)


def _read_motion(command: IdentifyCommand, path: Path) -> tuple[Unknown, Observed, PlantKind]:
    """The known run file, the observed motion, and its plant."""
    from icmj.identification.observed import Observed, read_observed
    from icmj.log.reader import read_log
    from icmj.runfile.schema import overridden

    given = None if command.run is None else command.load(command.run)
    if path.suffix == ".rrd":
        result = read_log(path)
        run = given or overridden(result.run, command.set)
        plant = command.plant or result.simulation.plant
        return _make_unknown(command, run), Observed.of_simulation(result.simulation), plant
    if given is None:
        raise IdentificationError(f"{path}: no log, so --run must say what is known of plant and controller")
    unknown = _make_unknown(command, given)
    outputs = unknown.checked().assumed.linearisation.plant.outputs
    return unknown, read_observed(path, tuple(outputs)), command.plant or "mujoco"


def _make_unknown(command: IdentifyCommand, run: RunFile) -> Unknown:
    from icmj.errors import ModelError
    from icmj.identification.unknown import Unknown
    from icmj.plant.body import Change, What

    what, _, of = command.unknown.partition(" ")
    if not of and what not in get_args(What):
        return Unknown(run, what, low=command.low, high=command.high)
    try:
        change = Change(what, of.strip() or None, 1.0)  # type: ignore[arg-type]
    except ModelError as error:
        raise IdentificationError(f"--unknown {command.unknown}: {error}") from error
    return Unknown(run, "", change, command.low, command.high)


def _plain(path: Path, result: Identification) -> dict[str, object]:
    from icmj.base.numbers import pick

    told = pick(result, "value", "intervals", "way", "probability", "edge", "words")
    return {"motion": str(path), "unknown": result.name, **told}


COMMAND = IdentifyCommand
