"""What commands print: tables for people, records for programs.

What commands print with ``--json``.

The table of predicted and measured intervals, followed by notes on the runs.

How a linear plant is shown on a terminal: whole where it is small, in outline where it is large; and saved.

The table and the record that ``icmj measure`` prints.

What ``icmj cycle`` and ``icmj continue`` say of a switched delayed feedback on the linear plant: exact cycles.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.box import SIMPLE_HEAD
from rich.table import Table

from icmj.base.array import Array
from icmj.base.files import write_bytes
from icmj.base.numbers import MISSING, amount, amounts, collect_facts, number, pairs, plain, relative
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import ERR, OUT
from icmj.errors import IcmjError, ModelError, prefix_errors

if TYPE_CHECKING:
    from collections.abc import Iterable

    from icmj.case.case import Case
    from icmj.case.comparison import Comparison
    from icmj.case.result import Result
    from icmj.cli.arguments import ContinueCommand
    from icmj.cli.terminal import Terminal
    from icmj.controller.switching import SwitchingPD
    from icmj.cycle.switched import SwitchedCycle
    from icmj.engine.linearisation import Linearisation
    from icmj.measurement.sway import Measured, Sway
    from icmj.plant.linear_plant import LinearPlant
    from icmj.plant.quality import Notice, Quality
    from icmj.runfile.schema import RunFile
    from icmj.theory.prediction import Prediction
    from icmj.theory.spread import Spread

KINDS = {
    "homoclinic": "homoclinic: the last open-loop intervals grow, each longer than the one before, and the motion "
    "settles on no cycle.",
    "growth": "growth: the motion grows until the body falls, or to the end of the run.",
}
MODES = ("neutral", "uncontrollable", "unobservable")


def plain_runs(runs: Iterable[Comparison | Result], **files: Path | Iterable[Path]) -> dict[str, Any]:
    """What ``--json`` prints of runs: each as in ``summary.json``; and the files written."""
    from icmj.case.comparison import Comparison, to_json, to_record

    written = {
        kind: str(file) if isinstance(file, Path) else [str(one) for one in file] for kind, file in files.items()
    }
    records = [to_json(run) if isinstance(run, Comparison) else to_record(run) for run in runs]
    return {"runs": records, **written}


def say_changes(run: RunFile, out: Terminal) -> None:
    """Say beneath the title of a case which of its values are not the file's."""
    if run.changes_in_words:
        out.say(run.changes_in_words)


def plain_prediction(prediction: Prediction, outputs: tuple[str, ...], notices: Iterable[Notice]) -> dict[str, Any]:
    """What ``icmj analyse --json`` prints: the prediction and the notices about its plants."""
    from icmj.case.comparison import finite
    from icmj.theory.prediction import PREDICTION

    return plain(
        {
            "notices": list(notices),
            **collect_facts(PREDICTION, prediction, "record"),
            "outputs": outputs,
            "missing": prediction.missing or None,
            "multipliers": prediction.multipliers,
            "crossings": [
                {
                    "delta": c.delta,
                    "eigenvalue": c.eigenvalue,
                    "kind": c.kind,
                    "direction": c.direction,
                    "largest_other": c.largest_other,
                    "multiplicity": c.multiplicity,
                }
                for c in prediction.crossings
            ],
            "orbits": [
                {
                    "delta": one.orbit.delta,
                    "eigenvalue": one.crossing.eigenvalue,
                    "direction": one.crossing.direction,
                    "period": one.orbit.period,
                    "gamma": finite(one.orbit.gamma),
                    "amplitude": one.orbit.y_peak if one.family is None else None,
                    "multipliers": one.multipliers,
                    "verdict": one.verdict,
                    "reason": one.orbit.reason or None,
                    "family": None if one.family is None else one.family.words,
                }
                for one in prediction.orbits
            ],
            "delta_max": prediction.delta_max,
            "unresolved": prediction.unresolved,
            "beyond": None if prediction.beyond is None else prediction.beyond.delta,
            "neutral": prediction.neutral,
            "family": None if prediction.family is None else prediction.family.words,
            "continuous_stable": {
                "state_feedback": prediction.state_feedback_stable,
                "observer_feedback": prediction.observer_feedback_stable,
            },
        }
    )


def standing_in_words(prediction: Prediction) -> str:
    """Whether the body stands by the linear theory, and how far it then sways; in one sentence."""
    if prediction.cycle and not prediction.observer_feedback_stable:
        return "By the linear theory a cycle attracts what starts near it; icmj run shows where other motions go."
    if prediction.cycle:
        peaks = amounts(prediction.amplitude, prediction.outputs, prediction.output_units)
        size = "" if prediction.amplitude is None else f", with peaks of {peaks}"
        return f"By the linear theory it stands, and sways on a cycle{size}; icmj run shows the motion."
    if not prediction.observer_feedback_stable:
        return "Even continuous feedback of this design would not hold it; icmj run shows whether it falls."
    return "No cycle is predicted; icmj run shows whether it stands."


def spread_of(case: Case) -> Spread | str:
    """How the intervals vary under the noise of the run file, or why that is not predicted; "" without noise."""
    if case.prediction is None or not case.settings.noisy:
        return ""
    try:
        return case.spread()
    except IcmjError as error:
        return str(error)


def spread_in_words(spread: Spread | str) -> str:
    """The same as a sentence."""
    words = spread if isinstance(spread, str) else spread.words
    return words and f"{words[0].upper()}{words[1:]}."


def plain_spread(spread: Spread | str) -> dict[str, Any]:
    """The same as ``icmj analyse --json`` prints it: numbers or ``null``, and the reason; nothing without noise."""
    if isinstance(spread, str):
        return {"spread": None, "no_spread": spread} if spread else {}
    names = ("deviation", "correlation", "shift", "epsilon")
    return {"spread": plain({name: getattr(spread, name) for name in names})}


def plain_linearisation(linearisation: Linearisation, quality: Quality, told: Iterable[Notice]) -> dict[str, Any]:
    """What ``icmj linearise --json`` prints; ``told`` is what was chosen where nothing was named."""
    plant = linearisation.plant
    return plain(
        {
            "A": plant.A,
            "B": plant.B,
            "C": plant.C,
            "B_d": plant.B_d,
            "poles": plant.poles,
            "states": plant.states,
            "inputs": plant.inputs,
            "outputs": plant.outputs,
            "units": {"states": plant.state_units, "inputs": plant.input_units, "outputs": plant.output_units},
            "residual": linearisation.residual,
            "quality": {
                "residual": quality.residual,
                "errors": dict(zip("ABC", quality.errors, strict=True)),
                "kinks": quality.kinks,
                "margins": quality.margins,
                "room": quality.room,
                "feedthrough": quality.feedthrough,
                "excesses": quality.excesses,
                "dead": quality.dead,
                **{kind: getattr(quality, kind) for kind in MODES},
            },
            "notices": (*told, *quality.notices),
        }
    )


COLUMNS = (
    Column("case"),
    Column("plant"),
    Column("Δ_crit", "right"),
    Column("measured", "right"),
    Column("error", "right"),
    Column("peak error", "right", 2),
    Column("cycle", "center", 1),
)


def show_comparisons(comparisons: Sequence[Comparison], out: Terminal, *, changed: bool = False) -> None:
    """The table (cycle: settled on the predicted one), and beneath it the verdict of every run that did not.

    Args:
        comparisons: a row for each.
        out: where they are printed.
        changed: whether --set changed the run files, so that nobody needs to be told that the paper has other values.
    """
    rows = [
        (
            c.case,
            c.plant,
            _critical(c),
            number(c.measured.interval, 6) if c.measured.kind == "cycle" else c.measured.kind,
            relative(c.relative_error.interval if c.measured.converged else None),
            relative(c.relative_error.largest_amplitude if c.measured.converged else None),
            "yes" if c.measured.converged else "no",
        )
        for c in comparisons
    ]
    brackets = "; in brackets: no cycle is predicted" * any(row[2].startswith("(") for row in rows)
    show_table(COLUMNS, rows, out, title=f"Predicted and measured open-loop interval, in seconds{brackets}", keys=2)
    for kind, words in KINDS.items():
        if any(row[3] == kind for row in rows):
            out.say(words)
    for case, changes in {c.case: c.changes for c in comparisons if c.changes}.items():
        out.say(f"{case}: {changes[:1].lower()}{changes[1:]}")
    for notice in collect_notes(comparisons):
        if not (changed and ": paper: " in notice):
            out.note(notice)
    for c in comparisons:
        if not c.measured.converged:
            out.say(f"{c.case} ({c.plant}): {c.words}")


def _critical(c: Comparison) -> str:
    """Δ_crit, in brackets where no cycle is predicted."""
    text = number(c.predicted.delta_crit, 6)
    return text if c.predicted.cycle or c.predicted.delta_crit is None else f"({text})"


def collect_notes(comparisons: Sequence[Comparison]) -> Iterator[str]:
    """Notes on the runs without repetition: a note that all runs of a case share is printed once for the case."""
    runs = {c.case: [other for other in comparisons if other.case == c.case] for c in comparisons}
    for case, same in runs.items():
        for notice in dict.fromkeys(notice for c in same for notice in c.notices):
            having = [c.plant for c in same if notice in c.notices]
            yield f"{case}: {notice}" if len(having) == len(same) > 1 else f"{case} ({having[0]}): {notice}"


FEW = 8  # states whose matrices are shown without being asked for
POLES = tuple(map(Column, ("pole (rad/s)", "damping", "time constant (s)", "frequency (Hz)")))
GAP = 3  # columns of the terminal between two of a table


def show_plant(plant: LinearPlant, out: Terminal, *, full: bool = False) -> None:
    """Matrices and poles; of a plant with more than :data:`FEW` states an outline, unless ``full``."""
    if full or plant.n <= FEW:
        for name, matrix, rows, columns in _matrices(plant):
            _show_matrix(name, matrix, rows, columns, out)
    else:
        _show_outline(plant, out)
    _show_poles(plant, out)
    if not full and plant.n > FEW:
        out.say("--full prints the matrices, --out FILE.npz saves them.", style="dim")


def save_plant(plant: LinearPlant, path: Path) -> None:
    """A, B, C, B_d, poles, names and units as arrays for ``numpy.load``.

    Raises:
        ModelError: if the file cannot be written, or is not called ``.npz``.
    """
    if path.suffix != ".npz":
        raise ModelError(f"{path}: the matrices are saved as .npz; call it {path.with_suffix('.npz').name}")
    names = {kind: np.array(getattr(plant, kind), dtype=str) for kind in ("states", "inputs", "outputs")}
    units = {f"{kind[:-1]}_units": np.array(getattr(plant, f"{kind[:-1]}_units"), dtype=str) for kind in names}
    stream = BytesIO()
    matrices = {"A": plant.A, "B": plant.B, "C": plant.C, "B_d": plant.B_d, "poles": plant.poles}
    np.savez_compressed(stream, allow_pickle=False, **matrices, **names, **units)
    try:
        write_bytes(path, stream.getvalue())
    except OSError as error:
        raise ModelError(f"{path}: cannot be written ({error.strerror})") from error


def _matrices(plant: LinearPlant) -> tuple[tuple[str, Array, tuple[str, ...], tuple[str, ...]], ...]:
    states = _with_units(plant.states, plant.state_units)
    return (
        ("A", plant.A, states, plant.states),
        ("B", plant.B, states, _with_units(plant.inputs, plant.input_units)),
        ("C", plant.C, _with_units(plant.outputs, plant.output_units), plant.states),
    )


def _with_units(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True))


def _show_matrix(name: str, matrix: Array, rows: tuple[str, ...], columns: tuple[str, ...], out: Terminal) -> None:
    """In blocks of as many columns as fit beside the names of the rows."""
    cells = [["·" if value == 0 else f"{value:.5g}" for value in column] for column in matrix.T]
    widths = [max(map(len, (head, *column))) + GAP for head, column in zip(columns, cells, strict=True)]
    room = out.width - max((len(row) for row in rows), default=0) - GAP
    blocks: list[list[int]] = [[]]
    for i, width in enumerate(widths):
        if blocks[-1] and sum(widths[j] for j in blocks[-1]) + width > room:
            blocks.append([])
        blocks[-1].append(i)
    for block in blocks:
        table = Table(name, *(columns[i] for i in block), box=SIMPLE_HEAD)
        for k, label in enumerate(rows):
            table.add_row(label, *(cells[i][k] for i in block))
        out.print(table)


def _show_outline(plant: LinearPlant, out: Terminal) -> None:
    """Names with units, and what drives and what shows each state."""
    out.say(f"{plant.n} states, {plant.n_u} inputs, {plant.n_y} outputs")
    units = plant.state_units or ("",) * plant.n
    rows = [
        (state, unit, *(_largest(row, names) for row, names in (
            (plant.A[i], plant.states), (plant.B[i], plant.inputs), (plant.C[:, i], plant.outputs),
        )))
        for i, (state, unit) in enumerate(zip(plant.states, units, strict=True))
    ]  # fmt: skip
    heads = Column("state"), Column("unit", rank=3), Column("largest in A", rank=2), Column("driven most by", rank=1)
    show_table((*heads, Column("shown most by", rank=1)), rows, out)


def _largest(values: Array, names: tuple[str, ...]) -> str:
    if not len(values) or not np.abs(values).max():
        return "·"
    at = int(np.abs(values).argmax())
    return f"{names[at]} {values[at]:.4g}"


def _show_poles(plant: LinearPlant, out: Terminal) -> None:
    """Poles from the most unstable on, each pair once, with what they mean in time."""
    rows = []
    for pole in sorted((p for p in plant.poles if p.imag >= 0), key=lambda p: (-p.real, p.imag)):
        size = abs(pole)
        oscillates = pole.imag > 1e-9 * max(1.0, size)
        rows.append(
            (
                pairs([pole if oscillates else pole.real]),
                f"{-pole.real / size:.3g}" if oscillates else "–",
                f"{-1 / pole.real:.4g}" if abs(pole.real) > 1e-9 else "–",
                f"{pole.imag / (2 * np.pi):.4g}" if oscillates else "–",
            )
        )
    show_table(POLES, rows, out)


# what people read: factor on the value, and unit
UNITS = {"rad": (180 / np.pi, "deg"), "rad/s": (180 / np.pi, "deg/s"), "m": (1e3, "mm")}


def show_sway(sway: Sway, title: str, out: Terminal) -> None:
    """Measures down, signals across, the plane of two of them last."""
    values = [_rows(c) for c in sway.coordinates]
    units = [_unit(c.unit)[1] for c in sway.coordinates]
    heads = [f"{c.name} ({unit})" if unit else c.name for c, unit in zip(sway.coordinates, units, strict=True)]
    if sway.plane is not None:
        values.append(_rows(sway.plane))
        heads.append(f"plane ({_unit(sway.plane.unit)[1]})".replace(" ()", ""))
    labels = dict.fromkeys(label for column in values for label in column)
    rows = [(label, *(column.get(label, MISSING) for column in values)) for label in labels]
    show_table((Column(""), *(Column(head, "right") for head in heads)), rows, out, title=title)


def record(sway: Sway) -> dict[str, Any]:
    """What ``--json`` prints: every measure, in the units of the series."""
    found: dict[str, Any] = {
        "duration": sway.duration,
        "rate": sway.rate,
        "samples": len(sway.series),
        "low_pass": sway.low_pass,
        "resampled": sway.series.facts.get("resampled"),
        "coordinates": [{"name": c.name, "unit": c.unit, **c.record()} for c in sway.coordinates],
        "plane": None,
    }
    if (plane := sway.plane) is not None:
        found["plane"] = {"names": plane.names, "unit": plane.unit, **plane.record()}
    found["spectrum"] = {"frequency": sway.spectrum.frequency, "power": sway.spectrum.power.T}
    return dict(plain(found))


def _rows(of: Measured) -> dict[str, str]:
    """Values by label, in the units that people read."""
    factor, angle = _unit(of.unit)[0], UNITS["rad"]
    found = {}
    for one, value in of.numbers.items():
        mark = one.unit.replace("U", "unit").replace("rad", angle[1])
        label = one.words + {"": "", "unit": "", "unit/s": " (per s)"}.get(mark, f" ({mark})")
        by = factor ** (2 if "U²" in one.unit else "U" in one.unit) * (angle[0] if one.unit == "rad" else 1)
        found[label] = amount(by * value, figures=4)
    return found


def _unit(unit: str) -> tuple[float, str]:
    return UNITS.get(unit, (1.0, unit))


ROWS = 12  # rows of a branch


def show_cycle(case: Case, json: bool) -> None:
    """Find the cycle that the run settles on, and print it.

    Raises:
        CycleError: if there is none.
    """
    from icmj.cycle.switched import find_switched_cycle

    run = case.run
    with Working(f"cycle of {run.case.name}", ERR):
        plant, law, x0 = _loop(case)
        with prefix_errors(run.path):
            found = find_switched_cycle(plant, law, x0)
    if json:
        OUT.show(_plain(found))
        return
    OUT.say(f"{run.title} (linear): {found.words}")
    say_changes(run, OUT)
    for name, high, spread in zip(law.plant.outputs, found.y_peak, found.y_range, strict=True):
        OUT.say(f"{name}: peak {high:.6g}, peak to peak {spread:.6g}")
    shown = ", ".join(f"{mu.real:.6f}" if abs(mu.imag) < 1e-9 else f"{mu:.6f}" for mu in found.multipliers)
    OUT.say(f"multipliers {shown}; it closes to {found.closure:.0e}.")


def show_branch(command: ContinueCommand, run: RunFile) -> None:
    """Follow the cycle along a parameter of the controller, and list it.

    Raises:
        CycleError: if there is none, or what was asked for is not the linear plant's, or not the controller's.
    """
    from icmj.case.case import prepare
    from icmj.cycle.switched import has_exact_cycle
    from icmj.cycle.switched_branch import follow_switched, vary
    from icmj.errors import CycleError

    name = command.parameter.removeprefix("controller.")
    with Working(f"{run.case.name}.{name}", ERR):
        case = prepare(run)
        if command.plant == "mujoco" or not has_exact_cycle(case.controller):
            raise CycleError(
                f"{run.path}: only branches of intermittent control, and of switched feedback of one joint with a "
                "dead zone on the linear plant (--plant linear), are followed; for other runs see icmj cycle"
            )
        plant, law, x0 = _loop(case)
        with prefix_errors(run.path):
            if command.from_ is not None:
                law = vary(law, name)[0](command.from_)
            branch = follow_switched(plant, law, name, command.to, points=command.points, x0=x0)
    columns = (
        Column(name, "right"), Column("period (s)", "right"), Column("switches", "right"),
        Column(f"peak of {law.position} / r", "right"), Column("|μ|", "right"), Column(""),
    )  # fmt: skip
    at = np.unique(np.linspace(0, len(branch.cycles) - 1, min(len(branch.cycles), ROWS)).astype(int))
    rows = [
        (
            f"{branch.value[i]:.6g}", f"{c.period:.6g}", f"{len(c.switches) * (2 if c.mirrored else 1)}",
            f"{c.peak:.5g}", f"{abs(c.multipliers[0]):.4g}", "attracting" if c.attracting else "repelling",
        )
        for i in at
        for c in [branch.cycles[i]]
    ]  # fmt: skip
    show_table(columns, rows, OUT, title=f"{run.title}: cycles along {name} (linear)")
    say_changes(run, OUT)
    for value in branch.changes:
        OUT.say(f"Stability changes at {name} = {value:.7g}.")
    OUT.say(f"The branch {branch.end}.")


def _loop(case: Case) -> tuple[LinearPlant, SwitchingPD, Array | None]:
    """The actual plant with the controller's inputs and outputs, the controller, and where the run starts."""
    from icmj.case.plants import linear_plant
    from icmj.plant.linear_plant import match_ports
    from icmj.simulation.start import plant_start

    law = case.controller
    plant = match_ports(linear_plant(case.actual, case.settings), law.plant, "position")
    x0 = plant_start(plant, case.settings, None)
    return plant, law, (x0 if x0.any() else None)  # type: ignore[return-value]


def show_roots(case: Case, json: bool) -> None:
    """Print the characteristic roots of a loop that stays in each mode, and its rounds if it has any."""
    from icmj.case.case import mode_roots
    from icmj.case.plants import linear_plant
    from icmj.experiments.switching_rounds import rounds_without_dead_zone

    run = case.run
    with Working(f"analysing {run.case.name}", ERR), prefix_errors(run.path):
        roots = mode_roots(case)
        rounded = rounds_without_dead_zone(case.controller, linear_plant(case.actual, case.settings))
    if json:
        told = None if rounded is None else vars(rounded) | {"verdict": rounded.verdict}
        notices = [vars(notice) for notice in case.notices]
        OUT.show(plain({"control": case.controller.kind, "roots": roots, "rounds": told, "notices": notices}))
        return
    rows = [(mode, "stable" if found[0].real < 0 else "unstable", pairs(found)) for mode, found in roots.items()]
    show_table(
        (Column("mode"), Column("loop"), Column("rightmost characteristic roots (rad/s)")), rows, OUT,
        title=f"{run.title}: the linear loop that stays in a mode", keys=1,
    )  # fmt: skip
    say_changes(run, OUT)
    if rounded is not None:
        OUT.say(f"Without a dead zone: {rounded.words[0].lower()}{rounded.words[1:]}")
    for notice in case.notices:
        OUT.note(notice)


def _plain(found: SwitchedCycle) -> dict[str, Any]:
    return plain(
        {
            "plant": "linear",
            "period": found.period,
            "mirrored": found.mirrored,
            "attracting": found.attracting,
            "switches": len(found.switches) * (2 if found.mirrored else 1),
            "times": found.switches,
            "outputs": found.law.plant.outputs,
            "peak": found.y_peak,
            "range": found.y_range,
            "multipliers": found.multipliers,
            "multiplier_errors": found.multiplier_errors,
            "states": found.states,
            "closure": found.closure,
            "words": found.words,
        }
    )
