"""The prediction of the linear eigenvalue analysis for the closed loop (paper, section 3; docs/theory.md)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from icmj.base.array import RELATIVE_ROUNDING, Array
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.card import Card, WithCard
from icmj.base.numbers import Fact, amount, eigenvalue, ordinal
from icmj.controller.controller import Controller
from icmj.controller.hold import system_matched
from icmj.controller.trigger import ClockTrigger, EventRule, expect_rule
from icmj.errors import AnalysisError
from icmj.theory.crossing import Crossing, Kind
from icmj.theory.crossings import check_range, search
from icmj.theory.eigenstructure import compute_eigenstructure
from icmj.theory.error_system import ErrorSystem
from icmj.theory.event_maps import (
    compute_event_shift,
    compute_growth,
    compute_jacobians,
    compute_multipliers,
    is_alternating,
    is_stable,
)
from icmj.theory.flow import Flow, make_flow
from icmj.theory.neutral_modes import NeutralMode
from icmj.theory.orbit import EXTENTS, Orbit, compute_critical_vectors
from icmj.theory.orbit import compute_orbit as orbit_at
from icmj.theory.orbit_family import OrbitFamily, describe_family, divide_by_family, list_mixtures
from icmj.theory.outlook import Outlook, look_beyond
from icmj.theory.reduction import Reduction, is_stable_modulo_neutral, reduce_system

PREDICTION = (
    Fact("delta_crit", "critical interval Δ_crit", "s", "critical open-loop interval", attrgetter("delta_crit")),
    Fact("eigenvalue", "eigenvalue there", "",
         "eigenvalue on the unit circle at Δ_crit, +1 or −1; empty if there is none", attrgetter("eigenvalue"),
         "eigenvalue"),
    Fact("cycle", "cycle predicted", "", "whether an orbit that attracts, or beside which runs settle, is predicted",
         attrgetter("cycle"), "truth"),
    Fact("period", "period", "s", "period of the predicted cycle", attrgetter("period")),
    Fact("verdict", "verdict on the orbit", "",
         "on the predicted orbit: attracting, family (runs settle beside it), repelling, not admissible or none",
         attrgetter("verdict"), "text"),
    Fact("multiplier", "largest multiplier of the event-driven orbit", "",
         "magnitude of the largest multiplier of the predicted orbit under the event rule",
         lambda of: None if of.multipliers is None else np.abs(of.multipliers).max(initial=0.0), figures=4, record="",
         logged=""),
    Fact("by_paper", "cycle by the paper's condition", "",
         "whether an eigenvalue leaves the unit circle at +1 or −1 with all others inside", attrgetter("by_paper"),
         "truth", column="", logged=""),
    Fact("gamma", "γ", "", "size of the critical mode at the events of the predicted orbit", attrgetter("gamma")),
    Fact("state_feedback_stable", "continuous state feedback on the actual plant", "",
         "whether continuous state feedback is stable on the actual plant", attrgetter("state_feedback_stable"),
         "truth", answers=("stable", "unstable"), record=""),
    Fact("observer_feedback_stable", "continuous observer feedback on the actual plant", "",
         "whether continuous observer feedback is stable on the actual plant", attrgetter("observer_feedback_stable"),
         "truth", answers=("stable", "unstable"), record=""),
    Fact("amplitude", "peak of each output", "", "largest magnitude of each output over a period",
         attrgetter("amplitude"),
         "outputs", figures=4, column="peak"),
)  # fmt: skip
"""In the order of a sweep's columns."""


Verdict = Literal["attracting", "family", "repelling", "not admissible", "none"]
VERDICTS: tuple[Verdict, ...] = get_args(Verdict)
"""From what motions come to on; ``family``: they settle beside the orbit, on others of the same family."""
ALTERNATING = (
    "the orbit is one of a family, because the hold stands still between events: the errors at two events that close a "
    "cycle are opposite by themselves, so that beside it lie cycles of two unequal intervals, and a run settles on one "
    "of these; one multiplier is exactly +1 and does not count"
)
SLOW_GROWTH = 0.01  # a factor per event that a few hundred events do not tell from 1
ALIKE = 1e-6  # multipliers of faces that are reached together differ by no more where a symmetry makes them alike
KIND: dict[int, Kind] = {1: "+1", -1: "-1"}
FALLS = (
    "continuous feedback of this design is unstable, and most small starts fall, though a cycle attracts those that "
    "start near enough"
)
_JUDGED = ("multipliers", "verdict", "family", "V_inv", "v_condition")
_SIZES = ("gamma", "x_bar", "X", "y", "u", "e_hp", *EXTENTS)
_OF_ONE = ("delta_crit", "eigenvalue", "period", "gamma", "amplitude", "orbit", "multipliers", "V_inv")


@dataclass(frozen=True, eq=False)
class PredictedOrbit:
    """One orbit of the catalogue, at a crossing of ±1, with its own verdict.

    Attributes:
        crossing: where an eigenvalue of φ is ±1, rising, falling or touching.
        orbit, multipliers, verdict, family, V_inv, v_condition: as of a :class:`Prediction`.
    """

    crossing: Crossing
    orbit: Orbit
    multipliers: NDArray[np.complex128] | None
    verdict: Verdict
    family: OrbitFamily | None
    V_inv: NDArray[np.complex128] | None
    v_condition: float

    @property
    def settles(self) -> bool:
        """Whether runs that start beside it settle on it, or beside it on another of its family."""
        return self.verdict in ("attracting", "family")

    @property
    def multiplier(self) -> float | None:
        """Magnitude of the largest multiplier."""
        return None if self.multipliers is None else float(np.abs(self.multipliers).max(initial=0.0))

    @property
    def words(self) -> str:
        """Its interval and the verdict, such as ``1.1477 s (λ = +1), attracting``."""
        return f"{amount(self.crossing.delta, 's')} (λ = {eigenvalue(self.crossing.eigenvalue)}), {self.verdict}"


@dataclass(frozen=True, eq=False, repr=False)
class Prediction(WithCard):
    """The results of the linear analysis of one controller on one plant.

    Attributes:
        delta_crit: Δ_crit [s], or ``None`` if undefined: the paper's, which is the first rising crossing at ±1 with all
            other eigenvalues inside the circle, or without one the first crossing at ±1; but where runs do not settle
            on the orbit there, and do on another, the first at which they do.
        eigenvalue: λ_crit, or ``None``.
        cycle: whether a limit cycle is predicted: an orbit that attracts, or of a family beside which runs settle.
        period: Δ_crit for λ = +1, 2Δ_crit for −1; ``None`` if no cycle is predicted.
        gamma: γ, ``None`` without an orbit. Unlike all other results, it depends on the coordinates x̄.
        amplitude: peak of every output over the orbit, shape (n_y,), NaN for an output that shows a neutral mode;
            ``None`` without an orbit, and for a family of orbits, which has no single amplitude.
        crossings: all crossings of the unit circle in the interval searched, by increasing Δ.
        delta_max: end of the interval searched [s].
        orbit: the orbit at Δ_crit (also if no cycle is predicted, to show why), or ``None``; of a family, one member.
            This and what follows of an orbit is about that at Δ_crit; ``orbits`` has all.
        multipliers: eigenvalues of the Jacobian J of the return map under the event rule, or ``None``; without those of
            neutral modes and those along a family, which are ±1 by construction.
        verdict: ``attracting``, ``family``, ``repelling``, ``not admissible`` or ``none``, apart from neutral modes. On
            an orbit of a family no run that starts beside it settles, but on another of the same family.
        v_condition: condition number of the eigenvector matrix V of φ(Δ_crit); NaN if undefined.
        V_inv: its rows map x̄ to χ; shape (n + n̂, n + n̂); row 0 is that of the critical mode. ``None`` if undefined.
            (If V is too ill-conditioned, row 0 is the left eigenvector and the rest an orthonormal basis of the
            complementary invariant subspace's annihilator, from a Schur form.) The last rows are coordinates along
            neutral modes. ``None`` for a family, in which no single mode is critical.
        state_feedback_stable: whether A − Bk is stable (full state feedback on the actual plant), apart from neutral
            modes that are unobservable for the feedback or that it cannot change.
        observer_feedback_stable: whether plant and observer under continuous control are stable, apart from neutral
            modes; false if an unobservable mode grows. With a delay, it applies to a clock with an interval of a
            twentieth of the delay, which approximates the continuous predictor controller.
        neutral: the modes that were removed before the analysis, because neither events nor control change them.
        family: the orbits of a repeated critical eigenvalue, or ``None`` if there is one orbit.
        beyond: if there is no crossing at ±1 up to ``delta_max``, the first one that a coarse search further out finds
            (any crossing, if there is none at all before), or ``None``.
        growing: whether the largest |λ| still grows at ``delta_max``.
        outputs, output_units: names and units of the outputs; empty if unknown.
        others: the orbits at the other crossings at ±1, by rising Δ.
        unresolved: parts of the interval searched, first and last Δ [s], in which crossings may be missing, because
            rounding hides how eigenvalues pass the circle there.
    """

    delta_crit: float | None
    eigenvalue: complex | None
    cycle: bool
    period: float | None
    gamma: float | None
    amplitude: Array | None
    crossings: tuple[Crossing, ...]
    delta_max: float
    orbit: Orbit | None
    multipliers: NDArray[np.complex128] | None
    verdict: Verdict
    v_condition: float
    V_inv: NDArray[np.complex128] | None
    state_feedback_stable: bool
    observer_feedback_stable: bool
    neutral: tuple[NeutralMode, ...] = ()
    family: OrbitFamily | None = None
    beyond: Crossing | None = None
    growing: bool = False
    outputs: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    others: tuple[PredictedOrbit, ...] = ()
    unresolved: tuple[tuple[float, float], ...] = ()

    @property
    def orbits(self) -> tuple[PredictedOrbit, ...]:
        """The catalogue: an orbit for each crossing at ±1, by rising Δ."""
        if self.orbit is None or self.eigenvalue is None:
            return self.others
        at = [c for c in self.crossings if c.delta == self.delta_crit and c.eigenvalue == self.eigenvalue]
        crossing = at[0] if at else Crossing(self.orbit.delta, self.eigenvalue, KIND[self.orbit.sign], "rising", 0.0)
        shown = PredictedOrbit(
            crossing, self.orbit, self.multipliers, self.verdict, self.family, self.V_inv, self.v_condition
        )
        return tuple(sorted((shown, *self.others), key=lambda one: one.crossing.delta))

    @property
    def paper(self) -> Crossing | None:
        """The crossing that defines Δ_crit in the paper; ``None`` without one at ±1."""
        return find_critical_crossing(self.crossings)[0]

    @property
    def by_paper(self) -> bool:
        """Whether the paper's condition predicts a cycle: a rising crossing at ±1 with all other eigenvalues inside."""
        return find_critical_crossing(self.crossings)[1]

    def about(self, found: PredictedOrbit) -> Prediction:
        """The same prediction with another orbit of the catalogue as the one at Δ_crit."""
        orbit = found.orbit
        return replace(
            self,
            delta_crit=found.crossing.delta,
            eigenvalue=found.crossing.eigenvalue,
            period=orbit.period if self.cycle else None,
            gamma=orbit.gamma,
            amplitude=orbit.y_peak if found.family is None else None,
            **{name: getattr(found, name) for name in ("orbit", *_JUDGED)},
            others=tuple(one for one in self.orbits if one.orbit is not orbit),
        )

    @property
    def missing(self) -> str:
        """The reason why γ, or the peak of an output, is not a number; "" if all are."""
        if self.orbit is None or np.isfinite([self.orbit.gamma, *self.orbit.y_peak]).all():
            return ""
        drifts = np.isfinite(self.orbit.gamma)
        return "a neutral mode may add any constant" if drifts else "the event rule does not detect this orbit"

    @property
    def gaps(self) -> str:
        """Where crossings may be missing; "" if every one is found."""
        parts = [f"between {first:.6g} and {last:.6g} s" for first, last in self.unresolved]
        shown = f"{', '.join(parts[:3])}{f' and in {len(parts) - 3} more places' if len(parts) > 3 else ''}"
        return bool(parts) * (
            f"crossings may be missing {shown}, where rounding hides how eigenvalues pass the unit circle; look for "
            "gains or rates that are out of proportion"
        )

    @property
    def shifts(self) -> str:
        """Which crossings rounding may have moved, and how far; "" if none."""
        told = [f"{c.delta:.6g} s by up to {c.uncertainty:.1g} s" for c in self.crossings if c.uncertainty]
        shown = f"{', '.join(told[:3])}{f' and {len(told) - 3} more' if len(told) > 3 else ''}"
        return bool(told) * f"rounding may have moved the crossing{'s' * (len(told) > 1)} at {shown}"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Remarks on the numbers: on neutral modes, on a family, on missing numbers, and on what is not resolved."""
        family = () if self.family is None else (self.family.words,)
        if self.verdict == "family" and self.family is None:
            family = (ALTERNATING,)
        missing = (f"a dash stands where there is no number: {self.missing}",) if self.missing else ()
        falls = () if self.observer_feedback_stable or not self.cycle else (FALLS,)
        rounding = tuple(filter(None, (self.gaps, self.shifts)))
        return (*(mode.words for mode in self.neutral), *family, *falls, *missing, *rounding)

    def card(self) -> Card:
        """Its representation at a prompt or in a notebook."""
        searched = f"up to {self.delta_max:.4g} s"
        cycle = f"period {amount(self.period, 's')}" if self.cycle else "no cycle predicted"
        at = (self.outputs, self.output_units)
        rows = {fact.label: fact.shown(fact.value(self), *at) for fact in PREDICTION}
        missing = ", and some may be missing" * bool(self.gaps)
        rows["crossings of the unit circle"] = f"{len(self.crossings)} {searched}{missing}"
        rows |= {f"{ordinal(i)} orbit": one.words for i, one in enumerate(self.orbits) if self.others}
        if self.delta_crit is None:
            rows[PREDICTION[0].label] = f"none {searched}"
            return Card(f"no Δ_crit {searched}", tuple(rows.items()))
        found = f"Δ_crit = {amount(self.delta_crit, 's')}, λ_crit = {eigenvalue(self.eigenvalue)}"
        falls = f"{FALLS[0].upper()}{FALLS[1:]}." if FALLS in self.remarks else ""
        return Card(f"{found}, {cycle}, orbit {self.verdict}", tuple(rows.items()), falls)


@limit_to_one_thread()
def predict(
    system: ErrorSystem,
    trigger: EventRule,
    *,
    delta_max: float = 3.0,
    progress: Callable[[float], None] | None = None,
) -> Prediction:
    """The complete linear analysis of one controller on one plant.

    Args:
        system: the error system of the actual plant.
        trigger: the event rule, with its Δ_min.
        delta_max: end of the interval of Δ searched [s].
        progress: called repeatedly with the completed fraction, 0–1.

    Raises:
        AnalysisError: if ``delta_max`` is not positive and finite, the rule does not fit, or the system cannot be
            analysed within rounding.
    """
    report = progress or (lambda _: None)
    expect_rule(trigger)
    check_range(system, delta_max)
    prepared = make_flow(system.A_C)
    prepared.demand(delta_max)
    reduced = reduce_system(system, prepared)
    found = search(system, delta_max, reduced=reduced, progress=lambda done: report(0.9 * done))
    paper, ahead = find_critical_crossing(found.crossings)[0], Outlook(None, False)
    if paper is None:
        ahead = look_beyond(system, reduced, found.delta_end, any_kind=not found.crossings)
    orbits = tuple(_catalogue(system, trigger, found.crossings, paper, prepared, reduced))
    report(1.0)
    nothing = Prediction(
        **dict.fromkeys(_OF_ONE),
        cycle=any(one.settles for one in orbits),
        crossings=found.crossings,
        delta_max=found.delta_end,
        verdict="none",
        v_condition=float("nan"),
        state_feedback_stable=is_stable_modulo_neutral(
            system.actual.A - system.actual.B @ system.k, system.actual.B, system.k
        ),
        observer_feedback_stable=_observer_feedback_stable(system, reduced),
        neutral=reduced.modes,
        beyond=ahead.crossing,
        growing=ahead.growing,
        outputs=system.actual.outputs,
        output_units=system.actual.output_units,
        others=orbits,
        unresolved=found.unresolved,
    )
    if paper is None:
        return nothing
    first = next(one for one in orbits if _together(one.crossing, paper))
    return nothing.about(first if first.settles else next((one for one in orbits if one.settles), first))


def _together(one: Crossing, other: Crossing) -> bool:
    """Whether two crossings are at the same Δ, with the same eigenvalue."""
    return one.kind == other.kind and abs(one.delta - other.delta) <= RELATIVE_ROUNDING * other.delta


def _catalogue(
    system: ErrorSystem,
    trigger: EventRule,
    crossings: tuple[Crossing, ...],
    paper: Crossing | None,
    prepared: Flow,
    reduced: Reduction,
) -> Iterator[PredictedOrbit]:
    """An orbit for each crossing at ±1, a rising and a falling one at the same Δ being one of a larger eigenspace.

    Of those that cannot be computed, because an interval is too long, that of the ``paper`` raises its error.
    """
    real = [c for c in crossings if c.kind != "complex"]
    for i, c in enumerate(real):
        if any(_together(one, c) for one in real[:i]):
            continue
        same = [one for one in real if _together(one, c)]
        whole = replace(c, multiplicity=sum(s.multiplicity for s in same), dimension=sum(s.dimension for s in same))
        try:
            yield _predict_orbit(system, trigger, whole if len(same) > 1 else c, prepared, reduced)
        except AnalysisError:
            if paper is not None and _together(c, paper):
                raise


def _predict_orbit(
    system: ErrorSystem, trigger: EventRule, critical: Crossing, prepared: Flow, reduced: Reduction
) -> PredictedOrbit:
    sign = 1 if critical.kind == "+1" else -1
    phi = reduced.phi(critical.delta)
    basis = compute_critical_vectors(phi, sign, critical.dimension)
    members = []
    for mixture in list_mixtures(critical.dimension):
        vector = basis @ mixture
        vector = basis[:, 0] if len(mixture) == 1 else vector / np.linalg.norm(vector)
        orbit = orbit_at(system, trigger, critical.delta, sign, prepared=prepared, reduced=reduced, vector=vector)
        members.append((orbit, *_judge(system, trigger, orbit, basis, prepared, reduced)))
    verdicts = [verdict for _, _, verdict in members]
    # of a family the member shown is one that a motion can come to, if there is one
    best = min(range(len(members)), key=lambda i: VERDICTS.index(verdicts[i]))
    # without neutral modes χ is of x̄ in its own units
    structure = compute_eigenstructure(phi if reduced.modes else reduced.lift @ phi @ reduced.project, sign)
    whole, V_inv = None, None
    if len(members) > 1:
        x_bar = np.column_stack([reduced.complete(v, system.phi(critical.delta), sign) for v in basis.T])
        admissible = len(verdicts) - verdicts.count("not admissible")
        whole = describe_family(x_bar, len(members), admissible, verdicts.count("family"), sign)
    elif structure.V_inv is not None:
        V_inv = structure.V_inv
        if reduced.modes:
            V_inv = np.vstack([V_inv @ reduced.project, reduced.along, reduced.fixed])
            orbit = members[0][0]
            V_inv[0] *= (orbit.gamma if np.isfinite(orbit.gamma) else 1.0) / (V_inv[0] @ orbit.x_bar)
    orbit, multiplier, verdict = members[best]
    if critical.dimension < critical.multiplicity and verdict != "not admissible":
        verdict = "repelling"  # a defective eigenvalue has fewer orbits than it needs to stay bounded
    return PredictedOrbit(critical, orbit, multiplier, verdict, whole, V_inv, structure.condition)


def _judge(
    system: ErrorSystem, trigger: EventRule, orbit: Orbit, basis: Array, prepared: Flow, reduced: Reduction
) -> tuple[NDArray[np.complex128] | None, Verdict]:
    """The multipliers of an orbit, without those that are ±1 by construction, and the verdict on it.

    Of several faces reached together, they are those of the face on which the largest is; where the faces differ in
    them, what is followed to first order decides.
    """
    J = reduced.project @ compute_jacobians(system, trigger, orbit, prepared=prepared) @ reduced.lift
    if not np.isfinite(J).all():
        return None, "not admissible"
    found = [compute_multipliers(divide_by_family(one, basis, orbit.sign)) for one in J]
    alternating = is_alternating(system, trigger, orbit, reduced)
    if alternating:
        found = [np.delete(values, np.abs(values - 1).argmin()) for values in found]
    sizes = [np.abs(values).max(initial=0.0) for values in found]
    largest, least = max(sizes), 1 - RELATIVE_ROUNDING
    if basis.shape[1] == 1 and np.ptp(sizes) > ALIKE:
        largest = compute_growth(J, reduced.project @ compute_event_shift(system, orbit, prepared=prepared), orbit.sign)
        least = 1 + SLOW_GROWTH if alternating else least  # +1 is still among what is followed there
    if not orbit.admissible:
        verdict: Verdict = "not admissible"
    elif not largest < least:
        verdict = "repelling"
    else:
        verdict = "family" if alternating or basis.shape[1] > 1 else "attracting"
    return found[int(np.argmax(sizes))], verdict


def find_critical_crossing(crossings: tuple[Crossing, ...]) -> tuple[Crossing | None, bool]:
    """The crossing that defines Δ_crit in the paper, and whether it predicts a cycle by its condition."""
    real = [c for c in crossings if c.kind != "complex"]
    for c in real:
        # a defective eigenvalue has fewer orbits than it needs to stay bounded
        if c.direction == "rising" and c.largest_other < 1 and c.dimension == c.multiplicity:
            return c, True
    return (real[0], False) if real else (None, False)


def _observer_feedback_stable(system: ErrorSystem, reduced: Reduction) -> bool:
    """Whether plant and observer are stable under continuous control; with a delay, under its limit, a fast clock."""
    if not system.delay:
        # φ'(0) is plant and observer under continuous control
        grows = any(mode.kind == "unstable" for mode in reduced.modes)
        return _stable(reduced.left @ reduced.A @ reduced.right) and not grows
    hold = system.hold or system_matched(system.design)
    clock = ClockTrigger(system.delay.t_d / 20)
    return is_stable(system.actual, Controller(system.design, hold, clock, system.delay))


def _stable(A: Array) -> bool:
    return bool(np.linalg.eigvals(A).real.max(initial=-np.inf) < 0)


def scale_prediction(prediction: Prediction, factor: float) -> Prediction:
    """The prediction for a threshold that is ``factor`` times as large; the loop is linear (eq. gamma)."""
    return replace(
        prediction,
        gamma=None if prediction.gamma is None else prediction.gamma * factor,
        amplitude=None if prediction.amplitude is None else prediction.amplitude * factor,
        orbit=None if prediction.orbit is None else _scale(prediction.orbit, factor),
        others=tuple(replace(one, orbit=_scale(one.orbit, factor)) for one in prediction.others),
    )


def _scale(orbit: Orbit, factor: float) -> Orbit:
    sizes = {name: getattr(orbit, name) * factor for name in _SIZES}
    drift = None if orbit.drift is None else orbit.drift * factor
    return replace(orbit, E=orbit.E * factor**2, drift=drift, **sizes)
