"""The runs of one case side by side: the linear plant's and MuJoCo's, either of which may be missing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

from icmj.case.comparison import Comparison, compare
from icmj.case.result import Result
from icmj.controller.controller import Controller, expect_intermittent
from icmj.errors import ReportError
from icmj.theory.prediction import Prediction


@dataclass(frozen=True, eq=False)
class CaseRuns:
    """One case: its name and its runs, keyed ``linear`` and ``mujoco``, in that order."""

    name: str
    runs: dict[str, Result]

    @property
    def linear(self) -> Result | None:
        """The run of the linear plant, if there."""
        return self.runs.get("linear")

    @property
    def first(self) -> Result:
        """The result to read shared facts from: the linear plant's if there, else MuJoCo's."""
        return next(iter(self.runs.values()))

    @property
    def last(self) -> Result:
        """The result drawn on top: MuJoCo's if there, else the linear plant's."""
        return list(self.runs.values())[-1]

    @property
    def prediction(self) -> Prediction:
        """The linear theory's prediction, the same for both plants."""
        return self.first.expect_prediction()

    @property
    def controller(self) -> Controller:
        """The controller, the same for both plants."""
        return expect_intermittent(self.first.controller)

    @cached_property
    def comparisons(self) -> dict[str, Comparison]:
        """Each run compared with the prediction."""
        return {plant: compare(result) for plant, result in self.runs.items()}


def pair(results: Sequence[Result]) -> list[CaseRuns]:
    """Results grouped by case, in the order in which the cases first appear.

    Raises:
        ReportError: if there are none, two of the same case and plant, or one without a prediction.
    """
    if not results:
        raise ReportError("no results to report; give at least one log")
    groups: dict[str, dict[str, Result]] = {}
    for result in results:
        name, plant = result.run.case.name, result.simulation.plant
        if result.prediction is None:
            kind = result.controller.kind
            raise ReportError(f"case {name!r}: a run under {kind} control has no prediction to stand beside")
        runs = groups.setdefault(name, {})
        if plant in runs:
            raise ReportError(f"two logs hold case {name!r} on the {plant} plant; give only one of them")
        runs[plant] = result
    return [
        CaseRuns(name, {plant: runs[plant] for plant in ("linear", "mujoco") if plant in runs})
        for name, runs in groups.items()
    ]


def compares(case: CaseRuns) -> bool:
    """Whether runs are compared with the orbit and the interval of Δ_crit: not under noise where none is predicted."""
    return case.prediction.cycle or not case.first.simulation.noisy


def shown_interval(case: CaseRuns) -> float | None:
    """Δ_crit [s] where the intervals of the runs are compared with it."""
    return case.prediction.delta_crit if compares(case) else None


def is_noisy(case: CaseRuns) -> bool:
    """Whether noise acts in a case, so that no cycle can be reached in it."""
    return case.first.run.simulation.settings().noisy
