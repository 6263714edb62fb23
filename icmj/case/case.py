"""The case: from a run file to plants, linearisation, controller and, of an event rule, error system and prediction;
then to a simulation.

A controller without an event rule has no critical interval and no prediction: what is said of it comes from its runs,
and from the characteristic roots of its loop in each mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, TypeGuard, cast, get_args

import numpy as np
from numpy.typing import ArrayLike

from icmj.base.array import Array
from icmj.base.card import Card, Shown
from icmj.base.environment import single_threaded
from icmj.base.numbers import count
from icmj.base.text import one_line
from icmj.case.designs import controller_of, setpoint_of
from icmj.case.doubts import check_names, doubts, expect_known, followed, reach, slow_noise
from icmj.case.plants import AnyPlant, actual_plant, assumed_plant, linear_plant
from icmj.controller.controller import Controller, has_trigger
from icmj.controller.law import Law
from icmj.controller.setpoint import Setpoint
from icmj.controller.trigger import EventRule, Trigger
from icmj.engine.plant import MujocoPlant
from icmj.engine.reaction import with_pressure
from icmj.errors import DesignError, IcmjError, RunFileError, SimulationError, expect, named
from icmj.plant.linear_plant import LinearPlant, expect_linear
from icmj.plant.matching import Match, matched
from icmj.plant.notice import Notice, permitted
from icmj.runfile.schema import RunFile
from icmj.simulation.disturbance import expect_held
from icmj.simulation.interval import OpenLoop
from icmj.simulation.settings import Settings
from icmj.simulation.simulation import Simulation
from icmj.theory.delay_roots import rightmost_roots
from icmj.theory.error_system import ErrorSystem, error_system
from icmj.theory.prediction import Prediction, predict, scaled
from icmj.theory.predictor_loop import loops_of

PlantKind = Literal["linear", "mujoco"]


@dataclass(frozen=True, eq=False, repr=False)
class Case(Shown):
    """The plants, the controller and the prediction that a run file defines.

    Attributes:
        run: the run file.
        assumed, actual: the plants, each with its linearisation: MuJoCo models, or plants given by matrices.
        controller: the controller for the assumed plant, with its delay and set-point.
        settings: settings of its runs.
        rule: the event rule, which is the controller's trigger; ``None`` for a controller that has none.
        system: error system of the actual plant under an event rule; otherwise ``None``.
        prediction: results of the linear theory for the event rule; otherwise ``None``.
        told: notices about its plants.
    """

    run: RunFile
    assumed: AnyPlant
    actual: AnyPlant
    controller: Law
    settings: Settings
    rule: EventRule | None = None
    system: ErrorSystem | None = None
    prediction: Prediction | None = None
    told: tuple[Notice, ...] = ()

    @cached_property
    def notices(self) -> tuple[Notice, ...]:
        """Notices about plants, limits of the actual plant on the predicted orbit, slow noise, and the set-point."""
        if self.prediction is None:
            return (*self.told, *slow_noise(self.settings))
        limits = reach(self.actual, self.prediction)
        return (*self.told, *limits, *slow_noise(self.settings), *followed(self.run))

    @cached_property
    def stepping(self) -> Stepping:
        """The steps that its runs in MuJoCo take.

        Raises:
            ModelError, SimulationError: if plant and controller do not fit together, or the timestep is not usable.
        """
        from icmj.engine.stepping import stepping_of
        from icmj.engine.tapped import close

        body = self.model.matched(self.controller.plant, "position")
        return stepping_of(close(body, self.controller, self.settings), self.settings)

    @property
    def setpoint(self) -> Setpoint | None:
        """The set-point r(t) of its controller, ``None`` if there is none; the prediction applies to r = 0."""
        return self.controller.setpoint

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        name, predicted = self.run.case.name, self.prediction and self.prediction.card()
        assumed, actual = self.controller.plant, self.actual.linearisation.plant
        sizes = ", ".join((count(actual.n, "state"), count(actual.n_u, "input"), count(actual.n_y, "output")))
        rows = (
            ("case", f"{name}: {self.run.case.title}"),
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

    @dataclass(frozen=True, eq=False, repr=False)
    class PredictedCase(Case):
        """A case as type checkers see it once :func:`expect_prediction` has found that it has a prediction."""

        controller: Controller
        settings: Settings
        rule: EventRule
        system: ErrorSystem
        prediction: Prediction


def has_prediction(case: Case) -> TypeGuard[PredictedCase]:
    """Whether a case has an event rule, an error system and a prediction."""
    return case.prediction is not None


def expect_prediction(case: Case, what: str) -> PredictedCase:
    """The case, if it has an event rule and a prediction; ``what`` needs them begins the message.

    Raises:
        AnalysisError: if it is no case.
        RunFileError: if its controller has no event rule.
    """
    expect(case, Case, what)
    if not has_prediction(case):
        raise RunFileError(
            f"{case.run.path}: {what} needs an event rule, and the controller is of kind {case.run.controller.kind!r}, "
            "which has no event rule and no critical interval; icmj analyse tells the roots of its loop, icmj run and "
            "icmj study simulate it"
        )
    return case


@single_threaded()
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
    run = run.drawn()
    known = like if like and like.run.assumed == run.assumed and like.run.path == run.path else None
    assumed = known.assumed if known else assumed_plant(run)
    actual = known.actual if known and known.run.actual == run.actual else actual_plant(run, assumed)
    check_names(run, assumed.linearisation.plant, actual)
    notices = permitted(doubts(run, assumed, actual), run.analysis.allow, str(run.path))
    try:
        of = known.controller if known and known.run.design == run.design else None
        design = of.design if of is not None and has_trigger(of) else None
        controller, settings = controller_of(run, assumed.linearisation.plant, design), run.simulation.settings()
        if not run.has_events or not has_trigger(controller):
            expect_held(controller, settings)
            return Case(run, assumed, actual, controller, settings, told=notices)
        design, rule = controller.design, cast(EventRule, controller.trigger)
        system = error_system(
            actual.linearisation.plant, design, controller.hold, delay=controller.delay, match="position"
        )
        prediction = predict(system, rule, delta_max=run.analysis.delta_max, progress=progress)
        return Case(run, assumed, actual, controller, settings, rule, system, prediction, notices)
    except IcmjError as error:
        reasons = [notice.words for notice in notices if notice.kind in ("uncontrollable", "unobservable")]
        why = "".join(f"; {words}" for words in reasons) if isinstance(error, DesignError) else ""
        begin = "" if str(error).startswith(f"{run.path}: ") else f"{run.path}: "
        raise type(error)(f"{begin}{error}{why}") from error


def revised(case: Case, run: RunFile) -> Case:
    """The same case under a run file that differs only in q_t, its set-point, and settings of simulation and study.

    Nothing is loaded or searched again: all that theory says of another threshold is that sizes are in proportion, and
    of a set-point it says nothing. A controller without an event rule is made anew.

    Raises:
        RunFileError: if it departs in anything else, or names what the plants do not have.
        AnalysisError: if the assumed plant has no such set-point.
    """
    known = case.run
    expect_known(run, run.simulation.duration, known.simulation.duration)
    run = run.drawn()
    if not run.has_events:
        return prepare(run, like=case)
    case = expect_prediction(case, "a case with an event rule")
    same = all(getattr(run, table) == getattr(known, table) for table in ("assumed", "actual", "design", "analysis"))
    control = run.intermittent.model_copy(update={"q_t": known.intermittent.q_t})
    if not same or control != known.controller or run.path.parent != known.path.parent:
        raise RunFileError(f"{run.path}: has other plants, design or rule than {known.path}; prepare it anew")
    check_names(run, case.assumed.linearisation.plant, case.actual)
    rule = run.intermittent.trigger(case.controller.design, run.code)
    with named(run.path):
        followed = setpoint_of(run, case.controller.plant)
    prediction = case.prediction
    if rule.size != case.rule.size:
        prediction = scaled(prediction, rule.size / case.rule.size)
    return replace(
        case,
        run=run,
        controller=replace(case.controller.triggered_by(rule), setpoint=followed),
        rule=rule,
        settings=run.simulation.settings(),
        prediction=prediction,
    )


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
    if plant == "mujoco":
        from icmj.engine.run import simulate as simulate_mujoco

        there = there.matched(controller.plant, "position")
        run = simulate_mujoco(there, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
        return with_pressure(there, controller, run)
    from icmj.linear.run import simulate as simulate_linear

    there = matched(there, controller.plant, "position")
    run = simulate_linear(there, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
    return with_pressure(case.model, controller, run) if isinstance(case.actual, MujocoPlant) else run


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
        plant = matched(plant, controller.plant, match)
        from icmj.linear.run import simulate as simulate_linear

        return simulate_linear(plant, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
    from icmj.engine.run import simulate as simulate_mujoco

    if not isinstance(plant, MujocoPlant):
        expect_linear(plant, "the plant to simulate")
    plant = plant.matched(controller.plant, match)
    run = simulate_mujoco(plant, controller, settings, x0=x0, x_o0=x_o0, x_h0=x_h0, progress=progress)
    return with_pressure(plant, controller, run)


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
    expect_prediction(case, "open_loop")
    there, controller, settings = _parts(case, plant, trigger, duration, refinement)
    assert has_trigger(controller)
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
        controller = expect_prediction(case, "another trigger").controller.triggered_by(trigger)
    if refinement != 1.0 and plant == "mujoco":
        from icmj.engine.stepping import refined

        settings = refined(case.model, controller, settings, refinement)
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
        run.code.named(reference)


def measure_own(run: RunFile, simulation: Simulation) -> dict[str, float]:
    """The results of the user's own measures for the run."""
    found: dict[str, float] = {}
    for reference in run.study.measures:
        told = run.code.made(reference, simulation)
        try:
            found |= {str(name): float(value) for name, value in dict(told).items()}
        except (TypeError, ValueError) as error:
            raise RunFileError(
                f"{run.path}: {reference}: expected numbers by name, got {one_line(repr(told), 60)}"
            ) from error
    return found


@single_threaded()
def mode_roots(case: Case, count: int = 4) -> dict[str, np.ndarray]:
    """The rightmost characteristic roots of the actual plant under the controller of a run file, mode by mode.

    They belong to a loop that stays in the mode, with all its delays (:func:`icmj.rightmost_roots`): the loop is stable
    in it if all lie to the left of 0. What a controller makes of modes between which it switches, its runs tell.

    Args:
        case: plants and controller.
        count: at least so many roots of each mode [rad/s].

    Raises:
        AnalysisError: if they cannot be found, or the controller reads its outputs without a delay.
    """
    with named(case.run.path):
        plant = linear_plant(case.actual, case.settings)
        return {name: rightmost_roots(loop, count) for name, loop in loops_of(case.controller, plant).items()}
