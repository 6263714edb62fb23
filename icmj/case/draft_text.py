"""The text of a first run file: the choices that were made and, in comments, the alternatives of the model."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from icmj.engine.inventory import Inventory
from icmj.plant.linear_plant import LinearPlant
from icmj.plant.selection import OperatingKind
from icmj.runfile.keys import key_text, value_text
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


def draft_text(draft: Draft) -> str:
    """The run file."""
    return "\n".join([*_head(draft), *_plants(draft), *_rest(draft)]) + "\n"


def _head(draft: Draft) -> Iterable[str]:
    name, there = case_name(draft.model), draft.there
    yield f"# A first run file for {_plain(draft.model.name)}: icmj analyse {_plain(draft.out.name)}, then icmj run."
    yield "# Change what you like; every key has a default where it is not said. What the model has to choose from:"
    yield "#"
    for kind, names in (
        ("keyframes", dict.fromkeys(there.keyframes, "")),
        ("actuators", there.inputs),
        ("sensors", there.outputs),
        ("joints", there.joints),
    ):
        yield from _listed(kind, names)
    yield from ("", "[case]", f"name = {value_text(name)}", f"title = {value_text(name)}", "")


def _plants(draft: Draft) -> Iterable[str]:
    there = draft.there
    yield _line("[assumed]", "the plant that the controller believes in")
    yield f"model = {value_text(_place(draft))}"
    others = [name for name in there.keyframes if name != draft.keyframe]
    if draft.keyframe is not None:
        yield _line(f"keyframe = {value_text(draft.keyframe)}", f"or {_joined(others)}" if others else "")
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
    yield _line(f"outputs = {value_text(chosen)}", 'sensors or joints that it sees; "joints" means all')
    if draft.drop:
        yield _line(f"drop = {value_text(list(draft.drop))}", "states on which nothing depends")
    yield from (
        _line("# delay = 0.1", "neural delay [s], bridged by a predictor"),
        "",
        _line("[actual]", "the plant that is really there: the same, but for"),
        _line("gain = 0.9", "b: inputs do nine tenths of what the controller believes; or one for each"),
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
    yield from (
        _line(f"# timestep = {draft.there.timestep:g}", "the model's own [s]"),
        _line("limit = 1.0", "it has fallen when a position departs further than this [rad or m]; or by name"),
    )


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


def _listed(kind: str, names: Mapping[str, str]) -> Iterable[str]:
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


def _joined(names: list[str]) -> str:
    return ", ".join(map(_plain, names[:5])) + (", …" if len(names) > 5 else "")


def _line(text: str, comment: str) -> str:
    return f"{text:<{_COLUMN - 2}}  # {comment}" if comment else text


def _plain(name: str) -> str:
    """A name that may stand in a comment."""
    return re.sub(r"[\x00-\x1f\x7f]", " ", name)
