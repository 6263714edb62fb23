"""Offsets of fields in MuJoCo's C structs, with which compiled code reads and writes them.

The layout follows from the declarations that the package itself carries (``mujoco.introspect``) by the C rules of
alignment. :func:`check` compares it with addresses of a live model, so that a layout that is ever wrong is an error
at start-up instead of a wild write.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
from mujoco.introspect import ast_nodes, enums
from mujoco.introspect.structs import STRUCTS

from icmj.base.process import SWITCH
from icmj.errors import ModelError

POINTER = 8
SIZES = {
    "int": 4, "float": 4, "double": 8, "mjtNum": 8, "mjtSize": 8, "mjtBool": 1, "mjtByte": 1,
    "uint64_t": 8, "int64_t": 8, "size_t": 8, "uintptr_t": 8,
}  # fmt: skip


@cache
def offsets(struct: str) -> dict[str, int]:
    """Byte offset of every field of ``struct``, as far as all fields before it have a known size.

    Nested structs appear with dots: ``opt.timestep``.
    """
    return _layout(STRUCTS[struct].fields)[0]


def offset(struct: str, field: str) -> int:
    """Byte offset of one field.

    Raises:
        ModelError: if this version of MuJoCo has no such field, or a field before it is of unknown size.
    """
    try:
        return offsets(struct)[field]
    except KeyError:
        raise ModelError(
            f"MuJoCo {mujoco.__version__} declares no usable {struct}.{field}; icmj needs mujoco 4.0, or {SWITCH}"
        ) from None


def check(model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Compare the layout with the addresses of a live model and its data.

    Raises:
        ModelError: if they disagree.
    """
    import ctypes

    def word(base: int, at: int, kind: Any = ctypes.c_int64) -> Any:
        return kind.from_address(base + at).value

    m, d = model._address, data._address
    pairs = [
        (f"{struct}.{field}", word(base, offset(struct, field)), getattr(owner, field).ctypes.data)
        for struct, base, owner, fields in (
            ("mjModel", m, model, ("qpos0", "numeric_data", "numeric_adr", "actuator_dynprm", "actuator_actadr")),
            ("mjData", d, data, ("qpos", "qvel", "act", "ctrl", "act_dot", "sensordata", "qacc_warmstart")),
        )
        for field in fields
        if getattr(owner, field).size
    ]
    pairs += [(f"mjModel.{n}", word(m, offset("mjModel", n)), getattr(model, n)) for n in ("nq", "nu", "nnumeric")]
    pairs += [
        ("mjModel.opt.timestep", word(m, offset("mjModel", "opt.timestep"), ctypes.c_double), model.opt.timestep),
        ("mjData.time", word(d, offset("mjData", "time"), ctypes.c_double), data.time),
    ]
    wrong = [name for name, found, expected in pairs if found != expected]
    if wrong:
        raise ModelError(
            f"MuJoCo {mujoco.__version__} does not lie in memory as it declares ({', '.join(wrong)}); {SWITCH}"
        )


def _layout(fields: Any) -> tuple[dict[str, int], int, int]:
    """(offsets, size, alignment) of a struct's fields; stops at the first field of unknown size, with size −1."""
    found: dict[str, int] = {}
    at, alignment = 0, 1
    for field in fields:
        size, align, inner = _type(field.type)
        if size < 0:
            return found, -1, 1
        at = -(-at // align) * align
        found[field.name] = at
        found |= {f"{field.name}.{name}": at + value for name, value in inner.items()}
        at += size
        alignment = max(alignment, align)
    return found, -(-at // alignment) * alignment, alignment


def _type(kind: Any) -> tuple[int, int, dict[str, int]]:
    if isinstance(kind, ast_nodes.PointerType):
        return POINTER, POINTER, {}
    if isinstance(kind, ast_nodes.ArrayType):
        size, align, _ = _type(kind.inner_type)
        for extent in kind.extents:
            size *= extent
        return size, align, {}
    if isinstance(kind, ast_nodes.AnonymousStructDecl):
        inner, size, align = _layout(kind.fields)
        return size, align, inner
    name = getattr(kind, "name", "").removeprefix("struct ")
    if name in SIZES:
        return SIZES[name], SIZES[name], {}
    if name in enums.ENUMS:
        return 4, 4, {}
    if name in STRUCTS:
        inner, size, align = _layout(STRUCTS[name].fields)
        return size, align, inner
    return -1, 1, {}
