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

The names that ``__init__.pyi`` lists are loaded on first use, so that importing icmj costs nothing.
"""

import lazy_loader

from icmj.base.version import VERSION as __version__  # noqa: F401

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
