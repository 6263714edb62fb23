"""Which kinds of experiment there are, by the name of their table in an experiment file."""

from __future__ import annotations

from icmj.runfile.experiment_tables import ExperimentFile
from icmj.study.double_step import DoubleStepKind
from icmj.study.intersection_point import IntersectionPointKind
from icmj.study.kind import Kind
from icmj.study.multisine import MultisineKind
from icmj.study.perturbed_stance import PerturbedStanceKind
from icmj.study.quiet_standing import QuietStandingKind

KIND_OF: dict[str, type[Kind]] = {
    "double_step": DoubleStepKind,
    "intersection_point": IntersectionPointKind,
    "multisine": MultisineKind,
    "perturbed_stance": PerturbedStanceKind,
    "quiet_standing": QuietStandingKind,
}


def kind_of(file: ExperimentFile) -> Kind:
    """The kind of an experiment file, with its settings."""
    return KIND_OF[file.kind](file.settings)
