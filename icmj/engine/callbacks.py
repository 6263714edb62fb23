"""MuJoCo's process-global callbacks, installed for the length of a ``with`` block and always removed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import mujoco

# a Python function, or a native one as a ctypes function object
ControlCallback = Callable[..., None]
ActDynCallback = Callable[..., float]


@contextmanager
def installed(control: ControlCallback | None = None, act_dyn: ActDynCallback | None = None) -> Iterator[None]:
    """Install MuJoCo's control and activation callbacks; put back what was there on leaving, whatever happens.

    Load no model inside the block: an installed Python callback breaks the compiler.
    """
    before: tuple[Any, Any] = (mujoco.get_mjcb_control(), mujoco.get_mjcb_act_dyn())
    try:
        mujoco.set_mjcb_control(control)
        mujoco.set_mjcb_act_dyn(act_dyn)
        yield
    finally:
        mujoco.set_mjcb_control(before[0])
        mujoco.set_mjcb_act_dyn(before[1])
