"""Names and units of the recorded signals, for export, and columns under these names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from icmj.plant.linear_plant import LinearPlant


@dataclass(frozen=True)
class Labels:
    """Names of the columns of a run; empty where they are not known.

    Attributes:
        states, inputs, outputs: of the actual plant.
        assumed: states of the controller's model, which observer and hold have.
        state_units, input_units, output_units, assumed_units: of these; "" where a unit is not known.
    """

    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    assumed: tuple[str, ...] = ()
    state_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    assumed_units: tuple[str, ...] = ()


UNKNOWN = Labels()


def make_labels(actual: LinearPlant, assumed: LinearPlant | None = None) -> Labels:
    """The labels of a run of ``actual`` under a controller whose observer believes in ``assumed``, if it has one."""
    return Labels(
        actual.states,
        actual.inputs,
        actual.outputs,
        assumed.states if assumed else (),
        actual.state_units,
        actual.input_units,
        actual.output_units,
        assumed.state_units if assumed else (),
    )


def name_loop_signals(actual: LinearPlant, assumed: LinearPlant, *segments: str) -> dict[str, list[str]]:
    """Names of inputs, outputs and states of a closed loop for python-control.

    Inputs are d_<input> and n_<output>, outputs <output> and u_<input>, states those of the plant, then for each
    segment of the controller, such as x_o, x_o_<state>.
    """
    return {
        "inputs": as_plain_names([*(f"d_{name}" for name in actual.inputs), *(f"n_{name}" for name in actual.outputs)]),
        "outputs": as_plain_names([*actual.outputs, *(f"u_{name}" for name in actual.inputs)]),
        "states": as_plain_names([*actual.states, *(f"{part}_{name}" for part in segments for name in assumed.states)]),
    }


def as_plain_names(names: Iterable[str]) -> list[str]:
    """Names without points, which python-control reserves."""
    return [name.replace(".", "_") for name in names]
