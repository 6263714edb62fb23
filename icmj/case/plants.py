"""What a run file describes: its plants, the controller's design, the files on which they depend.

The files on which the results of a run file depend, and their digests.

They are the models of its plants with everything that these include and refer to, matrices, set-points and disturbances
that are columns of files, and code of the user's own with what it imports from beside it.

Plants that a run file gives by matrices: written out in it, or in a file beside it.

The two plants of a run file: the assumed plant of the controller, and the actual plant.

The controller of a run file and its design: by LQ weights, or with given gains.

Plants and closed loops as input-output systems of python-control, to connect, simulate and analyse them there.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array, real
from icmj.base.files import read_bytes
from icmj.base.npz import read_npz
from icmj.base.text import one_line, parse_json
from icmj.controller.controller import Controller, Law
from icmj.controller.design import Delay, Design, design_lq
from icmj.controller.setpoint import Setpoint, setpoint
from icmj.engine.deviation import Deviation
from icmj.engine.inventory import inventory
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.engine.safety import files_of
from icmj.errors import AnalysisError, DesignError, IcmjError, RunFileError, expect
from icmj.plant.body import Activation, Selection
from icmj.plant.linear_plant import LinearPlant, Match, deviate, expect_linear, match_ports, refuse_unusual
from icmj.plant.quality import MatrixPlant, uncontrollable
from icmj.runfile.control_tables import Parts, Weights
from icmj.runfile.plant_tables import LETTERS, PlantTable
from icmj.runfile.schema import RunFile
from icmj.runfile.target import find_files, make_targets
from icmj.simulation.settings import Settings
from icmj.work.folder import digest_of
from icmj.work.own_code import REFERENCE

if TYPE_CHECKING:
    from control import NonlinearIOSystem, StateSpace


def plant_files(run: RunFile) -> tuple[Path, ...]:
    """The files of the plants and of the set-point; a run file that holds its own matrices is none of them.

    Raises:
        ModelError: if a model, or what it includes, cannot be read.
    """
    found: dict[Path, None] = {}
    for path in dict.fromkeys((run.assumed_path, run.actual_path)):
        if path.suffix in (".npz", ".json"):
            found[path] = None
        elif path.suffix != ".toml":
            found |= dict.fromkeys(files_of(path))
    return tuple(found | dict.fromkeys(find_files(run.setpoint, run.path)))


def references(*said: Any) -> Iterator[str]:
    """What looks like ``module:name`` in plain data, at any depth."""
    left = list(said)
    while left:
        value = left.pop()
        if isinstance(value, Mapping):
            left += value.values()
        elif isinstance(value, list | tuple):
            left += value
        elif isinstance(value, str) and re.fullmatch(REFERENCE, value):
            yield value


def digests(run: RunFile) -> dict[str, str]:
    """SHA-256 of each file on which results of a run file depend, by its path from the run file.

    Code is that which may be run; of an installed module it is the file that ``module:name`` names.

    Raises:
        ModelError, RunFileError: if one cannot be read.
    """
    home, found = run.path.parent, {}
    files = [*plant_files(run)]
    files += [home / name for table in run.simulation.disturbance for name in table.files]
    for reference in sorted(set(references(run.model_dump()))) if run.code.allowed else ():
        found[reference] = run.code.digest(reference)
        files += run.code.sources(reference)
    for path in dict.fromkeys(files):
        try:
            found[Path(os.path.relpath(path, home)).as_posix()] = digest_of(path)
        except (OSError, ValueError) as error:
            why = error.strerror if isinstance(error, OSError) else error
            raise RunFileError(f"{run.path}: {path}: cannot be read ({why})") from error
    return found


KINDS = ("states", "inputs", "outputs")
BESIDE = ("D", "E", "dt")
PUSHED = "B_d"
MOST_BYTES = 10_000_000  # a plant of 200 states takes less than one, even as text


def assumed_matrices(run: RunFile) -> MatrixPlant:
    """The assumed plant of a run file that gives it by matrices.

    Raises:
        RunFileError: if they, or their names, do not make a plant.
    """
    plant = _plant(run, run.assumed, "assumed", None)
    try:
        return MatrixPlant.of(_behind(run.assumed_activation, plant))
    except IcmjError as error:
        raise RunFileError(f"{run.path}: assumed: {error}") from error


def actual_matrices(run: RunFile, assumed: LinearPlant) -> MatrixPlant:
    """The actual plant of a run file that gives it by matrices: its own, or the assumed plant's, and its input gain.

    ``assumed`` is the assumed plant without activation dynamics. ρ takes it from there to what the run file says (the
    paper's family A = Â − ρÃ₁).

    Raises:
        RunFileError: if they do not make a plant, or none that fits the assumed one.
    """
    table = run.actual
    plant = _plant(run, table, "actual", assumed) if table.given else assumed
    try:
        if table.given:
            plant = _align(plant, assumed)
            plant = deviate(assumed, plant, table.rho) if table.rho != 1.0 else plant
        gain = np.asarray(table.gain, dtype=float)
        if gain.ndim and gain.size != plant.n_u:
            raise AnalysisError(f"gain has {gain.size} entries for {plant.n_u} inputs")
        return MatrixPlant.of(_behind(run.actual_activation, plant).scaled(1 + table.rho * (gain - 1)))
    except IcmjError as error:
        raise RunFileError(f"{run.path}: actual: {error}") from error


def read_matrices(path: Path) -> dict[str, Any]:
    """A, B, C and names of states, inputs and outputs, as far as they are there, from ``.npz`` or ``.json``.

    Raises:
        RunFileError: if the file cannot be read, or lacks one of the matrices.
    """
    try:
        if path.suffix == ".json":
            found = parse_json(read_bytes(path, MOST_BYTES))
        elif path.suffix == ".npz":
            content = BytesIO(read_bytes(path, MOST_BYTES))
            arrays = read_npz(content, MOST_BYTES, (*LETTERS, PUSHED, *BESIDE, *KINDS))
            found = {name: array.tolist() for name, array in arrays.items()}
        else:
            raise RunFileError(f"{path}: matrices are read from .npz and .json")
    except OSError as error:
        raise RunFileError(f"{path}: cannot be read ({error.strerror or one_line(error, 200)})") from error
    except (ValueError, RecursionError, MemoryError) as error:
        raise RunFileError(f"{path}: holds no matrices that can be read ({one_line(error, 200)})") from error
    if not isinstance(found, dict) or not all(letter in found for letter in LETTERS):
        raise RunFileError(f"{path}: expected the matrices A, B and C by these names")
    return found


def _plant(run: RunFile, table: PlantTable, which: str, like: LinearPlant | None) -> LinearPlant:
    """The plant of one table; names that it lacks are those of the plant ``like``, which must have the same sizes."""
    data: Mapping[str, Any] = {letter: getattr(table, letter) for letter in (*LETTERS, PUSHED)}
    where = f"{run.path}: {which}"
    if table.matrices is not None:
        data = read_matrices(run.path.parent / table.matrices)
        where = f"{where}: {table.matrices}"
    try:
        A, B, C = (_matrix(data[letter], letter) for letter in LETTERS)
        refuse_unusual(**{name: data.get(name) for name in BESIDE})
        B_d = np.zeros((0, 0)) if data.get(PUSHED) is None else _matrix(data[PUSHED], PUSHED)
        plant = LinearPlant(A, B, C, *(_names(table, data, kind) for kind in KINDS), B_d=B_d)
        if like is not None:
            plant = _name_ports(plant, like, [kind for kind in KINDS if not _names(table, data, kind)])
        return _add_units(plant, table, data)
    except AnalysisError as error:
        raise RunFileError(f"{where}: {error}") from error


def _align(plant: LinearPlant, assumed: LinearPlant) -> LinearPlant:
    """The plant with inputs and outputs in the order of the assumed one's."""
    for kind in KINDS[1:]:
        here, there = getattr(plant, kind), getattr(assumed, kind)
        if sorted(here) != sorted(there):
            raise AnalysisError(
                f"{kind} {', '.join(here)}; expected those of the assumed plant, {', '.join(there)}, in any order"
            )
    return match_ports(plant, assumed)


def _behind(activation: Activation | None, plant: LinearPlant) -> LinearPlant:
    """The plant behind the lags of its muscles."""
    return plant if activation is None else activation.before(plant)


def _matrix(rows: object, letter: str) -> np.ndarray:
    M = real(rows, letter, AnalysisError)  # type: ignore[arg-type]
    if M.ndim == 1:  # of a single input, or output
        M = M[:, None] if letter in ("B", PUSHED) else M[None, :]
    if M.ndim != 2 or 0 in M.shape:
        raise AnalysisError(f"{letter} is not a matrix; it has shape {M.shape}")
    return M


def _names(table: PlantTable, data: Mapping[str, Any], kind: str) -> tuple[str, ...]:
    names = getattr(table, kind)
    if names is None:
        names = data.get(kind) or ()
        if not (isinstance(names, list | tuple) and all(isinstance(name, str) for name in names)):
            raise AnalysisError(f"{kind} are not names")
    twice = {name for name in names if list(names).count(name) > 1}
    if twice:
        raise AnalysisError(f"{kind}: {min(twice)!r} is named twice")
    return tuple(names)


def _name_ports(plant: LinearPlant, like: LinearPlant, nameless: list[str]) -> LinearPlant:
    for kind in nameless:
        if len(getattr(plant, kind)) == len(getattr(like, kind)):
            unit = f"{kind.removesuffix('s')}_units"
            plant = replace(plant, **{kind: getattr(like, kind), unit: getattr(like, unit)})
    return plant


def _add_units(plant: LinearPlant, table: PlantTable, data: Mapping[str, Any]) -> LinearPlant:
    """The plant with its units: those in the file, list by list, and those in the run file, by name."""
    in_file = data.get("units")
    known = {*plant.states, *plant.inputs, *plant.outputs}
    for name in table.units:
        if name not in known:
            raise AnalysisError(f"units: no {name!r} in the plant; expected one of {', '.join(sorted(known))}")
    units: dict[str, Any] = {}
    for kind in KINDS:
        key = f"{kind.removesuffix('s')}_units"
        before = getattr(plant, key)
        listed = in_file.get(kind) if isinstance(in_file, dict) else None
        if isinstance(listed, list) and len(listed) == len(before):
            before = tuple(str(unit) for unit in listed)
        units[key] = tuple(table.units.get(name, unit) for name, unit in zip(getattr(plant, kind), before, strict=True))
    return replace(plant, **units)


AnyPlant = MujocoPlant | MatrixPlant
"""A plant of a case: a model on the engine, or matrices; either has its ``linearisation.plant`` and ``quality``."""


def assumed_plant(run: RunFile) -> AnyPlant:
    """The plant that the controller believes in.

    Raises:
        ModelError: if it cannot be loaded.
        RunFileError: if its matrices do not make a plant.
    """
    table = run.assumed
    if table.given:
        return assumed_matrices(run)
    return load_plant(
        run.assumed_path,
        keyframe=table.keyframe,
        selection=table.selection,
        operating=table.operating,
        person=run.assumed.measures,
        activation=run.assumed_activation,
    )


def actual_plant(run: RunFile, assumed: AnyPlant) -> AnyPlant:
    """The actual plant, with the inputs and outputs of the assumed plant, matched by name.

    States that the assumed plant drops are dropped here, too, if nothing that is kept depends on them.

    Its operating point is its own. The controller counts controls from there, as if a slow tonic part had long found
    what holds this plant; what it does not know is how the plant departs from rest. By default it is found by the
    assumed plant's rule, from the point where the assumed plant rests.

    Raises:
        ModelError: if it cannot be loaded, or lacks an input or output.
        RunFileError: if the run file gives it another number of inputs or outputs, or matrices that make no plant.
    """
    table = run.actual
    if not run.on_engine:
        # what the lags of either plant stand before: matrices are compared, named and mixed without them
        bare = assumed_plant(run.with_(**{"assumed.activation": None})) if run.assumed.activation else assumed
        given = actual_matrices(run, bare.linearisation.plant)
        _check_ports(run, assumed.linearisation.plant, given.linearisation.plant)
        return given
    deviation = deviation_of(run)
    keyframe = keyframe_of(run)
    selection = replace(table.selection, inputs=table.selection.inputs or assumed.linearisation.plant.inputs)
    if selection.outputs is None:
        selection = replace(selection, outputs=_outputs(run, assumed))

    operating = table.operating
    if table.operating_point is None:
        operating = replace(run.assumed.operating, pose={**run.assumed.pose, **table.pose})
    start = None
    if isinstance(assumed, MujocoPlant) and table.model is None and table.keyframe is None:
        start, operating = assumed.rest, replace(operating, pose=table.pose)

    def load(selection: Selection) -> MujocoPlant:
        path, person, activation = run.actual_path, run.actual_measures, run.actual_activation
        return load_plant(
            path, deviation, keyframe, selection=selection, operating=operating, start=start, person=person,
            activation=activation,
        )  # fmt: skip

    actual = load(selection)
    _check_ports(run, assumed.linearisation.plant, actual.linearisation.plant)
    if selection.states is None and not selection.drop:
        dropped = set(_idle(actual.linearisation.plant, _find_omitted(assumed)))
        if dropped:
            actual = load(replace(selection, drop=(*_find_omitted(actual), *dropped)))
    return actual


def linear_plant(actual: AnyPlant, settings: Settings) -> LinearPlant:
    """The linear plant of a case for runs with these settings: it knows what their pushes on bodies do.

    Raises:
        SimulationError: if the model has no such body.
    """
    return actual.pushed(settings.pushes) if isinstance(actual, MujocoPlant) else actual.linearisation.plant


def deviation_of(run: RunFile) -> Deviation:
    """The deviation of the controller's model from the plant that the run file states."""
    table = run.actual
    edit = None if table.edit is None else partial(run.code.find(table.edit), **table.edit_parameters)
    return Deviation(table.gain, table.dynprm, table.rho, table.changes, edit)


def keyframe_of(run: RunFile) -> str | None:
    """The actual plant's: its own, or that of the assumed plant if its model has one of this name."""
    if run.actual.keyframe is not None or run.actual.model is None:
        return run.actual.keyframe or run.assumed.keyframe
    known = inventory(run.actual_path).keyframes
    return run.assumed.keyframe if run.assumed.keyframe in known else None


def _outputs(run: RunFile, assumed: AnyPlant) -> tuple[str, ...]:
    """Outputs of the actual plant that correspond to those of the assumed plant, matched by joint or sensor name."""
    chosen = run.assumed.selection.outputs
    if isinstance(chosen, tuple):
        return chosen
    outputs = assumed.linearisation.plant.outputs
    if chosen != "joints" or not isinstance(assumed, MujocoPlant):
        return outputs
    joints = {joint.name for joint in assumed.spec.joints}
    return tuple(name.removesuffix("_position") if name not in joints else name for name in outputs)


def _find_omitted(assumed: AnyPlant) -> list[str]:
    """States that the assumed model has and the assumed plant has not."""
    kept = assumed.linearisation.plant.states
    return [name for name in assumed.states if name not in kept]


def _idle(plant: LinearPlant, names: list[str]) -> list[str]:
    """The states among ``names`` on which no other state and no output depends."""
    there = [plant.states.index(name) for name in names if name in plant.states]
    others = [i for i in range(plant.n) if i not in there]
    effect = np.abs(plant.A[np.ix_(others, there)]).sum() + np.abs(plant.C[:, there]).sum()
    size = np.abs(plant.A).max() + np.abs(plant.C).max()
    return [plant.states[i] for i in there] if effect <= 1e-8 * size else []


def _check_ports(run: RunFile, assumed: LinearPlant, actual: LinearPlant) -> None:
    for what in ("inputs", "outputs"):
        here, there = getattr(assumed, what), getattr(actual, what)
        if len(here) != len(there):
            raise RunFileError(
                f"{run.path}: the assumed plant has the {what} {', '.join(here)}, the actual one {', '.join(there)}; "
                f"name as many in [actual] {what}"
            )


def controller_of(run: RunFile, assumed: LinearPlant, design: Design | None = None) -> Law:
    """The controller of a run file, for its assumed plant; with a ``design`` that is at hand.

    The set-point is part of it, so that whatever simulates the controller follows the set-point.

    Raises:
        DesignError, AnalysisError: if the weights give none, or rule, delay or set-point do not fit.
        RunFileError: if a file of the set-point cannot be read, or a controller of one's own may not be made, or
            cannot be.
    """
    return run.controller.law(parts_of(run, assumed, design))


def parts_of(run: RunFile, assumed: LinearPlant, design: Design | None = None) -> Parts:
    """What the table of the controller takes, with a ``design`` that is at hand."""
    known = assumed if design is None else design.plant
    return Parts(
        assumed, delay_of(run), run.code,
        design=lambda: design or make_design(assumed, run.design), setpoint=lambda: setpoint_of(run, known),
    )  # fmt: skip


def setpoint_of(run: RunFile, assumed: LinearPlant) -> Setpoint | None:
    """The set-point of a run file, until the end of its run; ``None`` if it has none.

    Raises:
        RunFileError, AnalysisError: if a file of it cannot be read, or the assumed plant has no such set-point.
    """
    return setpoint(assumed, make_targets(run.resolve().setpoint, run.simulation.duration, run.path))


def make_design(plant: LinearPlant, weights: Weights) -> Design:
    """Gains for the assumed plant: given ones as they are, the others by LQ design.

    Raises:
        DesignError: if a gain or weight does not fit the plant, or there is no LQ design.
    """
    k, L = (None if given is None else _gain(given, name) for given, name in ((weights.k, "k"), (weights.L, "L")))
    if k is not None and L is not None:
        return Design(plant, k, L)

    def square(weight: str | list, named: Array) -> Array | list | float:
        if weight == "identity":
            return 1.0
        return named if isinstance(weight, str) else weight

    # rounding may make a Riccati equation solvable that has no solution
    if any(not mode.stable for mode in uncontrollable(plant)):
        raise DesignError("no LQ design for this plant, which has a mode that the inputs do not reach")
    design = design_lq(
        plant,
        Q_c=square(weights.Q_c, plant.C.T @ plant.C),
        R_c=weights.R_c,
        Q_o=square(weights.Q_o, plant.B @ plant.B.T),
        R_o=weights.R_o,
    )
    return Design(plant, design.k if k is None else k, design.L if L is None else L)


def _gain(given: list, name: str) -> Array:
    try:
        gain = np.array(given, dtype=float)
    except ValueError as error:
        raise DesignError(f"{name} is not a matrix: its rows differ in length") from error
    if gain.ndim == 1:  # of a single input, or output
        return gain[None, :] if name == "k" else gain[:, None]
    return gain


def delay_of(run: RunFile) -> Delay:
    """The assumed delay, and the actual one, which departs from it by ρ of what the run file says."""
    assumed = run.assumed.delay
    actual = assumed if run.actual.delay is None else assumed + run.actual.rho * (run.actual.delay - assumed)
    return Delay(actual, assumed)


def to_iosystem(
    plant: LinearPlant | AnyPlant,
    controller: Controller | None = None,
    *,
    dt: float | None = None,
    match: Match = "name",
) -> StateSpace | NonlinearIOSystem:
    """A plant or its closed loop as a system of python-control; all quantities are deviations from the operating point.

    =============================  ==================================================================================
    plant alone                    ``StateSpace`` for a linear plant, ``NonlinearIOSystem`` for a MuJoCo model
    ``Continuous()``               the same for the loop; states (x, x_o)
    ``ClockTrigger(Δ)``            linear plant: ``StateSpace`` in discrete time, dt = Δ; states (x, x_o) at ticks
    an event rule                  linear plant: ``NonlinearIOSystem`` in discrete time, evaluated every ``dt``, so that
                                   events are late by up to ``dt``; states (x, x_o, x_h, time since the last event)
    =============================  ==================================================================================

    The inputs of a loop are d_<input>, which is added to the command, and n_<output>, an error of the observer's
    reading; its outputs are those of the plant and the commands u_<input>. For exact events use
    :func:`icmj.simulate_plant` and ``to_timeresponse()`` of the run.

    Args:
        plant: a linear plant, a plant from :func:`icmj.load_plant`, or a plant of a case.
        controller: design, hold and trigger; ``None`` for the plant alone.
        dt: interval at which an event rule is evaluated [s].
        match: how inputs and outputs of the plant are assigned to those of the controller's model.

    Raises:
        AnalysisError: if the controller is not intermittent, if there is a delay or a set-point, an event rule without
            ``dt`` or ``dt`` without an event rule, a MuJoCo model under other than continuous control, or plant and
            controller do not fit together.
    """
    given: Any = plant
    linear: LinearPlant = getattr(getattr(given, "linearisation", None), "plant", given)
    expect_linear(linear, "the plant")
    engine = plant if isinstance(plant, MujocoPlant) else None
    if controller is None:
        if engine is None:
            return linear.statespace()
        from icmj.engine.pose import plant_system

        return plant_system(engine)
    words = "it has no such form; simulate it with simulate_plant, and take to_timeresponse() of the run"
    expect(controller, Controller, "to_iosystem", words)
    trigger = controller.trigger
    if len(controller.realisation.signals):
        raise AnalysisError(
            "the controller has signals of its own (a set-point), which are not inputs of this form; remove them"
        )
    if (dt is None) != (trigger.kind != "event"):
        raise AnalysisError(
            "an event rule needs dt, the interval at which it is evaluated; to_iosystem(..., dt=1e-3)"
            if dt is None
            else f"dt is for event rules; a {trigger.kind} trigger has its own time"
        )
    if engine is not None:
        if trigger.kind != "continuous":
            raise AnalysisError(
                "a model on the engine has events inside its steps; take controller.triggered_by(Continuous()), its "
                "linear plant (plant.linearisation.plant), or to_timeresponse() of a run"
            )
        from icmj.engine.pose import continuous_loop as continuous_on_engine

        return continuous_on_engine(engine.matched(controller.design.plant, match), controller)
    from icmj.linear.loop import clocked_loop, continuous_loop, event_loop

    linear = match_ports(linear, controller.design.plant, match)
    if dt is not None:
        return event_loop(linear, controller, dt)
    return continuous_loop(linear, controller) if trigger.kind == "continuous" else clocked_loop(linear, controller)
