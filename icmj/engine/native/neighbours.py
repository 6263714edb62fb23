"""The rates of the closed loop at many states and at neighbours of each, as one compiled function."""

# numba rewrites calls of types, which type checkers cannot see
# mypy: disable-error-code="call-arg, call-overload"

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.block import Slot, block_of
from icmj.engine.native.compilation import entry, run_guarded, sources
from icmj.engine.native.field import drive, flow
from icmj.engine.native.memory import bare
from icmj.engine.native.state import Engine, engine_of
from icmj.engine.stages import Stages

_WHOLE = int(Stages.WHOLE)


def neighbours_of(model: mujoco.MjModel, data: mujoco.MjData) -> Engine:
    """The data of :func:`rates_at` for a composed model and its data, which must outlive them."""
    block = block_of(model)
    assert block is not None
    return engine_of(model, data, block.header[Slot.PHASE : Slot.PHASE + 1], adaptive=True)


@cache
def _entry() -> Any:
    source = sources()

    @entry
    def visit(engine, rows, moves, still, rates):  # type: ignore[no-untyped-def]
        if source:
            e, rows, moves, rates = bare(engine), bare(rows), bare(moves), bare(rates)
            nq, nv, na = len(e.qpos), len(e.qvel), len(e.act)
            for i in range(len(rows)):
                seen = False
                for j in range(len(moves)):
                    for k in range(nq):
                        e.qpos[k] = rows[i, k] + moves[j, k]
                    for k in range(nv):
                        e.qvel[k] = rows[i, nq + k] + moves[j, nq + k]
                    for k in range(na):
                        e.act[k] = rows[i, nq + nv + k] + moves[j, nq + nv + k]
                    if seen and still[j] and e.stages != _WHOLE:
                        drive(e)
                    else:
                        flow(e)
                    seen = still[j]
                    for k in range(nv):
                        rates[i, j, k] = e.qvel[k]
                        rates[i, j, nv + k] = e.qacc[k]
                    for k in range(na):
                        rates[i, j, 2 * nv + k] = e.act_dot[k]

    return visit


def rates_at(engine: Engine, rows: Array, moves: Array, faulty: bool = False) -> Array:
    """(qvel, qacc, act_dot) at all ``rows`` (qpos, qvel, act), moved by each of ``moves``.

    Shapes (T, w), (m, w) → (T, m, 2 n_v + n_a). ``faulty`` says that MuJoCo may give up on the way.

    Raises:
        EngineFault: if it does.
    """
    engine.waves[:] = np.nan  # of another disturbance, perhaps
    still = ~moves[:, : len(engine.qpos) + len(engine.qvel)].any(axis=1)
    rates = np.empty((len(rows), len(moves), 2 * len(engine.qvel) + len(engine.act)))
    arguments = engine, np.ascontiguousarray(rows), np.ascontiguousarray(moves), still, rates
    run_guarded(_entry(), arguments, faulty)
    return rates
