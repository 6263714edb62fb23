"""The noise of a run as the linear theory takes it: small stationary Gaussian signals, independent of each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, cast

import numpy as np

from icmj.controller.controller import expect_intermittent
from icmj.controller.trigger import EventRule
from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.schema import RunFile
from icmj.simulation.disturbance import LOW_PASS_END, make_acting
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gaussian, Impulse, Noise, Source
from icmj.theory.error_system import error_system
from icmj.theory.orbit import Orbit
from icmj.theory.spread import SmallNoise, Spread, predict_spread

if TYPE_CHECKING:
    from icmj.case.result import Result


def small_noise(plant: LinearPlant, settings: Settings) -> tuple[SmallNoise, ...]:
    """What acts beside the predicted orbit; an impulse is left out, because an orbit that attracts forgets it.

    Noises of the same spectrum and seed are the same signal, and become one.

    Args:
        plant: the actual plant, which knows what pushes on its bodies do.
        settings: have the disturbances.

    Raises:
        SimulationError: if a source names what the plant does not have.
        AnalysisError: if one is no small stationary noise, has a spectrum that no few states give, or depends on
            another.
    """
    make_acting(plant, settings)
    found: dict[tuple[object, ...], SmallNoise] = {}
    spectra: dict[int, tuple[object, ...]] = {}
    for signal, noise in _signals(plant, settings.disturbance):
        if isinstance(signal[0], int) and spectra.setdefault(signal[0], signal) != signal:
            raise AnalysisError(
                f"no spread is predicted: two noises of the seed {signal[0]} differ in corner or interval, and are "
                "neither the same nor independent; give each a seed of its own"
            )
        known = found.setdefault(signal, replace(noise, rate=0 * noise.rate, reading=0 * noise.reading))
        found[signal] = replace(known, rate=known.rate + noise.rate, reading=known.reading + noise.reading)
    return tuple(found.values())


def spread_about(result: Result, orbit: Orbit) -> Spread:
    """How the intervals vary about an orbit under the noise of the run that a result is of.

    Raises:
        AnalysisError: if that is not predicted; see :meth:`icmj.Case.spread`.
    """
    refuse_beyond_theory(result.run)
    by, settings = expect_intermittent(result.controller), result.run.simulation.settings()
    system = error_system(result.actual, by.design, by.hold, delay=by.delay, match="position")
    return predict_spread(system, cast(EventRule, by.trigger), orbit, small_noise(system.actual, settings))


def refuse_beyond_theory(run: RunFile) -> None:
    """Refuse a run with a set-point or a sampling delay.

    Raises:
        AnalysisError: if it has one.
    """
    if run.setpoint or run.intermittent.sampling_delay:
        what = "with a set-point" if run.setpoint else "with a sampling delay"
        raise AnalysisError(f"no spread is predicted {what}, of which the linear theory says nothing; simulate")


def _signals(plant: LinearPlant, sources: Sequence[Source]) -> Iterator[tuple[tuple[object, ...], SmallNoise]]:
    """The noises with what two that are the same signal have in common, Gaussian ones with their seed first."""
    for source in sources:
        if isinstance(source, Impulse):
            continue
        kind = type(source).__name__.lower()
        if not isinstance(source, Gaussian | Noise):
            raise AnalysisError(
                f"no spread is predicted under a disturbance of kind {kind!r}, which moves the orbit itself; simulate"
            )
        if source.corner is None and isinstance(source, Noise):
            raise AnalysisError(
                "no spread is predicted under noise with a bandwidth, whose spectrum ends abruptly; give a corner, or "
                "kind 'gaussian'"
            )
        rate, reading = _place(plant, source)
        if isinstance(source, Gaussian):
            if source.share:
                raise AnalysisError(
                    "no spread is predicted under noise whose size is a share of the command; give size, or simulate"
                )
            size, interval = source.size, source.interval
            signal: tuple[object, ...] = (source.seed, source.corner, interval)
        else:
            # its spectrum ends, and what would lie beyond is below
            size, interval = source.size * float(np.sqrt(np.pi / 2 / np.arctan(LOW_PASS_END))), 0.0
            signal = (kind, source.seed, source.corner, source.terms)
        yield signal, SmallNoise(size * rate, size * reading, interval, source.corner)


def _place(plant: LinearPlant, source: Gaussian | Noise) -> tuple[np.ndarray, np.ndarray]:
    """The contribution of a source of size 1 to ẋ and to the readings, shapes (n,), (n_y,)."""
    if source.push is not None:
        return plant.effect(source.push), np.zeros(plant.n_y)
    if source.output is not None:
        return np.zeros(plant.n), np.eye(plant.n_y)[plant.outputs.index(source.output)]
    return plant.B[:, plant.inputs.index(str(source.input))], np.zeros(plant.n_y)
