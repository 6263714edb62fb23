"""What ``icmj identify`` does and shows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, get_args

from icmj.cli.working import Working
from icmj.errors import IdentificationError

if TYPE_CHECKING:
    from icmj.case.case import PlantKind
    from icmj.cli.arguments import Identify
    from icmj.cli.terminal import Terminal
    from icmj.identification.identification import Identification
    from icmj.identification.observed import Observed
    from icmj.identification.unknown import Unknown
    from icmj.runfile.schema import RunFile


def carry_out(command: Identify, out: Terminal, err: Terminal) -> None:
    """Say of each motion which value of the unknown made it."""
    from icmj.identification.identification import identify

    if not command.motions:
        raise IdentificationError("no motion given: expected logs, or files of event times or outputs")
    found = []
    with Working("identifying", err) as working:
        for i, path in enumerate(command.motions):
            working.tell(f"identifying from {path.name}", i / len(command.motions))
            unknown, observed, plant = _read(command, path)
            observed = observed.with_errors(command.timing, command.reading)
            result = identify(unknown, observed, plant=plant)
            found.append((path, result))
    if command.json:
        out.show([_record(path, result) for path, result in found])
        return
    for path, result in found:
        name = f"{path.name}: " if len(found) > 1 else ""
        out.say(f"{name}{result.words}", wrap=False)


def _read(command: Identify, path: Path) -> tuple[Unknown, Observed, PlantKind]:
    """The known run file, the observed motion, and its plant."""
    from icmj.identification.observed import Observed, read_observed
    from icmj.log import read_log
    from icmj.runfile.overrides import overridden
    from icmj.runfile.reading import load_run

    given = (
        None if command.run is None else overridden(load_run(command.run, allow_code=command.allow_code), command.set)
    )
    if path.suffix == ".rrd":
        result = read_log(path)
        run = given or overridden(result.run, command.set)
        plant = command.plant or result.simulation.plant
        return _unknown(command, run), Observed.of_simulation(result.simulation), plant
    if given is None:
        raise IdentificationError(f"{path}: no log, so --run must say what is known of plant and controller")
    unknown = _unknown(command, given)
    outputs = unknown.checked().assumed.linearisation.plant.outputs
    return unknown, read_observed(path, tuple(outputs)), command.plant or "mujoco"


def _unknown(command: Identify, run: RunFile) -> Unknown:
    from icmj.errors import ModelError
    from icmj.identification.unknown import Unknown
    from icmj.plant.change import Change, What

    what, _, of = command.unknown.partition(" ")
    if not of and what not in get_args(What):
        return Unknown(run, what, low=command.low, high=command.high)
    try:
        change = Change(what, of.strip() or None, 1.0)  # type: ignore[arg-type]
    except ModelError as error:
        raise IdentificationError(f"--unknown {command.unknown}: {error}") from error
    return Unknown(run, "", change, command.low, command.high)


def _record(path: Path, result: Identification) -> dict[str, object]:
    return {
        "motion": str(path),
        "unknown": result.name,
        "value": result.value,
        "intervals": result.intervals,
        "way": result.way,
        "probability": result.probability,
        "edge": result.edge,
        "words": result.words,
    }
