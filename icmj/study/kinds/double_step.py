"""Double steps: pairs of steps of a set-point, and how late each is responded to."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from inspect import signature
from itertools import product
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from icmj.base.array import MOST_ENTRIES, Array, Finite, NonNegative, Positive, Positives
from icmj.case.case import Case, PlantKind
from icmj.controller.step_pairs import double_steps, find_step_pairs
from icmj.errors import DataError
from icmj.experiments.reconstruction import EARLIEST, Reconstruction, reconstruct_steps
from icmj.experiments.recording import Recording, keep_complete
from icmj.experiments.refractoriness import DIRECTIONS, Explanation, Reactions, Refractoriness, analyse_reactions
from icmj.report import style
from icmj.report.experiment import Row
from icmj.report.findings import LINE, ShownResult, assign_colours, draw_reconstruction, under_legend
from icmj.runfile.schema import RunFile
from icmj.runfile.shapes import kind_of_course
from icmj.runfile.table import LISTED, Line, keys_of
from icmj.series.even_rows import measure_row_step
from icmj.series.series import EVEN, Series
from icmj.simulation.simulation import Simulation
from icmj.study.kind import HALF, CaseResult, Kind, Names, Rate, Word, sample_rows, say_first, set_duration

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TARGET, CONTROL, COMBINED = "target", "control", "followed"


@dataclass(frozen=True, eq=False)
class FoundDoubleStep:
    """Refractory duration and kind of controller, of all trials together; a :class:`Finding`.

    People were found to be refractory at reversals only (van de Kamp et al. 2013), so both directions are analysed by
    themselves, and all pairs together only if nothing is found in which the directions differ.

    Attributes:
        directions: results of each direction that has enough pairs, by name.
        pooled: result of all pairs; ``None`` if the directions differ.
        seen: the first trial as it was reconstructed.
        doubts: why reaction times may be none, said first.
    """

    directions: Mapping[str, Reactions]
    pooled: Reactions | None
    seen: Reconstruction
    doubts: tuple[str, ...] = ()

    @property
    def refractory(self) -> Refractoriness | None:
        """The estimates of all pairs; ``None`` if the directions differ."""
        return self.pooled.refractory if self.pooled else None

    @property
    def told(self) -> Explanation | None:
        """The kind of controller that explains all pairs; ``None`` if the directions differ."""
        return self.pooled.explanation if self.pooled else None

    @property
    def numbers(self) -> Mapping[str, float]:
        return {name: value for prefix, one in self._parts for name, value in _prefix(prefix, one.numbers).items()}

    @property
    def deviations(self) -> Mapping[str, float]:
        return {}

    @property
    def curves(self) -> Mapping[str, Array]:
        """Those of all pairs and of each direction; NaN behind the last interval of one that has fewer."""
        curves = {name: of for prefix, one in self._parts for name, of in _prefix(prefix, one.curves).items()}
        most = max(map(len, curves.values()))
        return {name: np.append(of, np.full(most - len(of), np.nan)) for name, of in curves.items()}

    @property
    def words(self) -> str:
        return say_first(self.doubts, self._result)

    @property
    def _result(self) -> str:
        if self.pooled is None:
            each = " ".join(f"{name[:1].upper()}{name[1:]}: {one.words}." for name, one in self.directions.items())
            return f"The two directions differ. {each}"
        sure = len(self.directions) == len(DIRECTIONS)
        same = self.seen.pairs.same
        alike = ", and the same in both directions" if sure else ", too few to compare both directions"
        if not sure and (same.all() or not same.any()):
            alike = f", all of them {'in the same direction' if same.all() else 'reversals'}"
        return f"{self.pooled.words[:1].upper()}{self.pooled.words[1:]}{alike}."

    @property
    def _parts(self) -> list[tuple[str, Reactions]]:
        return [
            *([("", self.pooled)] if self.pooled else []),
            *((f"{name}, ", of) for name, of in self.directions.items()),
        ]


AT_END = 0.05  # share of reaction times at an end of their range that is told; the bound is ours


def _doubts(seen: Sequence[Reconstruction], latest: float) -> tuple[str, ...]:
    """Why reaction times may be none: many at an end of the range sought, or a model that explains too little."""
    said, explained = [], np.concatenate([one.explained for one in seen])
    late = np.concatenate([((one.rt < EARLIEST + one.step) | (one.rt > latest - one.step)).ravel() for one in seen])
    if (share := float(late.mean())) > AT_END:
        said.append(
            f"{100 * share:.0f} % of the reaction times are at an end of the range sought, {EARLIEST:g} to {latest:g} s"
        )
    if (little := int((explained < HALF).sum())) > len(explained) / 2:
        said.append(
            f"the linear model explains less than half of the control around {little} of {len(explained)} pairs, "
            "which are left out"
        )
    return tuple(said)


def _prefix(prefix: str, named: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{prefix}{name}": of for name, of in named.items()}


@keys_of(double_steps, without=("seed", "start"))
class DoubleStepTable(Kind):
    """Double steps: pairs of steps of a set-point, in random order."""

    meaning: ClassVar[str] = "Double steps: reaction times and refractory duration."
    first_run: ClassVar[str] = "simple-exact"
    first_changes: ClassVar[Mapping[str, Any]] = {
        "assumed": {"delay": 0.14}, "controller": {"delta_min": 0.35}, "simulation": {"initial": {"hinge": 0}}
    }  # fmt: skip
    examples: ClassVar[Mapping[str, Any]] = {
        "combination": {"shank": 0.44, "thigh": 0.44, "trunk": 0.69}, "unit": "m", "control": "u.torque"
    }  # fmt: skip

    output: Word | None = None
    """Output, or state, of the assumed plant that follows the steps. Give either ``output`` or ``combination``."""
    combination: Annotated[dict[str, Finite], Field(min_length=1, max_length=MOST_ENTRIES)] = {}
    """Weights of several outputs or states, such as ``{ shank = 0.44, thigh = 0.44, trunk = 0.69 }`` for the head."""
    unit: Line = ""
    """Unit of a combination."""
    size: Positive
    isi: Annotated[Positives, Field(min_length=3, max_length=MOST_ENTRIES)]
    repetitions: Annotated[int, Field(ge=1, le=10_000)] = 5
    """Number of repetitions of each interval in each direction, in one trial."""
    directions: Annotated[list[Literal["same", "reversal"]], Field(min_length=1, max_length=2)] = ["same", "reversal"]
    recovery: Annotated[tuple[Positive, Positive], LISTED] = (2.0, 3.0)
    rate: Rate = 100.0
    """Sampling rate [Hz]."""
    latest: Positive = 1.0
    """Longest reaction time that is considered [s]. It must not exceed the shortest recovery."""
    shortest: NonNegative = 0.0
    """Shortest inter-step interval that the regressions use [s]."""
    control: Word | None = None
    """Signal that responds, such as u.ankle_torque (default: the first command; in a recording, the column control)."""
    target: Word = "target"
    """For a recording: column of the set-point."""

    @model_validator(mode="after")
    def _responses_end_before_the_next_pair(self) -> DoubleStepTable:
        if (self.output is None) == (not self.combination):
            raise ValueError("give one of output and combination")
        if self.latest > self.recovery[0]:
            raise ValueError(
                f"latest of {self.latest:g} s is longer than the least recovery, {self.recovery[0]:g} s; lengthen that"
            )
        if self.recovery[0] > self.recovery[1]:
            raise ValueError("recovery: give the shortest time first, then the longest")
        if len(set(self.isi)) < len(self.isi) or len(set(self.directions)) < len(self.directions):
            raise ValueError("isi and directions: an entry is repeated")
        return self

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        return {"output": names.outputs[0], "size": 0.02, "isi": [0.1, 0.2, 0.4, 0.8], "recovery": [2.5, 3.5]}

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        keys = {"output", "combination", "unit", *signature(double_steps).parameters}
        steps = {"kind": kind_of_course(double_steps)} | ({"name": COMBINED} if self.combination else {})
        steps |= self.model_dump(include=keys, exclude_defaults=True) | {"seed": seed}
        kept = [one.model_dump(exclude_defaults=True, exclude_none=True) for one in run.setpoint]
        moved = run.with_(setpoint=[*kept, steps])
        end = moved.setpoint[-1].whole
        assert end is not None
        return set_duration(moved, end, self.rate)

    def record(self, case: Case, simulation: Simulation) -> Series:
        name = self.control or f"u.{simulation.labels.inputs[0]}"
        one = sample_rows(simulation.to_series().chosen([name]), simulation, self.rate)
        r = simulation.setpoint
        assert r is not None
        at = r.names.index(self.output or COMBINED)
        return replace(
            one,
            values=np.column_stack([r(one.t)[:, at], one.values]),
            names=(TARGET, CONTROL),
            units=(r.units[at], one.units[0]),
            facts={"control": name},
        )

    def read(self, series: Series) -> Series:
        pair = series.chosen([self.target, self.control or CONTROL])
        for name, unit in zip(pair.names, pair.units, strict=True):
            if not unit:
                raise DataError(f"{name}: has no unit; give one, as in '{name} [rad]'")
        rate, step = self.stated("rate"), measure_row_step(pair.t) if len(pair) > 1 else np.nan
        if rate is not None and abs(rate * step - 1) > EVEN:
            raise DataError(
                f"{1 / step:.6g} rows a second, and rate = {rate:g} in the file; a control that jumps cannot be "
                "resampled, leave rate out"
            )
        return replace(pair, names=(TARGET, CONTROL))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundDoubleStep:
        seen = []
        for one in keep_complete(recordings):
            pairs = find_step_pairs(one.series, TARGET)
            seen.append(reconstruct_steps(one.series, CONTROL, pairs, latest=self.latest))
        isi, rt = np.concatenate([one.pairs.isi for one in seen]), np.concatenate([one.rt for one in seen])
        same, step = np.concatenate([one.pairs.same for one in seen]), max(one.step for one in seen)
        directions = {}
        for name, of in zip(DIRECTIONS, (same, ~same), strict=True):
            with suppress(DataError):  # too few pairs
                directions[name] = analyse_reactions(isi[of], rt[of], step, self.shortest)
        agree = len(directions) < len(DIRECTIONS) or directions[DIRECTIONS[0]].agrees(directions[DIRECTIONS[1]])
        pooled = analyse_reactions(isi, rt, step, self.shortest) if agree else None
        return FoundDoubleStep(directions, pooled, seen[0], _doubts(seen, self.latest))

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        of = [one.finding for one in found if isinstance(one.finding, FoundDoubleStep)]
        return draw_reaction_times(found, of[0].seen if of else None)

    def caption(self, rows: Sequence[Row]) -> str:
        return (
            "Left: mean reaction times against the interval between the steps, to the first step (open circles) and to "
            "the second (filled circles); bars are twice the standard error. Where directions differ, squares are "
            "pairs of steps in the same direction, and circles reversals. Right: one pair of steps, with the control "
            "signal, the fitted linear model, and the steps at their true times and moved by the reaction times; the "
            "steps are drawn below the control, and not to scale."
        )

    def methods(self, recorded: bool) -> str:
        isi = ", ".join(f"{each:g}" for each in self.isi)
        size = f"{self.size:g} {self.unit}" if self.unit else f"{self.size:g} in the unit of {self.output}"
        made = f"A target makes pairs of steps of {size}, {isi} s apart, {self.repetitions} times in each direction. "
        return (
            ("" if recorded else made)
            + "A linear model of the response of the control signal to the target is fitted; each reaction time is the "
            "delay by which the model must move its step. Refractory periods are estimated by four methods: the "
            "intercept of a line that the second reaction time follows (free regression), the same with slope −1, the "
            "largest interval at which it is longer than the first, and its range. Intervals in brackets are 95 % "
            "confidence intervals from resampled pairs. BIC is the Bayesian information criterion of each kind of "
            "controller, minus that of the best. Pairs in the same direction and reversals are analysed by themselves; "
            "results of all pairs are given only if both are of one kind and their intervals of slope −1 overlap, or "
            "one direction has too few pairs."
        )


def draw_reaction_times(found: Sequence[ShownResult], example: Reconstruction | None) -> Figure:
    """RT1 (open) and RT2 (filled) of every case against the interval, and one reversal as it was reconstructed.

    Of a case whose directions differ, both are drawn.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

    figure = Figure(figsize=(170 * style.MM, 80 * style.MM))
    times, pair = (figure.add_axes((left, 0.13, wide, 0.82)) for left, wide in ((0.075, 0.47), (0.635, 0.35)))
    apart = False
    for one, colour in assign_colours(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        look: dict[str, Any] = {
            "color": colour,
            "linewidth": 1.0,
            "linestyle": LINE[one.plant],
            "capsize": 1.5,
            "elinewidth": 0.6,
        }
        of = ("",) if "ISI (s)" in curves else tuple(f"{name}, " for name in DIRECTIONS)
        apart = apart or len(of) > 1
        for part, (name, fill) in product(of, (("RT1", "none"), ("RT2", "full"))):
            isi, rt, error = (curves[f"{part}{what} (s)"] for what in ("ISI", name, f"{name}, error"))
            look["marker"] = "s" if part.startswith(DIRECTIONS[0]) else "o"
            times.errorbar(isi, rt, 2 * error, markersize=3.5, fillstyle=fill, **look)
    times.set(xlabel="interval between the steps (s)", ylabel="reaction time (s)", xlim=(0, None))
    low, high = times.get_ylim()
    times.set_ylim(0, high + 0.08 * (high - low))
    ring: dict[str, Any] = {"color": "#555555", "linestyle": "none", "marker": "o", "markersize": 4}
    handles = [
        Line2D([], [], fillstyle="none", label="first step", **ring),
        Line2D([], [], label="second step", **ring),
    ]
    if apart:
        handles += [
            Line2D([], [], label=name, **ring | {"marker": m}) for name, m in zip(DIRECTIONS, "so", strict=True)
        ]
    times.legend(handles=handles, loc="upper right", ncols=2)
    under_legend(figure, [times, pair], found)
    if example is not None:
        turned = np.flatnonzero(~example.pairs.same & np.isfinite(example.rt).all(axis=1))
        shown = turned if len(turned) else np.arange(len(example.pairs))
        draw_reconstruction(pair, example, int(shown[np.argsort(example.pairs.isi[shown])[len(shown) // 4]]))
        low, high = pair.get_ylim()
        pair.set_ylim(low, high + 0.22 * (high - low))
        pair.legend(loc="upper right", ncols=2)
    return figure


KIND = DoubleStepTable
