"""Names and units of what a run records, so that its numbers can leave the package under their names."""

from __future__ import annotations

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


def labels_of(actual: LinearPlant, assumed: LinearPlant) -> Labels:
    """The labels of a run of ``actual`` under a controller that believes in ``assumed``."""
    return Labels(
        actual.states,
        actual.inputs,
        actual.outputs,
        assumed.states,
        actual.state_units,
        actual.input_units,
        actual.output_units,
        assumed.state_units,
    )
