"""The double-step experiment: pairs of steps of a set-point, and how late each is responded to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array
from icmj.case.case import Case, PlantKind
from icmj.controller.step_pairs import find_step_pairs
from icmj.errors import DataError
from icmj.experiments.double_step.explanation import KINDS, Explanation, explain_reactions
from icmj.experiments.double_step.reconstruction import Reconstruction, reconstruct_steps
from icmj.experiments.double_step.refractoriness import FEWEST_INTERVALS, Refractoriness, grouped, refractoriness
from icmj.experiments.recording import Recording, completed
from icmj.runfile.schema import RunFile
from icmj.runfile.setpoint_tables import DoubleStepsSetpoint
from icmj.runfile.stimulus_tables import DoubleStepTable
from icmj.series.series import Series
from icmj.simulation.simulation import Simulation
from icmj.study.kind import Kind, Told, sampled, timed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TARGET, CONTROL, COMBINED = "target", "control", "followed"


@dataclass(frozen=True, eq=False)
class FoundDoubleStep:
    """Refractory duration and kind of controller, of all trials together; a :class:`Finding`.

    Attributes:
        refractory: by four estimates.
        told: which kind of controller explains the reaction times.
        seen: the first trial as it was reconstructed.
    """

    refractory: Refractoriness
    told: Explanation
    seen: Reconstruction

    @property
    def numbers(self) -> Mapping[str, float]:
        found = self.refractory
        numbers = {"mean RT1 (s)": found.rt1_mean}
        for name, one in (
            ("free regression", found.free),
            ("slope −1", found.fixed),
            ("largest ISI", found.largest),
            ("range of RT2", found.range),
        ):
            numbers |= {f"{name} (s)": one.value, f"{name}, from (s)": one.low, f"{name}, to (s)": one.high}
        least = min(self.told.bic.values())
        return numbers | {f"BIC, {kind}": self.told.bic[kind] - least for kind in KINDS}

    @property
    def deviations(self) -> Mapping[str, float]:
        return {}

    @property
    def curves(self) -> Mapping[str, Array]:
        found = self.refractory
        return {
            "ISI (s)": found.isi,
            "pairs": found.count.astype(float),
            "RT1 (s)": found.rt1,
            "RT1, error (s)": found.rt1_error,
            "RT2 (s)": found.rt2,
            "RT2, error (s)": found.rt2_error,
        }

    @property
    def words(self) -> str:
        one = self.refractory.fixed
        refractory = (
            f"a refractory period of {one.value:.3g} s (95 % interval {one.low:.3g} to {one.high:.3g} s)"
            if one.low > 0 and self.told.kind != "continuous"
            else f"no refractory period above {self.refractory.isi.min():.3g} s"
        )
        kind = {"clock": "clock-driven", "event": "event-driven", "sampling": "event-driven with delayed sampling"}
        pairs = int(self.refractory.count.sum())
        return f"Classified as {kind.get(self.told.kind, self.told.kind)}; {refractory}, from {pairs} pairs of steps."


class DoubleStepKind(Kind):
    """See the module."""

    settings: DoubleStepTable

    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        table = self.settings
        steps = DoubleStepsSetpoint(
            kind="double-steps",
            **({"combination": table.combination, "name": COMBINED} if table.combination else {"output": table.output}),
            unit=table.unit,
            size=table.size,
            isi=table.isi,
            repetitions=table.repetitions,
            recovery=table.recovery,
            directions=table.directions,
            seed=seed,
        )
        kept = [one.model_dump(exclude_defaults=True, exclude_none=True) for one in run.setpoint]
        moved = run.with_(
            setpoint=[*kept, {"kind": "double-steps", **steps.model_dump(exclude_defaults=True, exclude_none=True)}]
        )
        return timed(moved, steps.pairs().end, table.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        name = self.settings.control or f"u.{simulation.labels.inputs[0]}"
        one = sampled(simulation.to_series().chosen([name]), simulation, self.settings.rate)
        r = simulation.setpoint
        assert r is not None
        at = r.names.index(self.settings.output or COMBINED)
        return replace(
            one,
            values=np.column_stack([r(one.t)[:, at], one.values]),
            names=(TARGET, CONTROL),
            units=(r.units[at], one.units[0]),
            facts={"control": name},
        )

    def read(self, series: Series) -> Series:
        pair = series.chosen([self.settings.target, self.settings.control or CONTROL])
        for name, unit in zip(pair.names, pair.units, strict=True):
            if not unit:
                raise DataError(f"{name}: has no unit; give one, as in '{name} [rad]'")
        return replace(pair, names=(TARGET, CONTROL))

    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundDoubleStep:
        table, seen = self.settings, []
        for one in completed(recordings):
            pairs = find_step_pairs(one.series, TARGET)
            seen.append(reconstruct_steps(one.series, CONTROL, pairs, latest=table.latest))
        isi, rt = np.concatenate([one.pairs.isi for one in seen]), np.concatenate([one.rt for one in seen])
        step = max(one.step for one in seen)
        told, shortest = explain_reactions(isi, rt, step), table.shortest
        if told.kind == "sampling":  # what falls into one sample is no refractoriness
            late = told.parameters["sampling"]["d_s"]
            beyond = grouped(isi[isi >= late], 1.5 * step)[0]
            shortest = max(shortest, late) if len(beyond) >= FEWEST_INTERVALS else shortest
        return FoundDoubleStep(refractoriness(isi, rt, alike=1.5 * step, shortest=shortest), told, seen[0])

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.double_step import double_step_figure

        of = [one.finding for one in found if isinstance(one.finding, FoundDoubleStep)]
        return double_step_figure(found, of[0].seen if of else None)
