"""A first run file for a model.

It has an operating point, outputs, weights of suitable size, and alternatives in comments.
"""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from icmj.case.case import Case, expect_theory, prepare
from icmj.engine.inventory import Inventory, list_inventory
from icmj.engine.plant import MujocoPlant, load_plant
from icmj.errors import IcmjError, ModelError
from icmj.plant.body import OperatingKind, OperatingRule, Selection
from icmj.plant.linear_plant import LinearPlant
from icmj.runfile.reading import parse_run
from icmj.runfile.schema import key_text, value_text
from icmj.work.shipped import SHIPPED

START = 0.02  # [rad or m]: small, and enough to see
_COLUMN, _MOST, _WIDTH = 32, 12, 110


@dataclass(frozen=True, eq=False)
class Draft:
    """The contents of a first run file.

    Attributes:
        model, out: the model's file, and where the run file will lie.
        there: what the model has.
        keyframe, rule: operating point.
        plant: its linearisation; ``None`` where there is none.
        outputs: chosen ones, or "joints".
        drop: states left out.
        R_c, R_o: weights.
        timestep: of runs with RK4 [s], where the model's own steps would be taken and are of first order; or ``None``.
    """

    model: Path
    out: Path
    there: Inventory
    keyframe: str | None
    rule: OperatingKind
    plant: LinearPlant | None
    outputs: tuple[str, ...] | str
    drop: tuple[str, ...]
    R_c: float
    R_o: float
    timestep: float | None = None


def draft_text(draft: Draft) -> str:
    """The run file."""
    return "\n".join([*_head(draft), *_plants(draft), *_rest(draft)]) + "\n"


def _head(draft: Draft) -> Iterable[str]:
    name, there = case_name(draft.model), draft.there
    yield f"# A first run file for {_plain(draft.model.name)}: icmj analyse {_plain(draft.out.name)}, then icmj run."
    yield "# Change what you like; a key that is left out has its default. The model has:"
    yield "#"
    for kind, names in (
        ("keyframes", dict.fromkeys(there.keyframes, "")),
        ("actuators", there.inputs),
        ("sensors", there.outputs),
        ("joints", there.joints),
    ):
        yield from _list_lines(kind, names)
    yield from ("", "[case]", f"name = {value_text(name)}", f"title = {value_text(name)}", "")


def _plants(draft: Draft) -> Iterable[str]:
    there = draft.there
    yield _line("[assumed]", "the plant that the controller assumes")
    yield f"model = {value_text(_place(draft))}"
    others = [name for name in there.keyframes if name != draft.keyframe]
    if draft.keyframe is not None:
        yield _line(f"keyframe = {value_text(draft.keyframe)}", f"or {_join(others)}" if others else "")
    elif there.keyframes:
        yield _line(f"# keyframe = {value_text(there.keyframes[0])}", "the reference configuration, if none is named")
    said = {
        "as given": 'it rests there by itself; or "static control", "balance"',
        "static control": 'the controls hold it there; or "balance", which moves the joints, too',
        "balance": "near there, where it can be held",
    }
    yield _line(f"operating_point = {value_text(draft.rule)}", said[draft.rule] if draft.plant else "")
    yield _line(f"inputs = {value_text(list(there.inputs))}", "actuators that the controller uses")
    chosen = draft.outputs if isinstance(draft.outputs, str) else list(draft.outputs)
    yield _line(f"outputs = {value_text(chosen)}", 'sensors or joints that it reads; "joints" means all')
    if draft.drop:
        yield _line(f"drop = {value_text(list(draft.drop))}", "states on which nothing depends")
    yield from (
        _line("# delay = 0.1", "neural delay [s], bridged by a predictor"),
        "",
        _line("[actual]", "the plant that is really there: the same, but for"),
        _line("gain = 0.9", "b: inputs do nine tenths of what the controller assumes; or one for each"),
    )
    if there.bodies:
        yield from (
            "# [[actual.change]]             # or another property, such as mass, length, damping, stiffness, gravity",
            '# what = "mass"',
            f"# of = {value_text(there.bodies[-1])}",
            "# factor = 1.1",
        )


def _rest(draft: Draft) -> Iterable[str]:
    unit = _unit(draft)
    yield from (
        "",
        _line("[design]", "LQ design; large weights make it gentle"),
        _line(f"R_c = {value_text(draft.R_c)}", "of the inputs against the outputs"),
        _line(f"R_o = {value_text(draft.R_o)}", "of the outputs' noise against the inputs'"),
        "",
        "[controller]",
        _line('hold = "system-matched"', 'or "zero-order"'),
        _line("q_t = 0.01", f"threshold{unit}: the amplitude of a cycle goes with it, its period does not"),
        _line("delta_min = 0.01", "least time between two events [s]: the refractory period"),
        "",
        "[analysis]",
        _line("delta_max = 3.0", "crossings are searched on (0, delta_max] [s]"),
        "",
        "[simulation]",
        _line("duration = 30.0", "[s]"),
    )
    state = _start(draft)
    if state is not None:
        yield _line(f"initial = {{ {key_text(state)} = {START} }}", "departure from the operating point [rad or m]")
    own = f"{draft.there.timestep:g}"
    if draft.timestep is None:
        yield _line(f"# timestep = {own}", "the model's own [s]")
    else:
        yield _line(f"timestep = {draft.timestep:g}", f"[s]; the model has {own} with an integrator of first order")
        yield _line('integrator = "RK4"', "of fourth order")
    yield from (_line("limit = 1.0", "it has fallen when a position departs further than this [rad or m]; or by name"),)


def case_name(model: Path) -> str:
    """A case's name for a model: that of its file, as far as it may stand in one."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", model.stem).strip("-._")[:80] or "mine"


def _place(draft: Draft) -> str:
    """The model's path, as short as it stays right when both files are moved together."""
    model, folder = draft.model.resolve(), draft.out.parent.resolve()
    common = Path(os.path.commonpath([model, folder]))
    if SHIPPED.resolve() in model.parents or len(common.parts) < 2:  # in an installed package, or on other ways
        return model.as_posix()
    return Path(os.path.relpath(model, folder)).as_posix()


def _start(draft: Draft) -> str | None:
    """A position that the run departs in: the first joint that an actuator drives, or that is seen, if one is."""
    if draft.plant is None:
        return None
    there = [name for name in draft.plant.states if draft.there.joints.get(name)]
    driven = [name for name in there if name in draft.there.driven]
    seen = [name for name in there if name in draft.plant.outputs]
    return next(iter((*driven, *seen, *there)), None)


def _unit(draft: Draft) -> str:
    units = set(draft.plant.output_units) if draft.plant else set()
    return f" [{units.pop()}]" if len(units) == 1 and "" not in units else " [unit of the outputs]"


def _list_lines(kind: str, names: Mapping[str, str]) -> Iterable[str]:
    shown = [f"{_plain(name)} ({unit})" if unit else _plain(name) for name, unit in list(names.items())[:_MOST]]
    if len(names) > _MOST:
        shown.append(f"and {len(names) - _MOST} more")
    yield from textwrap.wrap(
        ", ".join(shown) or "none",
        _WIDTH,
        initial_indent=f"#   {kind:<11}",
        subsequent_indent=f"#   {'':<11}",
        break_on_hyphens=False,
    )


def _join(names: list[str]) -> str:
    return ", ".join(map(_plain, names[:5])) + (", …" if len(names) > 5 else "")


def _line(text: str, comment: str) -> str:
    return f"{text:<{_COLUMN - 2}}  # {comment}" if comment else text


def _plain(name: str) -> str:
    """A name that may stand in a comment."""
    return re.sub(r"[\x00-\x1f\x7f]", " ", name)


RULES: tuple[OperatingKind, ...] = ("as given", "static control", "balance")
MOTION = ("rad", "m", "rad/s", "m/s", "")  # forces and accelerations jump with the inputs
MOST_KEYFRAMES = 6  # that are tried


@dataclass(frozen=True, eq=False)
class FirstRunFile:
    """A first run file.

    Attributes:
        text: of the run file.
        case: made of it; ``None`` where something is in the way.
        trouble: what that is, in one line; "" if nothing is.
    """

    text: str
    case: Case | None
    trouble: str


def draft_run(model: Path, out: Path, keyframe: str | None = None) -> FirstRunFile:
    """A commented run file for a model, to be written to ``out``, with the model's own names in it.

    Of the model's keyframes, or its reference configuration, it takes the first at which the model rests by itself,
    else the first at which controls can hold it, else one near which it balances; as outputs all sensors but those that
    jump with the inputs, or joints where sensors leave something unseen. Weights are of the size of the plant's gain.

    Args:
        model: MJCF file.
        out: where the run file will lie; the model's path in it is relative to that, if it is on the way.
        keyframe: the one to take.

    Raises:
        ModelError: if the model cannot be loaded, or has no such keyframe.
    """
    there = list_inventory(model)
    if keyframe is not None and keyframe not in there.keyframes:
        raise ModelError(f"{model}: no keyframe {keyframe!r}; it has {', '.join(there.keyframes) or 'none'}")
    nothing = Draft(model, out, there, keyframe, "as given", None, "joints", (), 1.0, 1.0)
    best, trouble = None, ""
    for keyed, rule in _attempts(there, keyframe):
        try:
            plant, outputs, drop = _choose(model, there, keyed, rule)
        except IcmjError as error:
            trouble = str(error)
            continue
        draft = Draft(model, out, there, keyed, rule, plant.linearisation.plant, outputs, drop, *weights(plant))
        text = draft_text(draft)
        try:
            expect_theory(case := prepare(parse_run(text, out)), "a first run file")
            if (timestep := choose_timestep(case)) is not None:
                text = draft_text(replace(draft, timestep=timestep))
                case = prepare(parse_run(text, out))
            return FirstRunFile(text, case, "")
        except IcmjError as error:
            best = best or FirstRunFile(text, None, str(error).removeprefix(f"{out}: "))
    return best or FirstRunFile(draft_text(nothing), None, trouble)


def choose_timestep(case: Case) -> float | None:
    """A step of one digit for RK4 [s], no longer than the model's own, where that would be taken and is of first order.

    It is the one that would be chosen were the motion smooth; ``None`` where it is chosen, or the model has RK4.
    """
    from icmj.engine.accuracy import order_of
    from icmj.engine.closed_loop import close_loop
    from icmj.engine.stepping import DEFAULT_TOLERANCE, choose_step

    law, settings, own = case.controller, case.settings, case.stepping
    loop = close_loop(case.model.matched(law.plant, "position"), law, settings)
    if own.tolerance or order_of(loop.model) > 1:
        return None
    step = min(choose_step(loop, settings, DEFAULT_TOLERANCE), own.timestep)
    digit = 10.0 ** np.floor(np.log10(step))
    return float(f"{np.floor(step / digit) * digit:.0e}")


def weights(plant: MujocoPlant) -> tuple[float, float]:
    """R_c and R_o for which the costs of control and of outputs are of similar size.

    |G|² of the plant's response from inputs to outputs about its fastest unstable rate, a tenth and a hundredth of it.
    """
    linear: LinearPlant = plant.linearisation.plant
    rates = linear.poles.real
    fastest = float(rates.max()) if rates.max() > 1e-3 else float(np.median(np.abs(linear.poles)))
    s = complex(0.1, 1.0) * max(fastest, 0.1)
    G = linear.C @ np.linalg.solve(s * np.eye(linear.n) - linear.A, linear.B.astype(complex))
    size = float(np.abs(G).max()) ** 2
    return _round_digit(0.1 * size), _round_digit(0.01 * size)


def _round_digit(value: float) -> float:
    """Round to one digit, within the range that a run file accepts."""
    return float(f"{min(max(value, 1e-12), 1e12):.0e}") if np.isfinite(value) else 1.0


def _attempts(there: Inventory, keyframe: str | None) -> Iterator[tuple[str | None, OperatingKind]]:
    keyframes: list[str | None] = [keyframe] if keyframe else [*there.keyframes[:MOST_KEYFRAMES], None]
    for rule in RULES:
        for keyed in keyframes:
            yield keyed, rule


def _choose(
    model: Path, there: Inventory, keyframe: str | None, rule: OperatingKind
) -> tuple[MujocoPlant, tuple[str, ...] | str, tuple[str, ...]]:
    """The plant at one operating point, its outputs, and the states that affect neither outputs nor other states.

    Raises:
        ModelError: if it does not rest there, or has no outputs.
    """
    # sensors of places and rates, if any tells where anything is
    outputs: tuple[str, ...] | str = "joints"
    if {"rad", "m"} & set(there.outputs.values()):
        outputs = tuple(name for name, unit in there.outputs.items() if unit in MOTION)
    drop: tuple[str, ...] = ()
    for _ in range(4):
        plant = load_plant(
            model, keyframe=keyframe, selection=Selection(outputs=outputs, drop=drop), operating=OperatingRule(rule)
        )
        quality = plant.quality
        errors = [notice for notice in quality.notices if notice.severity == "error"]
        for notice in errors:
            if notice.kind == "not at rest":
                raise ModelError(notice.words)
        lost = {name for mode in quality.uncontrollable if not mode.stable for name in mode.states} & {*quality.idle}
        unseen = any(not mode.stable for mode in quality.unobservable)
        if lost - {*drop}:
            drop = (*drop, *sorted(lost - {*drop}))
            seen = tuple(there.joints) if outputs == "joints" else outputs
            outputs = tuple(name for name in seen if name not in drop)
        elif quality.feedthrough and outputs != "joints":
            outputs = tuple(name for name in outputs if name not in quality.feedthrough) or "joints"
        elif unseen and outputs != "joints" and outputs != tuple(there.joints):
            outputs = tuple(name for name in there.joints if name not in drop) if drop else "joints"
        else:
            break
    return plant, outputs, drop
