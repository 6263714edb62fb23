"""Perturbed stance: the response of the body to a pseudo-random tilt of the surface on which it stands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field, model_validator

from icmj.base.array import Array, Finite, NonNegative, Positive
from icmj.case.case import Case, PlantKind
from icmj.controller.setpoint import TERNARY_INTERVALS, ternary
from icmj.experiments.multisine import Multisine
from icmj.experiments.recording import Recording
from icmj.experiments.stance_channels import CHANNEL_NUMBERS, StanceChannels, fit_channels
from icmj.report.experiment import Row
from icmj.runfile.schema import RunFile
from icmj.runfile.shapes import kind_of_course
from icmj.series.series import Series
from icmj.series.units import convert_to_si
from icmj.simulation.simulation import Simulation
from icmj.simulation.ternary import make_ternary_lines
from icmj.study.kind import HALF, CaseResult, Kind, Names, Rate, Word, sample_rows, say_first, set_duration
from icmj.study.periodic_response import (
    PeriodicResponse,
    analyse_trials,
    draw_response,
    expect_whole_samples,
    say_periods,
    take_periods,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


TILT, BODY = "stimulus", "body"


@dataclass(frozen=True, eq=False)
class FoundStance(PeriodicResponse):
    """Response of the body in space, remnant, and the fitted channels with their response; a :class:`Finding`.

    The response of the channels is in the place of theory.

    Attributes:
        channels: those whose response is nearest; ``None`` where no body was given to fit.
    """

    channels: StanceChannels | None = None

    @property
    def numbers(self) -> Mapping[str, float]:
        known = super().numbers
        found = {name: value for name, value in known.items() if name != "explained by continuous control"}
        if self.channels is None:
            return found
        found["explained by the fitted channels"] = self.measured.explained(self.theory)
        for name, unit, value, half in self._fitted():
            mark = f" ({unit})" if unit else ""
            found |= {f"{name}{mark}": value, f"{name}, from{mark}": value - half, f"{name}, to{mark}": value + half}
        return found

    def _fitted(self) -> list[tuple[str, str, float, float]]:
        """Name, unit, value and half the width of the 95 % confidence interval of each fitted number."""
        c = self.channels
        assert c is not None
        names = zip(CHANNEL_NUMBERS, ("N m/rad", "N m s/rad", "s", ""), strict=True)
        widths = np.full(4, np.nan) if c.half_widths is None else c.half_widths
        values = (c.P, c.D, c.delay, c.weight)
        return [(*name, value, float(half)) for name, value, half in zip(names, values, widths, strict=True)]

    @property
    def words(self) -> str:
        if self.channels is None:
            return super().words
        fitted = []
        for name, unit, value, half in self._fitted():
            low, middle, high = (f"{each:.3g}" for each in (value - half, value, value + half))
            interval = "" if low == high else f" ({low} to {high})"
            fitted.append(f"{name} {middle}{interval} {unit}".rstrip())
        share = self.measured.explained(self.theory)
        little = (f"the fitted channels explain {100 * share:.3g} % of the power",) if not share >= HALF else ()
        said = f"{super().words} Fitted channels, with 95 % intervals: {', '.join(fitted)}."
        return say_first((*self.channels.doubts, *little), said)


class PerturbedStanceTable(Kind):
    """A pseudo-random ternary tilt of the support surface, and the response of the angle of the body in space."""

    meaning: ClassVar[str] = "Perturbed stance: response to a pseudo-random tilt of the support surface."
    first_run: ClassVar[str] = "one-link-event"
    examples: ClassVar[Mapping[str, Any]] = {
        "output": "lean", "vertical": {"lean": 0.3}, "vertical_rate": {"lean_rate": 0.3}, "inertia": 60.0,
        "toppling": 588.6,
    }  # fmt: skip

    size: Positive
    """Peak-to-peak size of the tilt [rad]."""
    interval: Annotated[Positive, Field(ge=1e-2)] = 0.25
    """Duration of each velocity of the sequence [s]. The sequence repeats after 242 intervals."""
    highest: Positive = 2.0
    """Highest line of the stimulus [Hz]."""
    axis_height: NonNegative = 0.0
    """Height of the axis of the tilt in the world, which is that of the ankle [m]."""
    vertical: dict[str, Finite] = {}
    """Share of the tilt that is added to the reading of an output, by name: 1 − W, with the weight W of the surface."""
    vertical_rate: dict[str, Finite] = {}
    """The same share of the rate of the tilt, for outputs that are rates."""
    output: Word | None = None
    """Output that gives the angle of the body to the surface (default: the first)."""
    periods: Annotated[int, Field(ge=2, le=1000)] = 3
    """Number of periods that are analysed."""
    settle: Annotated[int, Field(ge=0, le=1000)] = 1
    """Number of periods before them, in which transients die out."""
    rate: Rate = 100.0
    """Sampling rate [Hz]."""
    inertia: Positive | None = None
    """Moment of inertia of a one-link person about the ankle [kg m²]. With this and the next three keys, the
    independent channels are fitted."""
    toppling: Positive | None = None
    """Toppling stiffness m g h [N m/rad]."""
    stiffness: NonNegative = 0.0
    """Passive stiffness of the ankle [N m/rad]."""
    damping: NonNegative = 0.0
    """Passive damping of the ankle [N m s/rad]."""
    stimulus: Word = "stimulus"
    """For a recording: column of the tilt [rad]."""
    response: Word = "body"
    """For a recording: column of the angle of the body in space [rad]."""

    @property
    def period(self) -> float:
        """Period of the sequence [s]."""
        return TERNARY_INTERVALS * self.interval

    @model_validator(mode="after")
    def _has_samples_and_lines(self) -> PerturbedStanceTable:
        expect_whole_samples(self.period, self.rate)
        if not 1 / self.period <= self.highest < self.rate / 2:
            raise ValueError(
                f"highest: {self.highest:g} Hz; expected between the first line, {1 / self.period:.3g} Hz, and half "
                "the rate"
            )
        if (self.inertia is None) != (self.toppling is None):
            raise ValueError("a fit needs both inertia and toppling")
        if self.inertia is None and (self.stiffness or self.damping):
            raise ValueError("stiffness and damping are those of a fit, which needs inertia and toppling")
        return self

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        own = {"axis_height": 0.06, "vertical": {"lean": 0.3}, "vertical_rate": {"lean_rate": 0.3}}
        return {"size": 0.0175, **(own if shipped else {})}

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        kept = [one.model_dump(exclude_unset=True) for one in run.simulation.disturbance]
        tilt: dict[str, Any] = {
            "kind": kind_of_course(ternary), "surface": "tilt", "size": self.size, "interval": self.interval,
            "bandwidth": self.highest, "point": [0.0, 0.0, self.axis_height],
            "vertical": self.vertical, "vertical_rate": self.vertical_rate,
        }  # fmt: skip
        duration = (self.settle + self.periods) * self.period
        return set_duration(run.with_(**{"simulation.disturbance": [*kept, tilt]}), duration, self.rate)

    @property
    def begin(self) -> float:
        return self.settle * self.period

    def record(self, case: Case, simulation: Simulation) -> Series:
        name = self.output or case.actual.linearisation.plant.outputs[0]
        one = sample_rows(simulation.to_series().chosen([f"y.{name}"]), simulation, self.rate, self.begin)
        tilt = self._tilt(one.t + (self.begin if len(one) > 1 else 0.0))
        values = np.column_stack([tilt, one.values[:, 0] + tilt])
        return replace(one, values=values, names=(TILT, BODY), units=("rad", "rad"), facts={"response": f"y.{name}"})

    def read(self, series: Series) -> Series:
        # channels are fitted to a body's angle under a tilt: volts or millimetres would have no stiffness in N m/rad
        pair = convert_to_si(series.chosen([self.stimulus, self.response]), "angle", "angle")
        return take_periods(self, self.period, replace(pair, names=(TILT, BODY)))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundStance:
        lines = self._lines()[:, 1] / (2 * np.pi)
        found = analyse_trials(recordings, (TILT, BODY), self.period, lines, simulated=case is not None)
        channels = self._channels(found.measured)
        theory = None if channels is None else channels.response(found.measured.line)
        return FoundStance(found.measured, theory, found.units, found.each, channels)

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        return draw_response(found)

    def _lines(self) -> Array:
        return make_ternary_lines(self.size, self.interval, self.highest)

    def _tilt(self, t: Array) -> Array:
        a, omega, phi = self._lines().T
        return np.asarray(np.cos(np.outer(t, omega) + phi) @ a)

    def _channels(self, found: Multisine) -> StanceChannels | None:
        if self.inertia is None or self.toppling is None:
            return None
        body = StanceChannels(self.inertia, self.toppling, self.stiffness, self.damping)
        return fit_channels(body, found.line, found.response, found.radius)

    def caption(self, rows: Sequence[Row]) -> str:
        return (
            "Gain (body in space divided by surface) and phase at the lines of the stimulus, with 95 % confidence "
            "intervals of the gain, and power of the angle of the body. Thin lines: the fitted channels. Small points: "
            "power between the lines of the stimulus (the remnant)."
        )

    def methods(self, recorded: bool) -> str:
        made = (
            f"The surface tilts by {np.degrees(self.size):.3g}° from peak to peak in a pseudo-random ternary sequence "
            f"of velocities of {self.interval:g} s; its lines up to {self.highest:g} Hz are the stimulus. "
            f"{say_periods(self.settle, self.periods)} "
        )
        return (
            ("" if recorded else made)
            + "The response of the angle of the body in space at each line is the mean over periods, and its "
            "confidence follows from their scatter. The remnant is the power at all other frequencies. Where inertia "
            "and toppling stiffness are given, delayed feedback of the angles to the surface and to the vertical is "
            "fitted to the response; intervals in brackets are 95 % confidence intervals from the scatter of the "
            "residuals."
        )


KIND = PerturbedStanceTable
