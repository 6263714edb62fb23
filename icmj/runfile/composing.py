"""A run file composed in Python: from a linear plant, a controller and the settings of its run."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from icmj.controller.controller import Controller
from icmj.errors import AnalysisError, RunFileError, expect
from icmj.plant.linear_plant import LinearPlant, expect_linear
from icmj.runfile.keys import plain, to_toml
from icmj.runfile.reading import parse_run
from icmj.runfile.schema import RunFile
from icmj.simulation.settings import Settings
from icmj.simulation.sources import Gaussian, Source

FIRST = "# written from a plant and a controller that were put together in code\n"


def compose_run(
    actual: LinearPlant, controller: Controller, settings: Settings | None = None, *, name: str, title: str = ""
) -> RunFile:
    """The run file of a linear plant under a controller, both given by their matrices.

    Plants, gains k and L, the matrix of the hold, the rule and the delay are written to it, so that the run file is
    complete: :func:`icmj.prepare` makes the same case from it, and :func:`icmj.run_case` a result that can be logged.

    Args:
        actual: the actual plant; the assumed plant is that of the controller's design.
        controller: the controller; its trigger must be an event rule that run files support.
        settings: settings of its runs; the defaults if ``None``.
        name: name of the case and of its log.
        title: title for figures and tables; by default the name.

    Raises:
        RunFileError: if a run file cannot represent a part of it.
    """
    try:
        expect(controller, Controller, "a composed run file", "write the table [controller] of another kind yourself")
        expect_linear(actual, "the actual plant")
    except AnalysisError as error:
        raise RunFileError(str(error)) from error
    if controller.setpoint:
        raise RunFileError(
            "the controller has a set-point, which a run file has in tables of its own; compose it with "
            "replace(controller, setpoint=None), and add them with run.with_(setpoint=[...])"
        )
    design, delay = controller.design, controller.delay
    rule = dict(controller.trigger.facts())
    data = {
        "case": {"name": name, "title": title or name},
        "assumed": _plant(design.plant) | ({"delay": delay.predicted} if delay else {}),
        "actual": _plant(actual) | ({"delay": delay.t_d} if delay else {}),
        "design": {"k": design.k, "L": design.L},
        "controller": {"hold": "own", "A_h": controller.hold.A_h, "rule": "box" if "threshold" in rule else "quadratic"}
        | rule
        | ({"sampling_delay": controller.sampling_delay} if controller.sampling_delay else {}),
        "simulation": _settings(settings or Settings()),
    }
    return parse_run(FIRST + to_toml(plain(data)), Path(f"{name}.toml"))


def _plant(plant: LinearPlant) -> dict[str, Any]:
    named = (
        (plant.states, plant.state_units),
        (plant.inputs, plant.input_units),
        (plant.outputs, plant.output_units),
    )
    units = {name: unit for names, of in named for name, unit in zip(names, of, strict=True) if unit}
    return {
        "A": plant.A,
        "B": plant.B,
        "C": plant.C,
        **({} if np.array_equal(plant.B_d, plant.B) else {"B_d": plant.B_d}),
        "states": plant.states,
        "inputs": plant.inputs,
        "outputs": plant.outputs,
        **({"units": units} if units else {}),
    }


def _settings(settings: Settings) -> dict[str, Any]:
    sources = [{"kind": type(source).__name__.lower(), **_source(source)} for source in settings.disturbance]
    given = {name: value for name, value in vars(settings).items() if name != "disturbance"}
    return given | ({"disturbance": sources} if sources else {})


def _source(source: Source) -> dict[str, Any]:
    foreign = set() if getattr(source, "body", None) is not None else {"force", "torque", "point"}
    if isinstance(source, Gaussian):
        foreign.add("size" if source.share else "share")
    return {key: value for key, value in asdict(source).items() if key not in foreign}
