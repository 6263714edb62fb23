"""What a process of icmj sets for itself before it works.

How often garbage is collected, that code is compiled, and which settings of matplotlib hold. What is needed later is
imported beside other work.
"""

from __future__ import annotations

import gc
import os
import threading
from contextlib import chdir, suppress
from importlib import import_module

INTERPRETED = any(os.environ.get(name, "") not in ("", "0") for name in ("ICMJ_INTERPRETED", "NUMBA_DISABLE_JIT"))
"""Whether what is otherwise compiled runs as plain Python, as numba is asked to by a variable of its own, too; see
:mod:`icmj.base.compilation`."""
SWITCH = "set the environment variable ICMJ_INTERPRETED=1, with which the same code runs as plain Python"


def collect_garbage_seldom() -> None:
    """Have Python look for cyclic garbage less often: compiling and drawing make many objects, few in cycles.

    A tenth of the time of both goes into looking otherwise, and a sixth of that of a short run.
    """
    gc.set_threshold(300_000, 10, 10)


def import_in_background(name: str) -> None:
    """Import a module that is needed later, in a separate thread, while compiled code computes.

    Whoever imports it then waits for it; what goes wrong with it shows there.
    """

    def load() -> None:
        with suppress(Exception):
            import_module(name)

    threading.Thread(target=load, name=f"import {name}", daemon=True).start()


def load_matplotlib_apart() -> None:
    """Load matplotlib without ``matplotlibrc`` of the working folder, if there is one; for a process of icmj alone.

    matplotlib looks there first when it is imported. Its settings are then those of the user's own folder, or of the
    file that the environment names. No other thread may be at work yet: the process leaves the folder for the import.
    """
    if not os.path.lexists("matplotlibrc"):
        return
    for name in ("MATPLOTLIBRC", "MPLCONFIGDIR"):
        if os.environ.get(name):
            os.environ[name] = os.path.abspath(os.environ[name])
    with chdir(os.path.dirname(os.path.abspath(__file__))), suppress(ImportError):
        import_module("matplotlib")
