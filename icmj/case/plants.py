"""The two plants of a run file: the one that the controller assumes, and the actual one.

Each is made of a model or of matrices.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from icmj.case.iosystem import AnyPlant
from icmj.case.matrices import actual_matrices, assumed_matrices
from icmj.engine.deviation import Deviation
from icmj.engine.inventory import list_inventory
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.errors import RunFileError
from icmj.plant.body import Selection
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.schema import RunFile
from icmj.simulation.settings import Settings


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
    known = list_inventory(run.actual_path).keyframes
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
