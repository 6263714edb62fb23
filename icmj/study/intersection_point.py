"""The experiment on the intersection point of ground reaction forces: noise moves the body, forces are read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.array import Array, between
from icmj.case.case import Case, PlantKind
from icmj.controller.controller import has_trigger
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import AnalysisError, DataError
from icmj.experiments.frequency_response import frequency_response
from icmj.experiments.intersection_point import (
    IntersectionPoint,
    averaged,
    force_angle,
    intersection_curve,
    intersection_point,
)
from icmj.experiments.recording import Recording, completed
from icmj.runfile.schema import RunFile
from icmj.runfile.stimulus_tables import IntersectionPointTable
from icmj.series.even import even_series
from icmj.series.series import Series
from icmj.simulation.disturbance import LOW_PASS_END
from icmj.simulation.simulation import Simulation
from icmj.simulation.sources import Gaussian, Noise, Source
from icmj.study.kind import Kind, Told, sampled, timed

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
        shown = [at for at in SHOWN if between(at, f[0], f[-1])]
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


class IntersectionPointKind(Kind):
    """See the module."""

    settings: IntersectionPointTable

    def stimulated(self, run: RunFile, seed: int) -> RunFile:
        return timed(run, self.settings.settle + self.settings.duration, self.settings.rate)

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        axis = self.settings.axis
        names = (f"force.{axis}", "force.z", f"cop.{axis}")
        force = ground_force(_model(case), simulation).chosen(names)
        return force_angle(sampled(force, simulation, self.settings.rate, self.settings.settle), *names[:2])

    def read(self, series: Series) -> Series:
        if self.settings.angle not in series.names:
            known = set(series.names)
            if not known.issuperset(self.settings.force):
                raise DataError(
                    f"no column {self.settings.angle!r}, nor {' and '.join(self.settings.force)}; it has "
                    f"{', '.join(series.names[:20])}"
                )
            series = force_angle(series, *self.settings.force)
            pair = series.chosen(["force_angle", self.settings.cop])
        else:
            pair = series.chosen([self.settings.angle, self.settings.cop])
        return even_series(replace(pair, names=("force_angle", f"cop.{self.settings.axis}")))

    def analysed(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundPoint:
        height = self.settings.height
        if height is None and case is not None:
            height = reaction(_model(case), self.settings.axis).height
        points = [
            intersection_point(
                one.series,
                "force_angle",
                f"cop.{self.settings.axis}",
                height=height,
                window=self.settings.window,
                band=(self.settings.low, self.settings.high),
            )
            for one in completed(recordings)
        ]
        if len({len(point.z) for point in points}) > 1:
            raise DataError("trials of several rates; analyse those of one rate together")
        mean, deviation = averaged(points)
        return FoundPoint(mean, deviation, None if case is None else self._theory(case, mean), tuple(points))

    def drawn(self, found: Sequence[Told]) -> Figure:
        from icmj.report.findings import intersection_figure

        return intersection_figure(found)

    def _theory(self, case: Case, like: IntersectionPoint) -> IntersectionPoint | None:
        """Curve of the continuous loop under noise alone; ``None`` if control is intermittent or has no curve."""
        law = case.controller
        if law.setpoint or (has_trigger(law) and law.trigger.kind == "event"):
            return None
        plant = case.actual.linearisation.plant
        try:
            response = frequency_response(plant, law, like.frequency, match="position")
            H = []
            ground = reaction(_model(case), self.settings.axis)
            for source in case.settings.disturbance:
                if (column := _signal(source, response.signals)) is None:
                    return None
                effect = response.x[:, :, column] @ ground.C.T + response.applied[:, :, column] @ ground.D.T
                H.append(effect * _density(source, like.frequency)[:, None])
        except AnalysisError:
            return None
        return intersection_curve(like.frequency, np.stack(H, axis=2), np.ones(len(H)), like.height) if H else None


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
        return np.asarray(source.size / np.sqrt(whole) * between(frequency, 0.0, end * source.corner))
    if isinstance(source, Noise):
        assert source.bandwidth is not None
        return np.asarray(source.size / np.sqrt(source.bandwidth) * between(frequency, 0.0, source.bandwidth))
    return (
        np.full(len(frequency), source.size * np.sqrt(2 * source.interval)) * np.sinc(frequency * source.interval) ** 2
    )
