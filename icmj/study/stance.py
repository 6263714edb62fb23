"""Kinds of experiment on stance: multi-sine, perturbed stance, intersection point.

The multi-sine experiment: a periodic stimulus of chosen lines, as disturbance or as set-point.

Perturbed stance: the response to a pseudo-random tilt of the support surface.

The experiment on the intersection point of ground reaction forces: noise moves the body, forces are read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from icmj.base.array import Array, between, steps_in
from icmj.case.case import Case, PlantKind
from icmj.controller.controller import has_trigger
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import ground_force, reaction
from icmj.errors import AnalysisError, DataError
from icmj.experiments.multisine import (
    CHANNEL_NUMBERS,
    Multisine,
    StanceChannels,
    fit_channels,
    frequency_response,
    multisine,
)
from icmj.experiments.quiet_standing import (
    IntersectionPoint,
    Recording,
    average,
    force_angle,
    intersection_curve,
    intersection_point,
    keep_complete,
)
from icmj.runfile.schema import RunFile
from icmj.runfile.table import TomlTable
from icmj.series.even_rows import even_series
from icmj.series.series import EVEN, SETTLED, Series
from icmj.series.units import in_si
from icmj.simulation.disturbance import LOW_PASS_END, ternary_lines
from icmj.simulation.settings import Gaussian, Noise, Sinusoids, Source
from icmj.simulation.simulation import Simulation
from icmj.study.experiment_file import IntersectionPointTable, MultisineTable, PerturbedStanceTable
from icmj.study.kind import HALF, CaseResult, Kind, cut_recording, sample_rows, say_first, set_duration

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STIMULUS, RESPONSE = "stimulus", "response"
LEAST = 0.01  # %: a smaller share of the power is called so
NOTHING = 1e-6  # share of a stimulus's power off its lines that is not told: rounding of a file


@dataclass(frozen=True, eq=False)
class FoundMultisine:
    """Response and remnant, and the continuous controller's response; a :class:`Finding`.

    Attributes:
        measured: over all periods.
        theory: of the linear loop at the excited lines, or that of the continuous controller of the same design, shape
            (L,); ``None`` where there is none.
        units: of stimulus and response.
        each: of each trial alone; empty for one trial.
    """

    measured: Multisine
    theory: np.ndarray | None
    units: tuple[str, str]
    each: tuple[Multisine, ...] = ()

    @property
    def numbers(self) -> Mapping[str, float]:
        return self._numbers(self.measured)

    @property
    def deviations(self) -> Mapping[str, float]:
        each = [self._numbers(one) for one in self.each]
        return {name: float(np.std([one[name] for one in each], ddof=1)) for name in each[0]} if each else {}

    def _numbers(self, found: Multisine) -> dict[str, float]:
        theory = np.nan if self.theory is None else found.explained(self.theory)
        return {
            "remnant, share of power": found.remnant,
            "explained by the best linear model": found.explained(),
            "explained by continuous control": theory,
            "coherence, mean": float(np.nanmean(found.coherence)) if np.isfinite(found.coherence).any() else np.nan,
            f"RMS ({self.units[1]})": float(np.sqrt(found.power.sum())),
        }

    @property
    def curves(self) -> Mapping[str, Array]:
        found = self.measured
        place = {name: np.full(len(found.frequency), np.nan) for name in ("real", "imag", "radius", "coherence")}
        theory = np.full((len(found.frequency), 2), np.nan)
        for name, values in (
            ("real", found.response.real),
            ("imag", found.response.imag),
            ("radius", found.radius),
            ("coherence", found.coherence),
        ):
            place[name][found.excited] = values
        if self.theory is not None:
            theory[found.excited] = np.column_stack([self.theory.real, self.theory.imag])
        return {
            "frequency (Hz)": found.frequency,
            "power": found.power,
            "excited": found.excited.astype(float),
            **place,
            "theory, real": theory[:, 0],
            "theory, imag": theory[:, 1],
        }

    @property
    def words(self) -> str:
        found = self.measured
        spread = 100 * self.deviations.get("remnant, share of power", np.nan)
        share, sure = 100 * found.remnant, f" ± {spread:.2g}" if spread >= LEAST else ""
        remnant = f"less than {LEAST:g} %" if share < LEAST else f"{share:.3g}{sure} %"
        said = f"{remnant} of the power is at frequencies that the stimulus does not contain; the best linear model "
        said = f"{said}explains {100 * found.explained():.3g} %, over {found.periods} periods."
        if found.off_lines > NOTHING:
            said += f" {100 * found.off_lines:.2g} % of the stimulus's power is off its lines, and counts as remnant."
        return f"{said[0].upper()}{said[1:]}"


class MultisineKind(Kind):
    """See the module."""

    settings: MultisineTable

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        table = self.settings
        a, lines, phases = table.amplitude, table.lines, _phases(len(table.lines), seed)
        if table.input is not None:
            key, kept = "simulation.disturbance", [_plain(one) for one in run.simulation.disturbance]
            terms = [[a, 2 * np.pi * f, phi] for f, phi in zip(lines, phases, strict=True)]
            sines: dict[str, Any] = {"kind": "sinusoids", "input": table.input, "on": "command", "terms": terms}
        else:
            key, kept = "setpoint", [_plain(one) for one in run.setpoint]
            # a set-point is of sines, a disturbance of cosines
            turned = [phi + np.pi / 2 for phi in phases]
            sines = {"kind": "sines", "output": table.setpoint, "size": a, "frequencies": lines, "phases": turned}
        duration = (table.settle + table.periods) * table.period
        return set_duration(run.with_(**{key: [*kept, sines]}), duration, table.rate)

    @property
    def begin(self) -> float:
        return self.settings.settle * self.settings.period

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        whole = simulation.to_series()
        name = self._response(simulation.labels.inputs)
        pair = whole.chosen([name])
        one = sample_rows(pair, simulation, self.settings.rate, self.begin)
        t = one.t + (self.begin if len(one) > 1 else 0.0)
        stimulus, unit = self._stimulus(case, simulation, t)
        return replace(
            one,
            values=np.column_stack([stimulus, one.values]),
            names=(STIMULUS, RESPONSE),
            units=(unit, one.units[0] or "1"),
            facts={"response": name},
        )

    def read(self, series: Series) -> Series:
        if self.settings.response is None:
            raise DataError("[multisine] response says which column of a recording is analysed; give it")
        pair = series.chosen([self.settings.stimulus, self.settings.response])
        return take_periods(self, replace(pair, names=(STIMULUS, RESPONSE)))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundMultisine:
        trials = [one.series for one in keep_complete(recordings)]
        table = self.settings
        if case is not None:
            trials = [_whole_periods(one, table.period) for one in trials]
        how: dict[str, Any] = {"period": table.period, "lines": table.lines}
        found, each = analyse_trials(trials, STIMULUS, RESPONSE, how)
        units = (trials[0].units[0], trials[0].units[1])
        return FoundMultisine(found, None if case is None else self._theory(case, found.line), units, each)

    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
        from icmj.report.findings import multisine_figure

        units = (one.finding.units for one in found if isinstance(one.finding, FoundMultisine))
        return multisine_figure(found, next(units, ("", "")))

    def _response(self, inputs: Sequence[str]) -> str:
        return self.settings.response or f"u.{self.settings.input or inputs[0]}"

    def _stimulus(self, case: Case, simulation: Simulation, t: Array) -> tuple[Array, str]:
        """Its values at times of the run, and its unit."""
        if self.settings.input is None:
            r = simulation.setpoint
            assert r is not None
            at = r.names.index(str(self.settings.setpoint))
            return r(t)[:, at], r.units[at] or "1"
        source = case.settings.disturbance[-1]
        assert isinstance(source, Sinusoids)
        units = dict(zip(simulation.labels.inputs, simulation.labels.input_units, strict=False))
        values = sum((a * np.cos(omega * t + phi) for a, omega, phi in source.terms), 0 * t)
        return values, units.get(source.input or "") or "1"

    def _theory(self, case: Case, line: Array) -> np.ndarray | None:
        law = case.controller
        plant = case.actual.linearisation.plant
        try:
            found = frequency_response(plant, law, line, match="position")
            signal = found.of(f"d.{self.settings.input}" if self.settings.input else f"r.{self.settings.setpoint}")
        except AnalysisError:
            return None
        kind, _, name = self._response(plant.inputs).partition(".")
        names = {"x": plant.states, "y": plant.outputs, "u": law.plant.inputs}.get(kind, ())
        return np.asarray(getattr(found, kind)[:, names.index(name), signal]) if name in names else None


def analyse_trials(
    trials: Sequence[Series], stimulus: str, response: str, how: Mapping[str, Any]
) -> tuple[Multisine, tuple[Multisine, ...]]:
    """The result of all trials together, and that of each; none of each where there is one trial.

    Raises:
        DataError: if trials are in different units, or :func:`icmj.experiments.multisine` refuses them.
    """
    if len(units := list(dict.fromkeys(one.units for one in trials))) > 1:
        first, other = (" and ".join(unit or "no unit" for unit in each) for each in units[:2])
        raise DataError(f"trials in different units ({first}; {other}), which have no mean; convert one")
    each = [multisine(one, stimulus, response, **how) for one in trials] if len(trials) > 1 else []
    return multisine(trials, stimulus, response, **how), tuple(each)


def take_periods(kind: MultisineKind | PerturbedStanceKind, series: Series) -> Series:
    """The periods of a recording that the table asks for, those after its first ``settle`` ones.

    Where it asks for none, or for no number of them, all; the last whole ones of a recording of people, which may begin
    within one. A trial of an experiment begins with a period.

    Raises:
        DataError: if there are fewer.
    """
    period, settle, periods, rate = kind.settings.period, *map(kind.stated, ("settle", "periods", "rate"))
    begin, duration = (None if count is None else count * period for count in (settle, periods))
    cut = even_series(cut_recording(series, begin, duration, f"settle and periods of {period:g} s"), rate)
    begins = settle is not None or periods is not None or SETTLED in series.facts
    return _whole_periods(cut, period) if begins else cut


def _whole_periods(series: Series, period: float) -> Series:
    """The first whole periods of a trial: a sample behind the last of them begins the next."""
    if len(series) < 2:
        return series
    begin, step = float(series.t[0]), float(series.t[-1] - series.t[0]) / (len(series) - 1)
    count = steps_in((float(series.t[-1]) - begin + (1 + EVEN) * step) / period)
    return series if count < 1 else series.until(begin + count * period - step / 2)


def _phases(count: int, seed: int) -> list[float]:
    """So many phases from a seed [rad]."""
    return [float(phase) for phase in 2 * np.pi * np.random.default_rng(seed).random(count)]


def _plain(table: TomlTable) -> dict[str, Any]:
    return table.model_dump(exclude_defaults=True, exclude_none=True)


TILT, BODY = "stimulus", "body"


@dataclass(frozen=True, eq=False)
class FoundStance(FoundMultisine):
    """Response of the body in space, remnant, and the fitted channels with their response; a :class:`Finding`.

    Attributes:
        channels: those whose response is nearest; ``None`` where no body was given to fit.
    """

    channels: StanceChannels | None = None

    @property
    def numbers(self) -> Mapping[str, float]:
        found = {name: value for name, value in super().numbers.items() if name != "explained by continuous control"}
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


class PerturbedStanceKind(Kind):
    """See the module."""

    settings: PerturbedStanceTable

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        table, kept = self.settings, [one.model_dump(exclude_unset=True) for one in run.simulation.disturbance]
        tilt: dict[str, Any] = {
            "kind": "ternary", "surface": "tilt", "size": table.size, "interval": table.interval,
            "bandwidth": table.highest, "point": [0.0, 0.0, table.axis_height],
            "vertical": table.vertical, "vertical_rate": table.vertical_rate,
        }  # fmt: skip
        duration = (table.settle + table.periods) * table.period
        return set_duration(run.with_(**{"simulation.disturbance": [*kept, tilt]}), duration, table.rate)

    @property
    def begin(self) -> float:
        return self.settings.settle * self.settings.period

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        name = self.settings.output or case.actual.linearisation.plant.outputs[0]
        one = sample_rows(simulation.to_series().chosen([f"y.{name}"]), simulation, self.settings.rate, self.begin)
        tilt = self._tilt(one.t + (self.begin if len(one) > 1 else 0.0))
        values = np.column_stack([tilt, one.values[:, 0] + tilt])
        return replace(one, values=values, names=(TILT, BODY), units=("rad", "rad"), facts={"response": f"y.{name}"})

    def read(self, series: Series) -> Series:
        # channels are fitted to a body's angle under a tilt: volts or millimetres would have no stiffness in N m/rad
        pair = in_si(series.chosen([self.settings.stimulus, self.settings.response]), "angle", "angle")
        return take_periods(self, replace(pair, names=(TILT, BODY)))

    def analyse(
        self, recordings: Sequence[Recording], case: Case | None = None, plant: PlantKind | None = None
    ) -> FoundStance:
        trials = [one.series for one in keep_complete(recordings)]
        table = self.settings
        if case is not None:
            trials = [_whole_periods(one, table.period) for one in trials]
        how = {"period": table.period, "lines": self._lines()[:, 1] / (2 * np.pi)}
        found, each = analyse_trials(trials, TILT, BODY, how)
        channels = self._channels(found)
        theory = None if channels is None else channels.response(found.line)
        return FoundStance(found, theory, (trials[0].units[0], trials[0].units[1]), each, channels)

    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
        from icmj.report.findings import multisine_figure

        units = (one.finding.units for one in found if isinstance(one.finding, FoundMultisine))
        return multisine_figure(found, next(units, ("", "")))

    def _lines(self) -> Array:
        return ternary_lines(self.settings.size, self.settings.interval, self.settings.highest)

    def _tilt(self, t: Array) -> Array:
        a, omega, phi = self._lines().T
        return np.asarray(np.cos(np.outer(t, omega) + phi) @ a)

    def _channels(self, found: Multisine) -> StanceChannels | None:
        table = self.settings
        if table.inertia is None or table.toppling is None:
            return None
        body = StanceChannels(table.inertia, table.toppling, table.stiffness, table.damping)
        return fit_channels(body, found.line, found.response, found.radius)


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

    def stimulate(self, run: RunFile, seed: int) -> RunFile:
        return set_duration(run, self.settings.settle + self.settings.duration, self.settings.rate)

    @property
    def begin(self) -> float:
        return self.settings.settle

    def recorded(self, case: Case, simulation: Simulation) -> Series:
        axis = self.settings.axis
        names = (f"force.{axis}", "force.z", f"cop.{axis}")
        force = ground_force(_model(case), simulation).chosen(names)
        return force_angle(sample_rows(force, simulation, self.settings.rate, self.begin), *names[:2])

    def read(self, series: Series) -> Series:
        table, axis = self.settings, self.settings.axis
        angle, force = self.stated("angle"), self.stated("force") or (f"force.{axis}", "force.z")
        cop = self.stated("cop") or f"cop.{axis}"
        if angle is None and self.stated("force") is None and not set(series.names).issuperset(force):
            angle = table.angle
            if angle not in series.names:
                raise DataError(
                    f"no column {angle!r}, nor {' and '.join(force)}; it has {', '.join(series.names[:20])}"
                )
        settle, duration, rate = map(self.stated, ("settle", "duration", "rate"))
        wanted = [cop, *(force if angle is None else (angle,))]
        found = cut_recording(series.chosen(wanted), settle, duration, "settle and duration")
        if angle is None:
            found, angle = force_angle(found, *force), "force_angle"
        return even_series(replace(found.chosen([angle, cop]), names=("force_angle", f"cop.{axis}")), rate)

    def analyse(
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
            for one in keep_complete(recordings)
        ]
        if len({len(point.z) for point in points}) > 1:
            raise DataError("trials of several rates; analyse those of one rate together")
        mean, deviation = average(points)
        return FoundPoint(mean, deviation, None if case is None else self._theory(case, mean), tuple(points))

    def draw_figure(self, found: Sequence[CaseResult]) -> Figure:
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
