"""What commands print with ``--json``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from icmj.base.card import plain
from icmj.base.fact import told

if TYPE_CHECKING:
    from collections.abc import Iterable

    from icmj.comparison.comparison import Comparison
    from icmj.engine.linearisation import Linearisation
    from icmj.plant.notice import Notice
    from icmj.plant.quality import Quality
    from icmj.result.result import Result
    from icmj.theory.prediction import Prediction

MODES = ("neutral", "uncontrollable", "unobservable")


def plain_runs(runs: Iterable[Comparison | Result], **files: Path | Iterable[Path]) -> dict[str, Any]:
    """What ``--json`` prints of runs: each as in ``summary.json``; and the files written."""
    from icmj.comparison.comparison import Comparison, to_json, to_record

    written = {
        kind: str(file) if isinstance(file, Path) else [str(one) for one in file] for kind, file in files.items()
    }
    records = [to_json(run) if isinstance(run, Comparison) else to_record(run) for run in runs]
    return {"runs": records, **written}


def plain_prediction(prediction: Prediction, outputs: tuple[str, ...], notices: Iterable[Notice]) -> dict[str, Any]:
    """What ``icmj analyse --json`` prints: the prediction and the notices about its plants."""
    from icmj.theory.facts import PREDICTION

    return plain(
        {
            "notices": list(notices),
            **told(PREDICTION, prediction, "record"),
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
            "delta_max": prediction.delta_max,
            "beyond": None if prediction.beyond is None else prediction.beyond.delta,
            "neutral": prediction.neutral,
            "family": None if prediction.family is None else prediction.family.words,
            "continuous_stable": {
                "state_feedback": prediction.state_feedback_stable,
                "observer_feedback": prediction.observer_feedback_stable,
            },
        }
    )


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
                **{kind: getattr(quality, kind) for kind in MODES},
            },
            "notices": (*told, *quality.notices),
        }
    )
