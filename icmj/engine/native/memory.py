"""The engine's memory in compiled code: its fields by name, and arrays without a reference count.

The engine's code is compiled as :mod:`icmj.base.compilation` does, with the engine's functions within reach.

Compiled code reads and writes MuJoCo's structs in place and calls the engine's functions by their symbols, so that
numba can keep it on disk and the next process starts without compiling. Interpreted, the same code calls these
functions through MuJoCo's Python bindings: models and data are then objects, and arrays go to the engine as they are.

This is one of two modules that use what a library does not promise to keep (the other is :mod:`icmj.base.linking`):
through MuJoCo's bindings alone each step would go by way of Python, and take several times as long. MuJoCo's version is
therefore fixed in ``pyproject.toml``, and :func:`check` compares the layout with the bindings for each model.

Compiled code has addresses of models and data, and offsets of their fields; interpreted code has MuJoCo's own objects,
and the fields' names. :func:`size`, :func:`number`, :func:`doubles` and :func:`integers` read both.
"""

from __future__ import annotations

import ctypes
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np

from icmj.base.compilation import allocating, call, compiled, entry, exact, hash_contents, inlined, merged, viewing
from icmj.base.compilation import c_entry as entry_cfunc
from icmj.base.process import INTERPRETED, SWITCH
from icmj.engine.faults import guard
from icmj.errors import ModelError

MODEL_AND_DATA = "void(intp, intp)"


@cache
def _load_engine() -> None:
    """Make the engine's symbols known to compiled code.

    Raises:
        ModelError: if MuJoCo's library is not where its package is.
    """
    import llvmlite.binding  # type: ignore[import-untyped]

    folder = Path(mujoco.__file__).parent
    libraries = [*folder.glob("libmujoco*"), *folder.glob("mujoco.dll")]
    if not libraries:
        raise ModelError(f"{folder}: no MuJoCo library here; {SWITCH}")
    llvmlite.binding.load_library_permanently(str(libraries[0]))


@cache
def sources() -> int:
    """A number that changes with any source file of the engine, whose functions and constants compiled code holds."""
    return hash_contents(Path(__file__).parents[1], mujoco.__version__)


def engine_function(name: str, signature: str = MODEL_AND_DATA) -> Any:
    """A function of MuJoCo, for both compiled and interpreted code.

    In the signature pointers are integers of their size: the same registers, and no type to convert.

    Raises:
        ModelError: if MuJoCo's library is not where its package is.
    """
    if INTERPRETED:
        return _solve if name == "mj_solveM" else getattr(mujoco, name)
    from numba import types
    from numba.core.sigutils import normalize_signature

    _load_engine()
    arguments, result = normalize_signature(signature)
    return types.ExternalFunction(name, result(*arguments))


def _solve(model: mujoco.MjModel, data: mujoco.MjData, x: Any, y: Any, n: int) -> None:
    """mj_solveM with its right-hand sides as C takes them, one after the other; the bindings want a matrix."""
    mujoco.mj_solveM(model, data, x.reshape(n, -1), y.reshape(n, -1))


def run_guarded(dispatcher: Any, arguments: tuple[Any, ...], faulty: bool) -> Any:
    """``dispatcher(*arguments)``; where it is ``faulty`` MuJoCo may give up in it, which is caught.

    Raises:
        EngineFault: if MuJoCo gives up; ``mujoco.FatalError`` of its bindings where the code is interpreted.
    """
    if faulty and not INTERPRETED:
        return guard(lambda: call(dispatcher, *arguments))
    return call(dispatcher, *arguments)


# numba rewrites signatures of intrinsics and calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload, no-untyped-def, no-redef"


if not INTERPRETED:  # a MuJoCo that does not declare its structs is interpreted
    from mujoco.introspect import ast_nodes, enums
    from mujoco.introspect.structs import STRUCTS

LONG = 1 << 40  # elements of an array whose length nobody asks for


class Cell:
    """A number of a model or its data as an array of one element, where Python has it as an attribute."""

    def __init__(self, owner: Any, name: str) -> None:
        self._owner, self._name = owner, name

    def __getitem__(self, index: int) -> float:
        return float(getattr(self._owner, self._name))

    def __setitem__(self, index: int, value: float) -> None:
        setattr(self._owner, self._name, value)


class Warnings:
    """MuJoCo's warnings of a run as rows (last information, number of times), where Python has them as objects."""

    def __init__(self, data: Any) -> None:
        self._data = data

    def __len__(self) -> int:
        return len(self._data.warning)

    def __getitem__(self, index: tuple[int, int]) -> int:
        warning = self._data.warning[index[0]]
        return int((warning.lastinfo, warning.number)[index[1]])


def field(struct: str, name: str) -> Any:
    """The key of a field of ``mjModel`` or ``mjData`` for the functions below: its name, or its offset when compiled.

    Raises:
        ModelError: as :func:`offset`.
    """
    return name if INTERPRETED else offset(struct, name)


class Handles(NamedTuple):
    """Pointers to model and data for the engine's functions, and their numbers as writable arrays."""

    model: Any
    data: Any
    timestep: Any
    time: Any
    warnings: Any


def handles_of(model: mujoco.MjModel, data: mujoco.MjData) -> Handles:
    """The handles of a model and its data, which must outlive them.

    Raises:
        ModelError: if MuJoCo's structs do not lie in memory as they are declared.
    """
    if INTERPRETED:
        return Handles(model, data, Cell(model.opt, "timestep"), Cell(data, "time"), Warnings(data))
    check(model, data)
    m, d = model._address, data._address
    timestep = _view(m + offset("mjModel", "opt.timestep"), ctypes.c_double, 1)
    time = _view(d + offset("mjData", "time"), ctypes.c_double, 1)
    warnings = _view(d + offset("mjData", "warning"), ctypes.c_int32, 2 * len(data.warning)).reshape(-1, 2)
    return Handles(m, d, timestep, time, warnings)


def _view(address: int, kind: Any, size: int) -> np.ndarray:
    return np.ctypeslib.as_array((kind * size).from_address(address))


if INTERPRETED:

    def bare(kept):
        """The argument itself; compiled code removes the reference count here."""
        return kept

    def address(array):
        """The object that the Python bindings take in place of an address."""
        return array

    def size(owner, name):
        """A size of a model."""
        return getattr(owner, name)

    number = size

    def doubles(owner, name):
        """An array of the engine's, row by row."""
        return getattr(owner, name).reshape(-1)

    integers = doubles

else:
    from numba import carray, types
    from numba.core import cgutils
    from numba.extending import intrinsic

    @intrinsic
    def bare(typing_context: Any, kept: Any) -> Any:
        """The same array, or named tuple of arrays and numbers, without reference counts.

        Counting references is atomic, and a step would count a hundred of them. Whoever calls it keeps the memory
        alive.
        """

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return _uncounted(context, builder, kept, arguments[0])

        return kept(kept), codegen

    def _uncounted(context: Any, builder: Any, kind: Any, value: Any) -> Any:
        if isinstance(kind, types.Array):
            array = context.make_array(kind)(context, builder, value)
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            array.parent = cgutils.get_null_value(array.parent.type)
            return array._getvalue()
        if isinstance(kind, types.BaseTuple):
            inner: Any = kind
            for i, each in enumerate(inner):
                part = _uncounted(context, builder, each, builder.extract_value(value, i))
                value = builder.insert_value(value, part, i)
        return value

    @intrinsic
    def pointer(typing_context: Any, address: Any) -> Any:
        """An address as a ``voidptr``."""

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], cgutils.voidptr_t)

        return types.voidptr(types.intp), codegen

    @inlined
    def address(array):
        """Address of the first element of an array."""
        return array.ctypes.data

    @viewing
    def size(base, offset):
        """A size, or an address, of a struct."""
        return carray(pointer(base + offset), 1, np.int64)[0]

    @viewing
    def number(base, offset):
        """A floating-point number of a struct."""
        return carray(pointer(base + offset), 1, np.float64)[0]

    @viewing
    def doubles(base, offset):
        """An array of the engine's, row by row; its length is not known."""
        return carray(pointer(size(base, offset)), LONG, np.float64)

    @viewing
    def integers(base, offset):
        """An array of the engine's, row by row; its length is not known."""
        return carray(pointer(size(base, offset)), LONG, np.int32)


# offsets of fields in MuJoCo's C structs, from the declarations that the package itself carries (``mujoco.introspect``)
# by the C rules of alignment; ``check`` compares them with addresses of a live model, so that a layout that is ever
# wrong is an error at start-up instead of a wild write

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


__all__ = [
    "allocating",
    "compiled",
    "engine_function",
    "entry",
    "entry_cfunc",
    "exact",
    "inlined",
    "merged",
    "run_guarded",
    "sources",
]
