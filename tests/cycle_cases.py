"""Shipped cases, prepared once, for the tests of exact cycles."""

from functools import cache
from pathlib import Path
from typing import Any

import icmj
from icmj import Case, follow, load_run
from icmj.cycle.branch import Branch
from icmj.cycle.return_map import ReturnMap

RUNS = Path(__file__).parents[1] / "runs"


@cache
def case(name: str, **changes: Any) -> Case:
    """A shipped case with some run-file values changed; ``__`` in a name stands for the dot."""
    run = load_run(RUNS / f"{name}.toml")
    changed = {key.replace("__", "."): value for key, value in changes.items()}
    return icmj.prepare(run.with_(**{"simulation.limit": 3.0, **changed}))


def return_map(of: Case, plant: str = "mujoco") -> ReturnMap:
    """Its return map."""
    actual = of.actual.linearisation.plant if plant == "linear" else of.actual
    return ReturnMap(actual, of.controller, of.settings)


@cache
def branch(name: str, parameter: str, to: float, **how: Any) -> Branch:
    """A branch of a shipped case."""
    run = load_run(RUNS / f"{name}.toml").with_(**{"simulation.limit": how.pop("limit", 3.0)})
    return follow(run, parameter, to, **how)
