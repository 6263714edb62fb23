"""What commands print with ``--json``."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from icmj.base.plain import plain

if TYPE_CHECKING:
    from icmj.engine.linearisation import Linearisation
    from icmj.theory.prediction import Prediction


def plain_prediction(prediction: Prediction, outputs: tuple[str, ...]) -> dict[str, Any]:
    """What ``icmj analyse --json`` prints of a prediction."""
    return plain(
        {
            "delta_crit": prediction.delta_crit,
            "eigenvalue": prediction.eigenvalue,
            "cycle": prediction.cycle,
            "period": prediction.period,
            "gamma": prediction.gamma,
            "outputs": outputs,
            "amplitude": prediction.amplitude,
            "verdict": prediction.verdict,
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
            "delta_max": prediction.delta_max,
            "beyond": None if prediction.beyond is None else prediction.beyond.delta,
            "neutral": [vars(mode) for mode in prediction.neutral],
            "family": None if prediction.family is None else prediction.family.words,
            "continuous_stable": {
                "state_feedback": prediction.state_feedback_stable,
                "observer_feedback": prediction.observer_feedback_stable,
            },
        }
    )


def plain_linearisation(linearisation: Linearisation) -> dict[str, Any]:
    """What ``icmj linearise --json`` prints."""
    plant = linearisation.plant
    return plain(
        {
            "A": plant.A,
            "B": plant.B,
            "C": plant.C,
            "poles": plant.poles,
            "states": plant.states,
            "inputs": plant.inputs,
            "outputs": plant.outputs,
            "residual": linearisation.residual,
        }
    )
