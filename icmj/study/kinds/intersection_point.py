"""Intersection point of ground reaction forces: noise moves the body, forces are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import model_validator

from icmj.base.array import Array, NonNegative, Positive, is_between
from icmj.case.case import Case, PlantKind
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import AnalysisError, DataError
from icmj.experiments.intersection import (
    IntersectionPoint,
    average,
    force_angle,
    intersection_curve,
    intersection_point,
)
from icmj.experiments.linear_response import frequency_response
from icmj.experiments.recording import Recording, keep_complete
from icmj.report import style
from icmj.report.experiment import Row
from icmj.report.findings import LINE, ShownResult, assign_colours, under_legend
from icmj.runfile.schema import RunFile
from icmj.runfile.table import LISTED
from icmj.series.even_rows import resample_series
from icmj.series.series import Series
from icmj.simulation.disturbance import LOW_PASS_END
from icmj.simulation.simulation import Simulation
from icmj.simulation.sources import Gaussian, Noise, Source
from icmj.study.kind import CaseResult, Kind, Names, Rate, Word, cut_recording, sample_rows, set_duration

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SHOWN = (0.5, 1.0, 2.0, 4.0, 7.0)  # Hz


@dataclass(frozen=True, eq=False)
class FoundPoint:
    """Mean over trials, its deviation, and theory where the loop is linear; a :class:`Finding`.

    Attributes:
        point: the mean.
        deviation: of z over trials [m], shape (F,).
        theory: of the same loop at the same frequencies, or ``None``.
        each: the trials.
    """

    point: IntersectionPoint
    deviation: Array
    theory: IntersectionPoint | None
    each: tuple[IntersectionPoint, ...] = ()

    @property
    def unit(self) -> tuple[float, str]:
        """What z is divided by, and what comes of it."""
        return (1.0, "m") if self.point.height is None else (self.point.height, "z/h")

    @property
    def numbers(self) -> Mapping[str, float]:
        return self._numbers(self.point)

    @property
    def deviations(self) -> Mapping[str, float]:
        if len(self.each) < 2:
            return {}
        each = [self._numbers(point) for point in self.each]
        return {name: float(np.std([one[name] for one in each], ddof=1)) for name in self.numbers}

    def _numbers(self, point: IntersectionPoint) -> dict[str, float]:
        f, (by, unit) = point.frequency, self.unit
        shown = [at for at in SHOWN if is_between(at, f[0], f[-1])]
        found = {f"z at {at:g} Hz ({unit})": float(np.interp(at, f, point.z / by)) for at in shown}
        if point.height is not None:
            found["crosses the centre of mass at (Hz)"] = point.crossing()
        found["share of variance"] = float(point.share.mean())
        return found

    @property
    def curves(self) -> Mapping[str, Array]:
        by, _ = self.unit
        theory = np.full(len(self.point.z), np.nan) if self.theory is None else self.theory.z
        return {
            "frequency (Hz)": self.point.frequency,
            "z (m)": self.point.z,
            "deviation (m)": self.deviation,
            "z/h": self.point.z / by if self.point.height else np.full(len(theory), np.nan),
            "share": self.point.share,
            "theory (m)": theory,
        }

    @property
    def words(self) -> str:
        point, (by, _) = self.point, self.unit
        low, high = point.z[0] / by, point.z[-1] / by
        goes = "falls" if high < low else "rises"
        one, again = (" m", " m") if point.height is None else (" times the height of the centre of mass", " times")
        said = f"The intersection point {goes} from {low:.3g}{one} at {point.frequency[0]:.2g} Hz to {high:.3g}{again} "
        said += f"at {point.frequency[-1]:.2g} Hz"
        crossing = point.crossing() if point.height else np.nan
        spread = self.deviations.get("crosses the centre of mass at (Hz)", np.nan)
        sure = f" ± {spread:.2g}" if np.isfinite(spread) else ""
        where = f", and crosses the centre of mass at {crossing:.3g}{sure} Hz" if np.isfinite(crossing) else ""
        return f"{said}{where}; the line explains at least {100 * point.share.min():.0f} % of the variance."


class IntersectionPointTable(Kind):
    """Intersection point of ground reaction forces: windows, and range of frequencies.

    The noise in the run file moves the body.
    """

    meaning: ClassVar[str] = "Intersection point of ground reaction forces."
    first_run: ClassVar[str] = "quiet-standing"
    examples: ClassVar[Mapping[str, Any]] = {"height": 0.95}
    readable: ClassVar[bool] = False

    duration: Positive = 60.0
    """Duration of the part of a trial that is analysed [s]."""
    settle: NonNegative = 10.0
    """Duration before this part, which is left out [s]."""
    rate: Rate = 100.0
    """Sampling rate [Hz]."""
    window: Positive = 5.12
    """Length of a window [s]. Windows overlap by half."""
    low: Positive = 0.4
    """Lowest frequency [Hz]."""
    high: Positive = 8.0
    """Highest frequency [Hz]."""
    axis: Literal["x", "y"] = "x"
    """Direction in the world: forwards or sideways."""
    height: Positive | None = None
    """Height of the centre of mass above the ground [m] (default: that of the model; needed for ratios of a recording).
    """
    angle: Word = "force_angle"
    """For a recording: column of the angle −F_x / F_z [rad, deg], instead of ``force``."""
    force: Annotated[tuple[Word, Word], LISTED] = ("force.x", "force.z")
    """For a recording: columns of the horizontal and the vertical force (default: those along ``axis``)."""
    cop: Word = "cop.x"
    """For a recording: column of the centre of pressure [m, cm, mm] (default: that along ``axis``)."""

    @model_validator(mode="after")
    def _has_one_source_of_the_angle(self) -> IntersectionPointTable:
        if {"angle", "force"} <= self.model_fields_set:
            raise ValueError("angle and force: give one, the angle of the force is read or computed")
        return self

    @classmethod
    def first_values(cls, names: Names, shipped: bool) -> dict[str, Any]:
        return {"duration": 60.0}

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        return set_duration(run, self.settle + self.duration, self.rate)

    @property
    def begin(self) -> float:
        return self.settle

    def record(self, case: Case, simulation: Simulation) -> Series:
        axis = self.axis
        names = (f"force.{axis}", "force.z", f"cop.{axis}")
        force = ground_force(_model(case), simulation).chosen(names)
        return force_angle(sample_rows(force, simulation, self.rate, self.begin), *names[:2])

    def read(self, series: Series) -> Series:
        axis = self.axis
        angle, force = self.stated("angle"), self.stated("force") or (f"force.{axis}", "force.z")
        cop = self.stated("cop") or f"cop.{axis}"
        if angle is None and self.stated("force") is None and not set(series.names).issuperset(force):
            angle = self.angle
            if angle not in series.names:
                raise DataError(
                    f"no column {angle!r}, nor {' and '.join(force)}; it has {', '.join(series.names[:20])}"
                )
        settle, duration, rate = map(self.stated, ("settle", "duration", "rate"))
        wanted = [cop, *(force if angle is None else (angle,))]
        found = cut_recording(series.chosen(wanted), settle, duration, "settle and duration")
        if angle is None:
            found, angle = force_angle(found, *force), "force_angle"
        return resample_series(replace(found.chosen([angle, cop]), names=("force_angle", f"cop.{axis}")), rate)

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundPoint:
        height = self.height
        if height is None and case is not None:
            height = reaction(_model(case), self.axis).height
        points = [
            intersection_point(
                one.series,
                "force_angle",
                f"cop.{self.axis}",
                height=height,
                window=self.window,
                band=(self.low, self.high),
            )
            for one in keep_complete(recordings)
        ]
        if len({len(point.z) for point in points}) > 1:
            raise DataError("trials of several rates; analyse those of one rate together")
        mean, deviation = average(points)
        return FoundPoint(mean, deviation, None if case is None else self._theory(case, mean), tuple(points))

    def draw(self, found: Sequence[CaseResult]) -> Figure:
        return draw_heights(found)

    def _theory(self, case: Case, like: IntersectionPoint) -> IntersectionPoint | None:
        """Curve of the continuous loop under noise alone; ``None`` if control is intermittent or has no curve."""
        law = case.controller
        if law.setpoint or law.event_rule:
            return None
        plant = case.actual.linearisation.plant
        try:
            response = frequency_response(plant, law, like.frequency, match="position")
            H = []
            ground = reaction(_model(case), self.axis)
            for source in case.settings.disturbance:
                if (column := _signal(source, response.signals)) is None:
                    return None
                effect = response.x[:, :, column] @ ground.C.T + response.applied[:, :, column] @ ground.D.T
                H.append(effect * _density(source, like.frequency)[:, None])
        except AnalysisError:
            return None
        return intersection_curve(like.frequency, np.stack(H, axis=2), np.ones(len(H)), like.height) if H else None

    def caption(self, rows: Sequence[Row]) -> str:
        return (
            "Height of the intersection point, divided by that of the centre of mass where this is known. Faint bands: "
            "one standard deviation over trials on either side of the mean. Thin line: linear theory of continuous "
            "control. Dotted: height of the centre of mass."
        )

    def methods(self, recorded: bool) -> str:
        made = f"{self.settle:g} s at the start of each trial are left out, and {self.duration:g} s are analysed. "
        return (
            ("" if recorded else made)
            + "The lines of action of the ground reaction force meet at the height z. It follows from the "
            f"cross-spectrum of the angle of the force and the centre of pressure, in windows of {self.window:g} s "
            f"that overlap by half, from {self.low:g} to {self.high:g} Hz; the share of variance is what this line "
            "explains."
        )


def _model(case: Case) -> MujocoPlant:
    if isinstance(case.actual, MujocoPlant):
        return case.actual
    raise AnalysisError(f"{case.run.path}: a plant given by matrices has no weight; the ground's force needs a model")


def _signal(source: Source, signals: Sequence[str]) -> int | None:
    """The index of the loop's signal that is a noise of constant size; ``None`` if there is no such signal."""
    shared = isinstance(source, Gaussian) and source.share
    if not isinstance(source, Noise | Gaussian) or source.push is not None or shared:
        return None
    name = f"d.{source.input}" if source.input is not None else f"n.{source.output}"
    return signals.index(name) if name in signals else None


def _density(source: Source, frequency: Array) -> Array:
    """Root of the density of its spectrum, up to a factor that is the same for all noises."""
    assert isinstance(source, Noise | Gaussian)
    if source.corner is not None:
        # a sum of sinusoids ends somewhere
        end = LOW_PASS_END if isinstance(source, Noise) else np.inf
        whole = source.corner * np.arctan(end) * (1 + (frequency / source.corner) ** 2)
        return np.asarray(source.size / np.sqrt(whole) * is_between(frequency, 0.0, end * source.corner))
    if isinstance(source, Noise):
        assert source.bandwidth is not None
        return np.asarray(source.size / np.sqrt(source.bandwidth) * is_between(frequency, 0.0, source.bandwidth))
    return (
        np.full(len(frequency), source.size * np.sqrt(2 * source.interval)) * np.sinc(frequency * source.interval) ** 2
    )


def draw_heights(found: Sequence[ShownResult]) -> Figure:
    """z over the height of the centre of mass against frequency; dotted: that height, thin: theory."""
    figure, (axes,) = style.new_figure(80.0, width=140.0)
    ratios, lowest = True, 1.0
    for one, colour in assign_colours(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        f, ratio = curves["frequency (Hz)"], curves["z/h"]
        ratios = ratios and bool(np.isfinite(ratio).all())
        z = ratio if ratios else curves["z (m)"]
        by = _by(curves) if ratios else 1.0
        axes.semilogy(f, z, color=colour, linestyle=LINE[one.plant], linewidth=1.3)
        spread = curves["deviation (m)"] / by
        if np.isfinite(spread).all() and (spread > 0).any():
            axes.fill_between(f, np.maximum(z - spread, 1e-3), z + spread, color=colour, alpha=0.15, linewidth=0)
        if one.plant != "mujoco":
            axes.semilogy(f, curves["theory (m)"] / by, color="#222222", linewidth=0.6, zorder=3)
        lowest = min(lowest, float(z[np.isfinite(z) & (z > 0)].min(initial=1.0)))
    axes.set_ylim(bottom=0.6 * lowest)
    if ratios:
        axes.axhline(1.0, **style.CRITICAL)
    axes.set(xlabel="frequency (Hz)", ylabel="intersection point, $z/h$" if ratios else "intersection point (m)")
    axes.set_yticks([0.2, 0.5, 1, 2, 5], labels=["0.2", "0.5", "1", "2", "5"])
    axes.minorticks_off()
    under_legend(figure, [axes], found)
    return figure


def _by(curves: Mapping[str, Array]) -> float:
    """The height of the centre of mass by which results are divided [m]."""
    good = curves["z/h"] != 0
    return float(np.median(curves["z (m)"][good] / curves["z/h"][good]))


KIND = IntersectionPointTable
