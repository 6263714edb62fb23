"""icmj: event-driven intermittent control, from linear eigen-analysis to a standing human in MuJoCo.

One way through::

    run = load_run("runs/three-link-0.9.toml")
    case = prepare(run)                      # plants, linearisation, design, error system, prediction
    simulation = simulate(case, "mujoco")    # or "linear"
    motion = measure(simulation, T_hat=case.system.T_hat)

or without a run file, from python-control systems::

    assumed = LinearPlant.from_statespace(system)
    design = design_lq(assumed, R_c=0.1, R_o=0.01)
    rule = EventTrigger(output_weight(design), q_t=0.01)
    prediction = predict(error_system(assumed.scaled(0.8), design), rule)
    controller = Controller(design, system_matched(design), rule)
    simulation = simulate_plant(assumed.scaled(0.8), controller, Settings(duration=20.0), x0=[0.02, 0.0])

What people meet first is here; the rest is in the rooms, such as :mod:`icmj.theory`. Each room lists its names in its
``__init__.pyi``; they are loaded on first use, so that importing icmj costs nothing.
"""

from importlib import import_module

import lazy_loader

from icmj.base import VERSION as __version__  # noqa: F401

_load, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> object:
    """A public name or a room; of a name that a room has, where it is.

    Raises:
        AttributeError: if icmj has no such name.
    """
    if name in __all__:
        return _load(name)
    if name == "fitting":  # a room of before, whose names warn
        return import_module("icmj.fitting")
    raise AttributeError(f"icmj has no attribute {name!r}{_where(name)}")


def _where(name: str) -> str:
    """The room whose stub lists the name, in words; nothing if none does."""
    from pathlib import Path

    for stub in sorted(Path(__file__).parent.glob("*/__init__.pyi")):
        if f" as {name}\n" in stub.read_text(encoding="utf-8"):
            return f"; it is icmj.{stub.parent.name}.{name}"
    return ""
