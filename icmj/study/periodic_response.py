"""The response to a periodic stimulus and the remnant, over trials: what is found and drawn of both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array, count_steps
from icmj.base.numbers import count, readable
from icmj.errors import DataError
from icmj.experiments.multisine import Multisine, multisine
from icmj.experiments.recording import Recording, keep_complete
from icmj.report import style
from icmj.report.findings import LOWEST, MARKER, ShownResult, assign_colours, under_legend
from icmj.series.even_rows import resample_series
from icmj.series.series import EVEN, SETTLED, Series
from icmj.study.kind import Kind, cut_recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure


LEAST = 0.01  # %: a smaller share of the power is called so
NOTHING = 1e-6  # share of a stimulus's power off its lines that is not told: rounding of a file


@dataclass(frozen=True, eq=False)
class PeriodicResponse:
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


def analyse_trials(
    recordings: Sequence[Recording], names: tuple[str, str], period: float, lines: ArrayLike, *, simulated: bool
) -> PeriodicResponse:
    """The result of all trials together, without a theory, and that of each; none of each where there is one trial.

    Args:
        recordings: of which the complete ones are analysed; ``simulated`` ones begin with a period.
        names: of stimulus and response.
        period: of the stimulus [s].
        lines: its frequencies [Hz].
        simulated: whether they are trials of an experiment.

    Raises:
        DataError: if trials are in different units, or :func:`icmj.experiments.multisine` refuses them.
    """
    trials = [one.series for one in keep_complete(recordings)]
    if simulated:
        trials = [whole_periods(one, period) for one in trials]
    if len(units := list(dict.fromkeys(one.units for one in trials))) > 1:
        first, other = (" and ".join(unit or "no unit" for unit in each) for each in units[:2])
        raise DataError(f"trials in different units ({first}; {other}), which have no mean; convert one")
    each = [multisine(one, *names, period=period, lines=lines) for one in trials] if len(trials) > 1 else []
    found = multisine(trials, *names, period=period, lines=lines)
    return PeriodicResponse(found, None, (trials[0].units[0], trials[0].units[1]), tuple(each))


def expect_whole_samples(period: float, rate: float) -> None:
    """Check that a period [s] has a whole number of samples at ``rate`` [Hz].

    Raises:
        ValueError: if not.
    """
    if abs(rate * period - round(rate * period)) > 1e-6:
        raise ValueError(f"a period of {period:g} s has no whole number of samples at {rate:g} Hz")


def say_periods(settle: int, periods: int) -> str:
    """Which periods of a trial are left out, and which are analysed."""
    left_out = f"{count(settle, 'period')} at the start {'is' if settle == 1 else 'are'} left out"
    return f"{left_out}, and {count(periods, 'period')} of each trial are analysed."


def take_periods(kind: Kind, period: float, series: Series) -> Series:
    """The periods of a recording that the table asks for, those after its first ``settle`` ones.

    Where it asks for none, or for no number of them, all; the last whole ones of a recording of people, which may begin
    within one. A trial of an experiment begins with a period.

    Raises:
        DataError: if there are fewer.
    """
    settle, periods, rate = map(kind.stated, ("settle", "periods", "rate"))
    begin, duration = (None if number is None else number * period for number in (settle, periods))
    cut = resample_series(cut_recording(series, begin, duration, f"settle and periods of {period:g} s"), rate)
    begins = settle is not None or periods is not None or SETTLED in series.facts
    return whole_periods(cut, period) if begins else cut


def whole_periods(series: Series, period: float) -> Series:
    """The first whole periods of a trial: a sample behind the last of them begins the next."""
    if len(series) < 2:
        return series
    begin, step = float(series.t[0]), float(series.t[-1] - series.t[0]) / (len(series) - 1)
    whole = count_steps((float(series.t[-1]) - begin + (1 + EVEN) * step) / period)
    return series if whole < 1 else series.until(begin + whole * period - step / 2)


def draw_response(found: Sequence[ShownResult]) -> Figure:
    """Gain with 95 % confidence, phase, power; line: theory; rings and crosses: excited lines; points: the remnant."""
    units = next((one.finding.units for one in found if isinstance(one.finding, PeriodicResponse)), ("", ""))
    figure, (gain, phase, power) = style.new_figure(150.0, rows=3, width=150.0)
    (of_stimulus, stimulus), (of_response, response_unit) = map(readable, units)
    scale = of_response / of_stimulus
    highest, least, ends = 0.0, np.inf, (np.inf, 0.0)
    for one, colour in assign_colours(found):
        if one.finding is None:
            continue
        curves = one.finding.curves
        f, excited = curves["frequency (Hz)"], curves["excited"] > 0
        response = (curves["real"] + 1j * curves["imag"])[excited]
        marker, lines = MARKER[one.plant], f[excited]
        style_of: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "linestyle": "none",
            "markersize": 3.5,
            "fillstyle": "none",
        }
        size, radius = scale * np.abs(response), scale * curves["radius"][excited]
        gain.errorbar(lines, size, radius, elinewidth=0.6, **style_of)
        least = min(least, float(size[size > 0].min(initial=np.inf)))
        phase.plot(lines, np.degrees(np.angle(response)), **style_of)
        theory = (curves["theory, real"] + 1j * curves["theory, imag"])[excited]
        gain.plot(lines, scale * np.abs(theory), color="#222222", linewidth=0.6)
        phase.plot(*_unwound(lines, np.degrees(np.angle(theory))), color="#222222", linewidth=0.6)
        values, ends = of_response**2 * curves["power"], (min(ends[0], lines[0]), max(ends[1], lines[-1]))
        power.plot(f[~excited], values[~excited], color=colour, linestyle="none", marker=".", markersize=1, zorder=1)
        power.plot(lines, values[excited], **style_of)
        highest = max(highest, float(values.max(initial=0.0)))
    over = f"({stimulus})" if " " in stimulus else stimulus
    squared = f"({response_unit})²" if " " in response_unit else f"{response_unit}²"
    gain.set(xscale="log", yscale="log", ylabel=f"gain ({response_unit}/{over})")
    phase.set(ylabel="phase (°)", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    power.set(yscale="log", ylabel=f"power ({squared})", xlabel="frequency (Hz)")
    if np.isfinite(least):
        gain.set_ylim(bottom=least / 3)
    if highest > 0:
        power.set_xlim(ends[0] / 2, 2 * ends[1])
        power.set_ylim(bottom=LOWEST * highest, top=3 * highest)
    figure.align_ylabels([gain, phase, power])
    under_legend(figure, [gain, phase, power], found, markers=True)
    return figure


def _unwound(x: Array, phase: Array) -> tuple[Array, Array]:
    """A line that is broken where the phase [°] goes around."""
    gaps = 1 + np.flatnonzero(np.abs(np.diff(phase)) > 180)
    return np.insert(x, gaps, np.nan), np.insert(phase, gaps, np.nan)
