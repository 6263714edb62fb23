"""A page that simulates a case live: the description that its script reads, the predictions, and the page itself.

The script (``loop.js``, ``theory.js``, ``live.js`` in ``templates/``) has no controller of its own. It is given the
controller's :class:`icmj.controller.realisation.Realisation` as numbers, which do not depend on b, and on q_t by a
factor alone; maps J and G for a few delays; the plant as a chain of links (:mod:`icmj.engine.planar_chain`) and as
matrices; and a table of predictions over b and delay. Sliders move within these.
"""

from __future__ import annotations

import base64
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from icmj.base import VERSION
from icmj.base.array import Array, agree
from icmj.base.blas_threads import limit_to_one_thread
from icmj.base.files import write_text
from icmj.base.text import one_line
from icmj.case.case import Case, Theory, expect_rule, expect_theory
from icmj.case.iosystem import AnyPlant
from icmj.case.quantity import quantities
from icmj.controller.delay import Delay
from icmj.controller.realisation import Realisation
from icmj.engine.planar_chain import find_chain
from icmj.engine.plant import MujocoPlant
from icmj.engine.schedule import find_fastest_rate
from icmj.errors import AnalysisError, ReportError
from icmj.plant.linear_plant import LinearPlant
from icmj.report.page import make_environment
from icmj.report.player import chain_body, join_scripts, links_of, script
from icmj.simulation.disturbance import Disturbance, list_terms, make_acting
from icmj.simulation.position_limit import get_limits
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gridded, Noise, Placed
from icmj.simulation.start import make_plant_start
from icmj.theory.error_system import error_system
from icmj.theory.prediction import predict

DELAYS = (0.0, 0.05, 0.1, 0.15, 0.2)  # s; between them a slider of the intermittent controller has no place
GAINS, STEP = (0.6, 1.5), 0.01  # of b
LONGEST = 0.5  # s, of a delay whose readings the page can be given
FINE, LINEAR = 0.05, 0.04  # steps in units of the loop's fastest rate: of the body, and of the linear plant
COARSE = 0.01  # s, the longest step of a plant without a timestep of its own
HEADING = "Balance with a wrong internal model"
BANDWIDTH = 5.0  # Hz, of the torques that a page adds where the run file has no noise


def build_live(case: Case, out: Path | str, *, progress: Callable[[float], None] | None = None) -> None:
    """Write a page that simulates ``case`` live in a browser: one HTML file that requests nothing from anywhere.

    Args:
        case: the case; the run file's state at t = 0 is the page's.
        out: the page.
        progress: called repeatedly with the completed fraction of the predictions, 0–1.

    Raises:
        ReportError: if a page cannot simulate this case; the message names the reason.
        OSError: if the page cannot be written.

    Example:
        >>> import icmj
        >>> icmj.build_live(icmj.prepare(icmj.load_run("simple-0.8")), "live.html")  # doctest: +SKIP
    """
    write_text(Path(out), page(describe(case, progress=progress)))


def page(description: Mapping[str, Any]) -> str:
    """The page's HTML."""
    code = join_scripts("loop.js", "theory.js", "body.js", "live.js")
    return make_environment().get_template("live.html.j2").render(
        title=description["title"], changes=description["changes"], heading=HEADING if description["table"] else "",
        version=VERSION, description=script(description), code=code,
    )  # fmt: skip


@limit_to_one_thread()
def describe(case: Case, *, progress: Callable[[float], None] | None = None) -> dict[str, Any]:
    """All that the page's script reads, as plain data.

    Raises:
        ReportError: as of :func:`build_live`.
    """
    run, actual = case.run, case.actual
    law = case.controller
    if refusal := _refusal(case):
        raise ReportError(f"{run.path}: there is no live page of this case; {refusal}")
    linear = actual.linearisation.plant
    links, why = find_chain(actual) if isinstance(actual, MujocoPlant) else (None, "it is given by matrices")
    chain = None if why else links
    b = _gain(case)
    unit = replace(linear, B=linear.B / b, B_d=np.zeros((0, 0)), pushes={})
    rate = find_fastest_rate(linear, law)
    longest = case.stepping.timestep if isinstance(actual, MujocoPlant) else min(COARSE, FINE / rate)
    acting, noise = _acting(case, linear)
    shown = quantities(linear)
    names = zip(linear.inputs, linear.input_units or ("",) * linear.n_u, strict=True)
    described: dict[str, Any] = {
        "name": run.case.name, "title": re.sub(r", b = [\d.]+(?![\d.])", "", one_line(run.title, 130)),
        "changes": run.changes_in_words, "kind": law.kind,
        "b": b, "delay": 0.0, "q": 1.0, "least": 0.0, "unit": "",
        "plant": {letter: getattr(unit, letter).tolist() for letter in "ABC"} | {"chain": chain and links_of(chain)},
        "why": why,
        "acting": acting, "noise": noise, "limit": _limits(case, linear),
        "step": {"body": longest, "linear": min(longest / 4, LINEAR / rate)}, "rate": rate,
        "outputs": [
            [one_line(name, 60), quantity.unit.replace("deg", "°"), quantity.factor]
            for name, quantity in zip(linear.outputs, shown, strict=True)
        ],
        "inputs": [[one_line(name, 60), unit] for name, unit in names],
        "body": links and chain_body(links, _positions(actual), run.study.magnification),
        "table": None,
    }  # fmt: skip
    return described | (_rule(case, unit, progress or (lambda done: None)) if case.theory else _law(case))


def _refusal(case: Case) -> str:
    """Why the page's loop cannot simulate a case; empty if it can."""
    law, settings = case.controller, case.settings
    real = law.realisation
    if case.run.setpoint:
        return "the page moves no set-point; leave out [setpoint]"
    if real.commands or real.period < np.inf or len(real.signals):
        return (
            f"a {law.kind} controller reads its own commands or is reset by a clock, which the page's loop does not do"
        )
    if case.theory is None and not real.tapped:
        return "the page has an event rule, or a controller that reads delayed outputs, and this one has neither"
    if real.sampling:
        return "events of the page come at once; leave out sampling_delay"
    if case.theory and case.theory.system.delay.predicted != case.theory.system.delay.t_d:
        return "the page has one slider for actual and assumed delay; leave out [actual] delay"
    if real.tapped and (real.eventful or any(len(guard.Q) > real.N.shape[1] for guard in real.guards)):
        return "modes and events of the page follow from readings alone, and this controller's also from its state"
    if real.tapped and real.taps[-1] > LONGEST:
        return f"the page remembers readings of {LONGEST:g} s, and the delay is {real.taps[-1]:g} s"
    if any(source.push is not None or isinstance(source, Gridded) for source in _place(settings)):
        return (
            "disturbances of the page are sinusoids, impulses and steps of commands or readings; leave out the others"
        )
    gain = np.atleast_1d(case.run.actual.gain)
    if not (np.ptp(gain) == 0 and gain[0] > 0):
        return "the page moves one input gain b; give [actual] gain as one positive number"
    return ""


def _place(settings: Settings) -> list[Placed]:
    return [source for source in settings.disturbance if isinstance(source, Placed)]


def _gain(case: Case) -> float:
    if isinstance(case.actual, MujocoPlant):
        return float(case.actual.linearisation.ports.b[0])
    return float(np.atleast_1d(case.run.actual.gain)[0])


def _start(case: Case) -> list[float]:
    return [float(value) for value in make_plant_start(case.actual.linearisation.plant, case.settings)]


def _positions(plant: AnyPlant) -> list[int]:
    """The state of the plant that is each position of its model; −1 for one that is left out."""
    assert isinstance(plant, MujocoPlant)
    states = plant.linearisation.ports.states.tolist()
    return [states.index(i) if i in states else -1 for i in range(plant.model.nv)]


def _limits(case: Case, plant: LinearPlant) -> list[list[Any]]:
    """(state, size, name) of each position whose departure ends the run; those without a limit are left out."""
    actual, limit = case.actual, case.settings.limit
    if isinstance(actual, MujocoPlant):
        all_sizes = dict(zip(_positions(actual), actual.limits(limit), strict=True))
        positions = [i for i in all_sizes if i >= 0]
        sizes = np.array([all_sizes[i] for i in positions])
    else:
        from icmj.linear.loop import find_positions

        positions = find_positions(plant).tolist()
        units = [(plant.state_units or ("",) * plant.n)[i] for i in positions]
        sizes = get_limits(limit, [plant.states[i] for i in positions], units)
    return [
        [int(i), float(size), one_line(plant.states[i], 60)]
        for i, size in zip(positions, sizes, strict=True)
        if np.isfinite(size)
    ]


def _acting(case: Case, plant: LinearPlant) -> tuple[list[list[Any]], dict[str, Any]]:
    """Terms (on commands 0 or readings 1, index, a, ω, φ, start, end), and what the slider of noise says.

    Where the run file has noise, the slider multiplies it; elsewhere it is torque of one size for all inputs, in
    proportion to what the predicted orbit, if there is one, asks of each.
    """
    parts = make_acting(plant, case.settings)
    terms = [
        [on, int(of.input[i]), *(float(each[i]) for each in (of.amplitude, of.omega, of.phase, of.start)), _end(of, i)]
        for on, of in enumerate((parts.disturbance, parts.errors))
        for i in range(len(of.input))
    ]
    if terms:
        return terms, {"own": True, "noisy": case.settings.noisy, "most": 3.0, "start": 1.0, "unit": ""}
    orbit = None if case.prediction is None else case.prediction.orbit
    share = np.ones(plant.n_u) if orbit is None else np.nan_to_num(orbit.u_peak, posinf=1.0)
    share = share / share[0] if share[0] > 0 and np.isfinite(share).all() else np.ones(plant.n_u)
    for index, size in enumerate(share):
        if size > 0:
            noise = Noise(input=plant.inputs[index], size=float(size), bandwidth=BANDWIDTH, seed=index + 1)
            terms += [[0, index, *map(float, term[:4]), None] for term in list_terms(noise)]
    most = 1.0 if orbit is None or not np.isfinite(orbit.u_peak).all() else float(orbit.u_peak[0])
    return terms, {"own": False, "noisy": True, "most": most, "start": 0.0, "unit": (plant.input_units or ("",))[0]}


def _end(of: Disturbance, i: int) -> float | None:
    return float(of.end[i]) if np.isfinite(of.end[i]) else None


def _law(case: Case) -> dict[str, Any]:
    """A controller that reads delayed outputs; it has no event rule."""
    real = case.controller.realisation
    delay = real.taps[0]
    return {
        "delay": delay,
        "delays": [0.02, LONGEST],
        "controller": _modes(real) | {
            "taps": [tap / delay for tap in real.taps],
            "guards": [{"Q": guard.Q.tolist(), "c": guard.c} for guard in real.guards],
            "table": None if real.table is None else real.table.tolist(),
            "resets": [{"delay": delay, "J": real.J.tolist(), "G": real.G.tolist()}],
        },
        "start": {"x": _start(case), "a": [0.0] * len(real.J)},
    }  # fmt: skip


def _modes(real: Realisation) -> dict[str, Any]:
    modes = [{"name": mode.name} | {name: getattr(mode, name).tolist() for name in "MNKS"} for mode in real.modes]
    return {
        "modes": modes, "R": real.R.tolist(), "cuts": real.cuts.tolist(), "tapped": real.tapped, "taps": [],
        "guards": [], "table": None, "readings": real.modes[0].S.shape[1], "sizes": list(real.layout.sizes),
    }  # fmt: skip


def _rule(case: Case, unit: LinearPlant, progress: Callable[[float], None]) -> dict[str, Any]:
    """The intermittent controller with the delays that its slider offers, and the predictions for each."""
    controller, theory = expect_rule(case, "a live page"), expect_theory(case, "a live page")
    own = controller.delay.t_d
    delays = sorted({*DELAYS, own})
    # the queue of one prediction is there whatever the delay, so that a delay can change where the motion is
    laws = [replace(controller, delay=Delay(delay)) for delay in delays]
    widest = laws[-1].realisation
    size = widest.layout.size
    resets = []
    for law, delay in zip(laws, delays, strict=True):
        J, G = np.eye(size), np.eye(size)
        at = slice(0, law.realisation.layout.size)
        J[at, at], G[at, at] = law.realisation.J, law.realisation.G
        resets.append({"delay": delay, "J": J.tolist(), "G": G.tolist()})
    model = controller.design.plant
    known = model.states
    x_o = [case.settings.observer.get(name, 0.0) for name in known]
    return {
        "exact": agree((model.A, model.B, model.C), (unit.A, unit.B, unit.C)), "delay": own, "delays": delays,
        "q": theory.rule.size, "least": theory.rule.delta_min,
        "controller": _modes(widest) | {"resets": resets},
        "start": {"x": _start(case), "a": x_o + x_o + [0.0] * (size - 2 * len(known))},
        "table": _table(case, theory, unit, delays, progress),
    }  # fmt: skip


def _table(
    case: Case, theory: Theory, unit: LinearPlant, delays: list[float], progress: Callable[[float], None]
) -> dict[str, Any]:
    """Predictions by delay and b; states of orbits are (x, x_o, x_h) at the event, for the file's threshold."""
    first, last = (round(round(g / STEP) * STEP, 6) for g in (min(GAINS[0], _gain(case)), max(GAINS[1], _gain(case))))
    gains = sorted({1.0, _gain(case), *(round(b, 6) for b in np.arange(first, last + STEP / 2, STEP))})
    rows: list[list[Any]] = []
    states: list[Array] = []
    last = case.run.analysis.delta_max
    done, total = 0, len(gains) * len(delays)
    for delay in delays:
        for b in gains:
            row, orbits = _row(theory, replace(unit, B=unit.B * b), Delay(delay), last)
            rows.append(row)
            states += orbits
            done += 1
            progress(done / total)
    return {
        "gains": gains,
        "last": last,
        "rows": rows,
        "states": base64.b64encode(np.array(states, dtype="<f4").tobytes()).decode(),
    }


def _row(theory: Theory, plant: LinearPlant, delay: Delay, last: float) -> tuple[list[Any], list[Array]]:
    """What is predicted, and the state of each orbit of the catalogue, shape (n + 2n̂,).

    The row has the place of the orbit at Δ_crit in the catalogue, or −1; what is not known; and of each orbit Δ [s], λ,
    the verdict and the largest multiplier, ``None`` where there is none.
    """
    try:
        system = error_system(plant, theory.system.design, theory.system.hold, delay=delay, match="position")
        found = predict(system, theory.rule, delta_max=last)
    except AnalysisError as error:
        return [-1, str(error), []], []
    orbits, states = [], []
    for one in found.orbits:
        delta, sign = float(f"{one.crossing.delta:.8g}"), one.orbit.sign
        orbits.append(
            [delta, sign, one.verdict, None if one.multiplier is None else round(min(one.multiplier, 99.0), 4)]
        )
        state = np.concatenate(system.start(one.orbit.x_bar))
        states.append(state if np.isfinite(one.orbit.gamma) else 0 * state)
    shown = next((i for i, one in enumerate(found.orbits) if one.orbit is found.orbit), -1)
    return [shown, found.gaps, orbits], states
