"""The settings of a run: duration, initial state, step or tolerance, and disturbances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Annotated, Literal, get_args

import numpy as np
from annotated_types import Ge, Le

from icmj.base.array import Finite, Positive
from icmj.plant.linear_plant import Push
from icmj.simulation.position_limit import Limit
from icmj.simulation.sources import Gaussian, Gridded, Noise, Placed, Sinusoids, Source, require

MOST_ROWS = 2e6  # some hundred bytes each, in memory and in the log
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-13, 0.1  # below is rounding, above nothing is told of the motion
Duration = Annotated[Positive, Ge(1e-6), Le(1e9)]  # s, up to thirty years: the viewer counts nanoseconds in 64 bits
Integrator = Literal["RK4", "Euler", "implicit", "implicitfast", "discrete"]


@dataclass(frozen=True)
class Settings:
    """The settings of a simulation, for either plant.

    Attributes:
        duration: duration of the run [s].
        initial: initial deviations of plant states from the operating point, by name; the others are zero.
        observer: initial states of the observer, by name; the others are zero, because the controller has no
            information yet.
        timestep: timestep in MuJoCo, instead of a tolerance [s]. The linear plant needs none.
        integrator: integrator in MuJoCo (default: that of the model).
        record_interval: time between recorded rows [s], which are at its multiples. Events are always recorded.
        limit: deviation of a position from the operating point at which the run counts as fallen: one number for all
            [rad or m, converted to other units of angle or length], or positions by name, each in its own unit.
            Default: 1 rad or 1 m; in plants given by matrices, positions with other units have no limit.
        disturbance: disturbances of inputs, of bodies, or of the observer's readings of outputs.
        tolerance: relative error of an open-loop interval for which the timestep in MuJoCo is chosen. Default, if
            neither timestep nor integrator is given: 10⁻⁸ if no contact, friction or limit can act; else the timestep
            of the model.

    Raises:
        SimulationError: on construction, if a number is out of range, or the run would have too many rows.
    """

    duration: Duration = 30.0
    initial: Mapping[str, Finite] = field(default_factory=dict)
    observer: Mapping[str, Finite] = field(default_factory=dict)
    timestep: Positive | None = None
    integrator: Integrator | None = None
    record_interval: Positive = 0.01
    limit: Limit = None
    disturbance: tuple[Source, ...] = ()
    tolerance: Positive | None = None

    @property
    def pushes(self) -> tuple[Push, ...]:
        """The places at which disturbances act on the plant itself, each once."""
        found = (source.push for source in self.disturbance if isinstance(source, Placed))
        return tuple(dict.fromkeys(push for push in found if push is not None))

    @property
    def noisy(self) -> bool:
        """Whether noise acts, so that a run is described by its statistics."""
        return any(isinstance(source, Noise | Gaussian | Sinusoids) for source in self.disturbance)

    @property
    def share_interval(self) -> float:
        """Shortest interval of noises whose size is a share of the command [s]; 0 if there are none."""
        noises = (source for source in self.disturbance if isinstance(source, Gaussian) and source.share)
        return min((noise.interval for noise in noises), default=0.0)

    def __post_init__(self) -> None:
        named = self.limit if isinstance(self.limit, Mapping) else {"limit": self.limit}
        limits = {name if name == "limit" else f"limit.{name}": value for name, value in named.items()}
        plain = {name: getattr(self, name) for name in ("duration", "record_interval", "timestep")}
        for name, value in (plain | limits).items():
            good = value is None and name in ("timestep", "limit")
            good = good or (value is not None and bool(np.isfinite(value)) and value > 0)
            require(good, f"{name} must be positive and finite, got {value}")
        for which in ("initial", "observer"):
            for name, value in getattr(self, which).items():
                require(np.isfinite(value), f"{which}.{name} must be finite, got {value}")
        known = get_args(Integrator)
        require(
            self.integrator is None or self.integrator in known,
            f"no integrator {self.integrator!r}; expected one of {', '.join(known)}",
        )
        fixed = " and ".join(name for name in ("timestep", "integrator") if getattr(self, name) is not None)
        if self.tolerance is not None:
            require(not fixed, f"give tolerance, or {fixed}, not both: a tolerance chooses steps and integrator")
            known_range = f"expected between {LEAST_TOLERANCE:g} and {MOST_TOLERANCE:g}"
            good = LEAST_TOLERANCE <= self.tolerance <= MOST_TOLERANCE
            require(good, f"tolerance {self.tolerance}: {known_range}")
        object.__setattr__(self, "disturbance", tuple(self.disturbance))
        grids = [source.interval for source in self.disturbance if isinstance(source, Gridded)]
        for interval in grids:
            times = interval / min(grids)
            require(
                abs(times - round(times)) < 1e-9 * times,
                f"gaussian and sampled disturbances: intervals of {min(grids):g} and {interval:g} s; give whole "
                "multiples of the shortest",
            )
            points = self.duration / interval
            require(
                points <= MOST_ROWS,
                f"gaussian or sampled disturbance: {points:.3g} values, {interval:g} s apart; expected at most "
                f"{MOST_ROWS:.0e}",
            )
        rows = self.duration / self.record_interval
        require(
            rows <= MOST_ROWS,
            f"duration / record_interval asks for {rows:.3g} rows; expected at most {MOST_ROWS:.0e}, "
            "raise record_interval",
        )


def reseed(settings: Settings, seed: int) -> Settings:
    """The settings with other noise: each noise's seed is made of its own seed and this one."""
    sources = tuple(
        replace(of, seed=int(np.random.SeedSequence((of.seed, seed)).generate_state(1, np.uint64)[0] >> np.uint64(1)))
        if isinstance(of, Noise | Gaussian)
        else of
        for of in settings.disturbance
    )
    return replace(settings, disturbance=sources)
