"""The case: a run file made real, which is predicted and simulated.

It has plants, a linearisation, a controller and, with an event rule, an error system and a prediction.

A controller without an event rule has no critical interval and no prediction: what is said of it comes from its runs,
and from the characteristic roots of its loop in each mode.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.card import Card, WithCard
from icmj.base.numbers import count
from icmj.base.similar_names import suggest
from icmj.base.text import one_line
from icmj.case.control import controller_of, setpoint_of
from icmj.case.iosystem import AnyPlant
from icmj.case.noise import refuse_beyond_theory, small_noise
from icmj.case.notices import doubt_setpoint, doubts, reach, slow_noise
from icmj.case.plants import actual_plant, assumed_plant, linear_plant
from icmj.controller.controller import Controller, expect_intermittent
from icmj.controller.law import Law
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import EventRule, Trigger
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import add_pressure
from icmj.errors import AnalysisError, DesignError, IcmjError, RunFileError, SimulationError, expect, prefix_errors
from icmj.plant.linear_plant import LinearPlant, Match, expect_linear, match_ports
from icmj.plant.quality import Notice, permit
from icmj.runfile.schema import RunFile
from icmj.runfile.target import TargetTable
from icmj.simulation.disturbance import expect_held
from icmj.simulation.open_loop import OpenLoop
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.theory.delay_roots import rightmost_roots
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.mode_loops import list_loops
from icmj.theory.prediction import Prediction, predict, scale_prediction
from icmj.theory.spread import Spread, predict_spread

DESIGN_FAILS = ("saturation", "uncontrollable", "unobservable")  # notices that say why there is no design


def check_names(run: RunFile, assumed: LinearPlant, plant: AnyPlant) -> None:
    """Names in the run file are checked before anything is computed from them."""
    settings, actual = run.simulation.settings(), plant.linearisation.plant
    bodies = plant.bodies if isinstance(plant, MujocoPlant) else ()
    wanted = [("simulation.initial", name, actual.states) for name in settings.initial]
    wanted += [("simulation.observer", name, assumed.states) for name in settings.observer]
    if isinstance(settings.limit, dict):
        wanted += [("simulation.limit", name, actual.states) for name in settings.limit]
    for which, there in (("input", actual.inputs), ("output", actual.outputs), ("body", bodies)):
        named = (getattr(source, which, None) for source in run.simulation.disturbance)
        wanted += [("simulation.disturbance", name, there) for name in named if name is not None]
    for key, name, known in wanted:
        if name not in known:
            hint = suggest(name, known) or f"; expected {'one of ' + ', '.join(known) if known else 'none'}"
            raise RunFileError(f"{run.path}: {key} names {name!r}, which the model lacks{hint}")


def expect_known(run: RunFile, duration: float, end: float, setpoints: Sequence[TargetTable] = ()) -> None:
    """Refuse a duration [s] beyond the ``end`` [s] to which what came from code or a file, or is a sequence, is known.

    Raises:
        RunFileError: if it is longer, and there is such a disturbance in the run file, or such a set-point.
    """
    made_by = (vars(table).get("made_by") for table in run.simulation.disturbance)
    known = [f"disturbance from {origin}" for origin in made_by if origin]
    known += [f"set-point of kind {table.kind!r}" for table in setpoints if table.ends_with_run]
    if known and duration > end:
        raise RunFileError(
            f"{run.path}: its {known[0]} is known for a run of {end:g} s, not of {duration:g} s; set "
            "simulation.duration in the run file"
        )


PlantKind = Literal["linear", "mujoco"]


@dataclass(frozen=True, eq=False)
class Theory:
    """What the linear theory makes of a controller with an event rule, on the actual plant.

    Attributes:
        rule: the event rule.
        system: error system of the actual plant under the controller.
        prediction: results of the theory for the rule.
    """

    rule: EventRule
    system: ErrorSystem
    prediction: Prediction


@dataclass(frozen=True, eq=False, repr=False)
class Case(WithCard):
    """The plants, the controller and the prediction that a run file defines.

    Attributes:
        run: the run file.
        assumed, actual: the plants, each with its linearisation: MuJoCo models, or plants given by matrices.
        controller: the controller for the assumed plant, with its delay and set-point.
        settings: settings of its runs.
        theory: event rule, error system and prediction; ``None`` for a controller that has no event rule.
        told: notices about its plants.
    """

    run: RunFile
    assumed: AnyPlant
    actual: AnyPlant
    controller: Law
    settings: Settings
    theory: Theory | None = None
    told: tuple[Notice, ...] = ()

    @property
    def rule(self) -> EventRule | None:
        """The event rule of :attr:`theory`."""
        return None if self.theory is None else self.theory.rule

    @property
    def system(self) -> ErrorSystem | None:
        """The error system of :attr:`theory`."""
        return None if self.theory is None else self.theory.system

    @property
    def prediction(self) -> Prediction | None:
        """The prediction of :attr:`theory`."""
        return None if self.theory is None else self.theory.prediction

    @cached_property
    def notices(self) -> tuple[Notice, ...]:
        """Notices about plants, crossings that may be missing, limits on the predicted orbit, slow noise, set-point."""
        if self.prediction is None:
            return (*self.told, *slow_noise(self.settings))
        limits = reach(self.actual, self.prediction)
        gaps = (Notice("unresolved", "warning", words) for words in (self.prediction.gaps,) if words)
        return (*self.told, *gaps, *limits, *slow_noise(self.settings), *doubt_setpoint(self.run))

    @cached_property
    def stepping(self) -> Stepping:
        """The steps that its runs in MuJoCo take.

        Raises:
            ModelError, SimulationError: if plant and controller do not fit together, or the timestep is not usable.
        """
        from icmj.engine.closed_loop import close_loop
        from icmj.engine.stepping import choose_stepping

        body = self.model.matched(self.controller.plant, "position")
        return choose_stepping(close_loop(body, self.controller, self.settings), self.settings)

    @property
    def setpoint(self) -> Setpoint | None:
        """The set-point r(t) of its controller, ``None`` if there is none; the prediction applies to r = 0."""
        return self.controller.setpoint

    def spread(self) -> Spread:
        """How the intervals vary about the predicted orbit under the noise of the run file, without a simulation.

        Raises:
            RunFileError: if its controller has no event rule.
            AnalysisError: if the orbit does not attract, the noise is not small or of another kind, or the controller
                follows a set-point or samples late; see :func:`icmj.theory.predict_spread`.
        """
        theory = expect_theory(self, "a predicted spread")
        refuse_beyond_theory(self.run)
        if theory.prediction.orbit is None:
            raise AnalysisError("no spread is predicted without an orbit; simulate")
        plant = match_ports(linear_plant(self.actual, self.settings), self.controller.plant, "position")
        noise = small_noise(plant, self.settings)
        return predict_spread(theory.system, theory.rule, theory.prediction.orbit, noise)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        name, predicted = self.run.case.name, self.prediction and self.prediction.card()
        assumed, actual = self.controller.plant, self.actual.linearisation.plant
        sizes = ", ".join((count(actual.n, "state"), count(actual.n_u, "input"), count(actual.n_y, "output")))
        rows = (
            ("case", f"{name}: {self.run.title}"),
            ("actual plant", sizes),
            ("controller's model", count(assumed.n, "state")),
            ("controller", self.controller.kind),
            ("run", f"{self.settings.duration:g} s"),
            *(predicted.rows if predicted else ()),
        )
        line = predicted.line if predicted else f"{self.controller.kind} control, no prediction"
        return Card(f"{name}, {line}", rows, "; ".join(notice.words for notice in self.notices))

    @property
    def model(self) -> MujocoPlant:
        """The actual plant as a MuJoCo model.

        Raises:
            SimulationError: if the plant is given by matrices.
        """
        if isinstance(self.actual, MujocoPlant):
            return self.actual
        raise SimulationError(
            f"{self.run.path}: the actual plant is given by matrices, which MuJoCo does not simulate; take the linear "
            "plant (--plant linear)"
        )


if TYPE_CHECKING:
    from icmj.engine.stepping import Stepping


def expect_theory(case: Case, what: str) -> Theory:
    """The theory of a case; ``what`` needs it begins the message.

    Raises:
        AnalysisError: if it is no case.
        RunFileError: if its controller has no event rule.
    """
    expect(case, Case, what)
    if case.theory is None:
        raise RunFileError(
            f"{case.run.path}: {what} needs an event rule, and the controller is of kind {case.run.controller.kind!r}, "
            "which has no event rule and no critical interval; icmj analyse prints the roots of its loop, icmj run and "
            "icmj study simulate it"
        )
    return case.theory


def expect_rule(case: Case, what: str) -> Controller:
    """The controller of a case that has an event rule; raises as :func:`expect_theory`."""
    expect_theory(case, what)
    return expect_intermittent(case.controller)


@limit_to_one_thread()
def prepare(run: RunFile, *, like: Case | None = None, progress: Callable[[float], None] | None = None) -> Case:
    """Load and linearise both plants, and make the controller; of an event rule, form the error system and predict.

    Args:
        run: the run file.
        like: another case, whose plants and design are reused if the run files agree on them.
        progress: called repeatedly with the completed fraction of the analysis, 0–1.

    Raises:
        RunFileError: if the run file names something that its models do not have; the message names the run file.
        ModelError: if a property of a plant makes a prediction meaningless and the run file does not allow it.
        ModelError, DesignError, AnalysisError: if a plant, a design or the analysis fails.
        SimulationError: if a disturbance needs another controller.
    """
    expect(run, RunFile, "prepare")
    run = run.resolve()
    known = like if like and like.run.assumed == run.assumed and like.run.path == run.path else None
    assumed = known.assumed if known else assumed_plant(run)
    actual = known.actual if known and known.run.actual == run.actual else actual_plant(run, assumed)
    check_names(run, assumed.linearisation.plant, actual)
    notices = permit(doubts(run, assumed, actual), run.analysis.allow, str(run.path))
    try:
        theory = known.theory if known and known.run.design == run.design else None
        design = theory.system.design if theory else None
        controller, settings = controller_of(run, assumed.linearisation.plant, design), run.simulation.settings()
        rule = controller.event_rule if run.has_events else None
        if rule is None:
            expect_held(controller, settings)
            return Case(run, assumed, actual, controller, settings, told=notices)
        controller = expect_intermittent(controller)
        design = controller.design
        system = error_system(
            actual.linearisation.plant, design, controller.hold, delay=controller.delay, match="position"
        )
        prediction = predict(system, rule, delta_max=run.analysis.delta_max, progress=progress)
        theory = Theory(rule, system, prediction)
        return Case(run, assumed, actual, controller, settings, theory, notices)
    except IcmjError as error:
        reasons = [notice.words for notice in notices if notice.kind in DESIGN_FAILS]
        why = "".join(f"; {words}" for words in reasons) if isinstance(error, DesignError) else ""
        begin = "" if str(error).startswith(f"{run.path}: ") else f"{run.path}: "
        raise type(error)(f"{begin}{error}{why}") from error


def revise(case: Case, run: RunFile) -> Case:
    """The same case under a run file that differs only in q_t, its set-point, and settings of simulation and study.

    Nothing is loaded or searched again: all that theory says of another threshold is that sizes are in proportion, and
    of a set-point it says nothing. A controller without an event rule is made anew.

    Raises:
        RunFileError: if it departs in anything else, or names what the plants do not have.
        AnalysisError: if the assumed plant has no such set-point.
    """
    known = case.run
    expect_known(run, run.simulation.duration, known.simulation.duration)
    run = run.resolve()
    if not run.has_events:
        return prepare(run, like=case)
    law = expect_rule(case, what := "a case with an event rule")
    theory = expect_theory(case, what)
    same = all(getattr(run, table) == getattr(known, table) for table in ("assumed", "actual", "design", "analysis"))
    control = run.intermittent.at_threshold_of(known.intermittent)
    if not same or control != known.controller or run.path.parent != known.path.parent:
        raise RunFileError(f"{run.path}: has other plants, design or rule than {known.path}; prepare it anew")
    check_names(run, case.assumed.linearisation.plant, case.actual)
    rule = run.intermittent.trigger(theory.system.design, run.code)
    with prefix_errors(run.path):
        followed = setpoint_of(run, case.controller.plant)
    prediction = theory.prediction
    if rule.size != theory.rule.size:
        prediction = scale_prediction(prediction, rule.size / theory.rule.size)
    controller = replace(law.triggered_by(rule), setpoint=followed)
    theory = Theory(rule, theory.system, prediction)
    return replace(case, run=run, controller=controller, settings=run.simulation.settings(), theory=theory)


def simulate(
    case: Case,
    plant: PlantKind = "mujoco",
    *,
    trigger: Trigger | None = None,
    start: tuple[Array, ...] | None = None,
    duration: float | None = None,
    refinement: float = 1.0,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate a case on the linear plant (exactly) or in MuJoCo.

    Args:
        case: the case.
        plant: ``linear`` or ``mujoco``.
        trigger: a clock or continuous control, to replace the case's event rule.
        start: state of plant and, of a controller that has them, observer and hold at t = 0, instead of the states of
            the run file; shapes (n,), (n̂,), (n̂,).
        duration: duration instead of that of the run file [s]; not longer, if the run file has a set-point or a
            disturbance that is read, drawn or computed to its end.
        refinement: factor on the timestep of the run file or, without one, of the model; a tolerance is multiplied by
            its fourth power.
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        SimulationError: if the simulation cannot be started.
        AnalysisError: if it is no case.
        RunFileError: if a trigger is to replace an event rule that it does not have.
    """
    expect(case, Case, "simulate")
    there, controller, settings = _parts(case, plant, trigger, duration, refinement)
    x0, x_o0, x_h0 = (*(start or ()), None, None, None)[:3]
    run = simulate_plant(there, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress, match="position")
    on_floor = plant == "linear" and isinstance(case.actual, MujocoPlant)
    return add_pressure(case.model, controller, run) if on_floor else run


def simulate_plant(
    plant: LinearPlant | MujocoPlant,
    controller: Law,
    settings: Settings,
    *,
    x0: ArrayLike | None = None,
    x_o0: ArrayLike | None = None,
    x_h0: ArrayLike | None = None,
    progress: Callable[[float], None] | None = None,
    match: Match = "name",
) -> Simulation:
    """Simulate any plant under any controller, without a run file: a linear plant exactly, an MJCF model in MuJoCo.

    Args:
        plant: a linear plant, or a plant from :func:`icmj.load_plant`.
        controller: design, hold and trigger (:class:`icmj.Controller`), or a controller that only reads delayed
            outputs.
        settings: duration, initial state, timestep, disturbances.
        x0, x_o0, x_h0: initial states of plant, observer and hold as whole vectors, instead of the named states in
            ``settings``.
        progress: called repeatedly with the completed fraction, 0–1.
        match: how inputs and outputs of the plant are assigned to those of the controller's model: by name, and by
            position if they have no names; or all by position. ``u`` and ``y`` of the run are in the order of the
            controller's model.

    Raises:
        SimulationError, ModelError, AnalysisError: if plant and controller do not fit together, or the initial state is
            invalid.
    """
    expect(controller, Law, "simulate_plant", "give case.controller")
    expect_linear(controller.plant, "the plant of the controller")
    if isinstance(plant, LinearPlant):
        plant = match_ports(plant, controller.plant, match)
        from icmj.linear.run import simulate as simulate_linear

        return simulate_linear(plant, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
    from icmj.engine.run import simulate as simulate_mujoco

    if not isinstance(plant, MujocoPlant):
        expect_linear(plant, "the plant to simulate")
    plant = plant.matched(controller.plant, match)
    run = simulate_mujoco(plant, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
    return add_pressure(plant, controller, run)


def open_loop(
    case: Case,
    plant: PlantKind = "mujoco",
    *,
    trigger: Trigger | None = None,
    duration: float | None = None,
    refinement: float = 1.0,
) -> OpenLoop:
    """A function that simulates one open-loop interval of a case, from the state at an event to that at the next event.

    Args:
        case, plant, trigger, refinement: as for :func:`simulate`.
        duration: maximum duration of the simulation [s], counted from t = 0; by default that of the run file.

    Raises:
        SimulationError: if the simulation cannot be prepared, or the case has a set-point.
        AnalysisError: if it is no case.
        RunFileError: if it has no events from which an interval could begin.
    """
    expect_theory(case, "open_loop")
    there, law, settings = _parts(case, plant, trigger, duration, refinement)
    controller = expect_intermittent(law)
    if plant == "linear":
        from icmj.linear.open_loop import open_loop as linear_open_loop

        return linear_open_loop(there, controller, settings)
    from icmj.engine.open_loop import open_loop as engine_open_loop

    return engine_open_loop(there, controller, settings)


def _parts(
    case: Case, plant: PlantKind, trigger: Trigger | None, duration: float | None, refinement: float
) -> tuple[Any, Law, Settings]:
    """Plant, controller and settings of a run of the case."""
    expect_plant(plant)
    settings = case.settings
    if duration is not None:
        expect_known(case.run, duration, case.run.simulation.duration, case.run.setpoint)
        settings = replace(settings, duration=duration)
    controller = case.controller
    if trigger is not None:
        controller = expect_rule(case, "another trigger").triggered_by(trigger)
    if refinement != 1.0 and plant == "mujoco":
        from icmj.engine.stepping import refine

        settings = refine(case.model, controller, settings, refinement)
    return (linear_plant(case.actual, settings) if plant == "linear" else case.model), controller, settings


def expect_plant(plant: str) -> None:
    """Check the name of a plant.

    Raises:
        SimulationError: if it is another.
    """
    if plant not in get_args(PlantKind):
        raise SimulationError(f"plant {plant!r}; expected one of {', '.join(get_args(PlantKind))}")


def expect_measures(run: RunFile) -> None:
    """See that the user's own measures may be called and are there, before the run that they measure.

    Raises:
        RunFileError: if not.
    """
    for reference in run.study.measures:
        run.code.find(reference)


def measure_own(run: RunFile, simulation: Simulation) -> dict[str, float]:
    """The results of the user's own measures for the run."""
    found: dict[str, float] = {}
    for reference in run.study.measures:
        told = run.code.make(reference, simulation)
        try:
            found |= {str(name): float(value) for name, value in dict(told).items()}
        except Exception as error:
            raise RunFileError(
                f"{run.path}: {reference} must return numbers by name, and returned {one_line(repr(told), 60)}"
            ) from error
    return found


@limit_to_one_thread()
def mode_roots(case: Case, count: int = 4) -> dict[str, np.ndarray]:
    """The rightmost characteristic roots of the actual plant under the controller of a run file, mode by mode.

    They belong to a loop that stays in the mode, with all its delays (:func:`icmj.theory.rightmost_roots`): the loop is
    stable in it if all lie to the left of 0. What a controller makes of modes between which it switches, its runs tell.

    Args:
        case: plants and controller.
        count: at least so many roots of each mode [rad/s].

    Raises:
        AnalysisError: if they cannot be found, or the controller reads its outputs without a delay.
    """
    with prefix_errors(case.run.path):
        plant = linear_plant(case.actual, case.settings)
        return {name: rightmost_roots(loop, count) for name, loop in list_loops(case.controller, plant).items()}
