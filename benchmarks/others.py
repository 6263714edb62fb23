"""The linear closed loop as one would simulate it elsewhere: SciPy, Drake and jaxonomy, each where it is installed.

All get the loop as a matrix: ż = M z with z = (x, d, e), an event when |R e| reaches 1, and e := 0 there. Each way
returns its last intervals; what is timed is a warm run, after whatever it compiles or builds.
"""

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np

LAST = 5


@dataclass(frozen=True, eq=False)
class LinearTask:
    """M, R on the last entries of z, the start, and how long [s]."""

    M: np.ndarray
    R: np.ndarray
    z: np.ndarray
    duration: float

    @property
    def e(self) -> slice:
        """Where e is in z."""
        return slice(len(self.z) - self.R.shape[1], len(self.z))


# way, package, setting, tolerances: as far as each goes in reasonable time
SETTINGS: dict[str, tuple[str, tuple[float, ...]]] = {
    "SciPy DOP853": ("scipy", (1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11, 1e-12)),
    "Drake RK3": ("pydrake", (1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11)),
    "jaxonomy Dopri5": ("jaxonomy", (1e-3, 1e-5, 1e-7, 1e-9, 1e-10, 1e-11, 1e-12)),
}


def measured(task: LinearTask, exact: np.ndarray, repeats: int = 3) -> dict[str, list[tuple[float, float, float]]]:
    """(tolerance, least seconds, largest error of the last intervals [s]) of each way that is installed."""
    makers = {"SciPy DOP853": scipy_run, "Drake RK3": drake_run, "jaxonomy Dopri5": jaxonomy_run}
    table: dict[str, list[tuple[float, float, float]]] = {}
    for way, (package, tolerances) in SETTINGS.items():
        if importlib.util.find_spec(package) is None:
            continue
        table[way] = []
        for tolerance in tolerances:
            run = makers[way](task, tolerance)
            intervals = run()  # warm
            times = []
            for _ in range(repeats):
                start = perf_counter()
                run()
                times.append(perf_counter() - start)
            error = float(np.abs(intervals - exact).max()) if len(intervals) == LAST else float("inf")
            table[way].append((tolerance, min(times), error))
    return table


def scipy_run(task: LinearTask, tolerance: float) -> Callable[[], np.ndarray]:
    """``solve_ivp`` with an event, restarted at every one."""
    from scipy.integrate import solve_ivp

    def event(t: float, z: np.ndarray) -> float:
        components = task.R @ z[task.e]
        return float(components @ components - 1)

    event.terminal, event.direction = True, 1  # type: ignore[attr-defined]

    def run() -> np.ndarray:
        t, z, times = 0.0, task.z.copy(), [0.0]
        while True:
            how = {"events": event, "rtol": tolerance, "atol": 1e-3 * tolerance}
            done = solve_ivp(lambda t, z: task.M @ z, (t, task.duration), z, "DOP853", **how)
            if done.status != 1:
                return np.diff(times)[-LAST:]
            t, z = float(done.t[-1]), done.y[:, -1].copy()
            z[task.e] = 0
            times.append(t)

    return run


def drake_run(task: LinearTask, tolerance: float) -> Callable[[], np.ndarray]:
    """A leaf system with a witness function, error-controlled RK3."""
    from pydrake.systems.analysis import ApplySimulatorConfig, Simulator, SimulatorConfig
    from pydrake.systems.framework import LeafSystem, UnrestrictedUpdateEvent, WitnessFunctionDirection

    class Loop(LeafSystem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            self.DeclareContinuousState(len(task.z))
            self.times: list[float] = []
            rising, reset = WitnessFunctionDirection.kNegativeThenNonNegative, UnrestrictedUpdateEvent
            self.witness = self.MakeWitnessFunction("event", rising, self.level, reset(system_callback=self.reset))

        def level(self, context: Any) -> float:
            components = task.R @ context.get_continuous_state_vector().CopyToVector()[task.e]
            return float(components @ components - 1)

        def reset(self, system: Any, context: Any, event: Any, state: Any) -> None:
            z = context.get_continuous_state_vector().CopyToVector()
            z[task.e] = 0
            state.get_mutable_continuous_state().SetFromVector(z)
            self.times.append(context.get_time())

        def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
            derivatives.SetFromVector(task.M @ context.get_continuous_state_vector().CopyToVector())

        def DoGetWitnessFunctions(self, context: Any) -> list[Any]:
            return [self.witness]

    loop = Loop()
    config = SimulatorConfig(integration_scheme="runge_kutta3", accuracy=tolerance, max_step_size=0.1)

    def run() -> np.ndarray:
        loop.times.clear()
        simulator = Simulator(loop)
        ApplySimulatorConfig(config, simulator)
        simulator.get_mutable_context().SetAccuracy(tolerance)
        simulator.get_mutable_context().SetContinuousState(task.z)
        simulator.AdvanceTo(task.duration)
        return np.diff([0.0, *loop.times])[-LAST:]

    return run


def jaxonomy_run(task: LinearTask, tolerance: float) -> Callable[[], np.ndarray]:
    """A leaf system with a zero crossing, Dopri5 in compiled JAX; the last intervals are carried along as states."""
    import jax
    import jax.numpy as jnp
    import jaxonomy

    jax.config.update("jax_enable_x64", True)
    M, R, e, size = jnp.asarray(task.M), jnp.asarray(task.R), task.e, len(task.z)

    class Loop(jaxonomy.LeafSystem):  # type: ignore[misc]
        def __init__(self) -> None:
            super().__init__()
            start = jnp.concatenate([jnp.asarray(task.z), jnp.zeros(LAST + 1)])
            self.declare_continuous_state(default_value=start, ode=self.flow)
            self.declare_zero_crossing(self.level, reset_map=self.reset, direction="negative_then_non_negative")

        def flow(self, time: Any, state: Any, *inputs: Any, **parameters: Any) -> Any:
            return jnp.concatenate([M @ state.continuous_state[:size], jnp.zeros(LAST + 1)])

        def level(self, time: Any, state: Any, *inputs: Any, **parameters: Any) -> Any:
            components = R @ state.continuous_state[:size][e]
            return components @ components - 1

        def reset(self, time: Any, state: Any, *inputs: Any, **parameters: Any) -> Any:
            z = state.continuous_state
            since = z[size:]
            moved = jnp.concatenate([since[1:LAST], jnp.array([time - since[LAST]]), jnp.array([time])])
            return state.with_continuous_state(jnp.concatenate([z[:size].at[e].set(0.0), moved]))

    loop = Loop()
    context = loop.create_context()
    options = jaxonomy.SimulatorOptions(
        math_backend="jax", rtol=tolerance, atol=1e-3 * tolerance, max_major_steps=400, ode_solver_method="dopri5"
    )
    simulator = jaxonomy.Simulator(loop, options=options)
    advance = jax.jit(simulator.advance_to)

    def run() -> np.ndarray:
        state = advance(task.duration, context).context.continuous_state
        return np.asarray(state)[size : size + LAST]

    return run
