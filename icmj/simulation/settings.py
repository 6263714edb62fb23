"""The settings of a run: duration, initial state, step or tolerance, and disturbances; and where it starts by them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.controller.controller import Controller, start_state
from icmj.errors import SimulationError
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.push import Push
from icmj.simulation.ending import Limit
from icmj.simulation.sources import Gaussian, Gridded, Noise, Placed, Sinusoids, Source, require

MOST_ROWS = 2e6  # some hundred bytes each, in memory and in the log
LEAST_TOLERANCE, MOST_TOLERANCE = 1e-13, 0.1  # below is rounding, above nothing is told of the motion
Integrator = Literal["RK4", "Euler", "implicit", "implicitfast", "discrete"]


@dataclass(frozen=True)
class Settings:
    """The settings of a simulation, for either plant.

    Attributes:
        duration: duration of the run [s].
        initial: initial deviations of plant states from the operating point, by name; the others start at it.
        observer: initial observer states by name; the others start at zero, because the controller has no information
            yet.
        timestep: timestep in MuJoCo [s]. The linear plant needs none.
        integrator: integrator in MuJoCo; if ``None``, that of the model.
        tolerance: relative error of an open-loop interval to which the steps in MuJoCo are adapted, instead of a
            timestep and an integrator. If none of the three is given, 1e-8 for models in which no contact, friction or
            limit can occur; otherwise the timestep of the model.
        record_interval: interval between two recorded rows [s], at its multiples; events are always recorded.
        limit: the run counts as *fallen* when a position of the plant deviates from the operating point by more than
            this: one number for all [rad or m], or by name [unit of the position]; 1 rad or 1 m if ``None``. See
            :func:`icmj.simulation.ending.limits_of` for other units.
        disturbance: disturbances of inputs, of bodies, or of the observer's readings of outputs.

    Raises:
        SimulationError: on construction, if a number is out of range, or the run would have too many rows.
    """

    duration: float = 30.0
    initial: Mapping[str, float] = field(default_factory=dict)
    observer: Mapping[str, float] = field(default_factory=dict)
    timestep: float | None = None
    integrator: Integrator | None = None
    record_interval: float = 0.01
    limit: Limit = None
    disturbance: tuple[Source, ...] = ()
    tolerance: float | None = None

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


def reseeded(settings: Settings, seed: int) -> Settings:
    """The settings with other noise: each noise's seed is made of its own seed and this one."""
    sources = tuple(
        replace(of, seed=int(np.random.SeedSequence((of.seed, seed)).generate_state(1, np.uint64)[0] >> np.uint64(1)))
        if isinstance(of, Noise | Gaussian)
        else of
        for of in settings.disturbance
    )
    return replace(settings, disturbance=sources)


def start_states(
    plant: LinearPlant,
    controller: Controller,
    settings: Settings,
    x: ArrayLike | None = None,
    x_o: ArrayLike | None = None,
    x_h: ArrayLike | None = None,
) -> tuple[Array, Array]:
    """The states at t = 0: of the plant, shape (n,), and of the controller, in its layout.

    Args:
        plant: the actual plant, or its linearisation.
        controller: says which states it has.
        settings: names the states that do not start at zero.
        x, x_o, x_h: whole vectors instead; the hold starts where the observer does if ``x_h`` is ``None``, because
            t = 0 is an event.

    Raises:
        SimulationError: if a named state does not exist, or a vector has the wrong shape or is not finite.
    """
    if controller.delay.t_d >= settings.duration:
        raise SimulationError(
            f"the delay of {controller.delay.t_d:g} s is not shorter than the run of {settings.duration:g} s: "
            "no event would ever act"
        )
    assumed = controller.design.plant.states
    plant_state = plant_start(plant, settings, x)
    observer = _start("observer", assumed, settings.observer, x_o)
    hold = observer if x_h is None else _start("hold", assumed, {}, x_h)
    return plant_state, start_state(controller, observer, hold)


def plant_start(plant: LinearPlant, settings: Settings, x: ArrayLike | None = None) -> Array:
    """The plant's state at t = 0, shape (n,), by name or as a whole vector.

    Raises:
        SimulationError: as for :func:`start_states`.
    """
    return _start("plant", plant.states, settings.initial, x)


def _start(what: str, names: Sequence[str], named: Mapping[str, float], given: ArrayLike | None) -> Array:
    if given is not None:
        state = np.array(given, dtype=float)
        if state.shape != (len(names),) or not np.isfinite(state).all():
            raise SimulationError(f"start state of the {what}: expected {len(names)} finite numbers, got {state}")
        return state
    for name in named:
        if name not in names:
            raise SimulationError(f"start state of the {what}: no state {name!r}; its states are {', '.join(names)}")
    return np.array([named.get(name, 0.0) for name in names], dtype=float)
