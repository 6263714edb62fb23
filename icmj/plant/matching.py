"""Inputs and outputs of two plants matched: by name where both have names, else by their place."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np

from icmj.errors import AnalysisError
from icmj.plant.linear_plant import LinearPlant, expect_linear

Match = Literal["name", "position"]
# what a plant gets that has no names, in this order: of icmj, and of python-control
_GENERATED = {"inputs": ("u{}", "u[{}]"), "outputs": ("y{}", "y[{}]")}


def matched(actual: LinearPlant, assumed: LinearPlant, match: Match = "name") -> LinearPlant:
    """``actual`` with its inputs and outputs in the order of those of the same name in ``assumed``.

    Where both have the same names they are matched by these, whatever they are; else, where either plant has no names
    of its own (u0, u1, … in this order, or python-control's u[0], …), by position, and for ``match="position"`` in any
    case.

    Raises:
        AnalysisError: if inputs or outputs differ in number, or both plants have names and not the same ones.
    """
    u, y = ports(actual, assumed, match)
    if (u == np.arange(actual.n_u)).all() and (y == np.arange(actual.n_y)).all():
        return actual
    return picked(actual, u, y)


def ports(actual: LinearPlant, assumed: LinearPlant, match: Match = "name") -> tuple[np.ndarray, np.ndarray]:
    """Indices of the inputs and outputs of ``actual`` that correspond to those of ``assumed``, shapes (n_u,), (n_y,).

    Raises:
        AnalysisError: see :func:`matched`.
    """
    expect_linear(actual, "the actual plant")
    if (actual.n_u, actual.n_y) != (assumed.n_u, assumed.n_y):
        raise AnalysisError(
            f"the actual plant has {actual.n_u} inputs and {actual.n_y} outputs, the assumed one "
            f"{assumed.n_u} and {assumed.n_y}; they must agree"
        )
    if match == "position":
        return np.arange(actual.n_u), np.arange(actual.n_y)
    return _order("inputs", actual.inputs, assumed.inputs), _order("outputs", actual.outputs, assumed.outputs)


def picked(plant: LinearPlant, u: np.ndarray, y: np.ndarray) -> LinearPlant:
    """The plant with inputs ``u`` and outputs ``y``, by their indices, in that order."""

    def of(names: tuple[str, ...], at: np.ndarray) -> tuple[str, ...]:
        return tuple(names[i] for i in at)

    return replace(
        plant,
        B=plant.B[:, u], B_d=plant.B_d[:, u], inputs=of(plant.inputs, u), input_units=of(plant.input_units, u),
        C=plant.C[y], outputs=of(plant.outputs, y), output_units=of(plant.output_units, y),
    )  # fmt: skip


def deviated(assumed: LinearPlant, actual: LinearPlant, rho: float) -> LinearPlant:
    """The paper's family A = Â − ρÃ₁, same for B, C and B_d: ``assumed`` at ρ = 0, ``actual`` at ρ = 1.

    Raises:
        AnalysisError: if the two plants differ in size, or in names.
    """
    if (assumed.n, assumed.n_u, assumed.n_y) != (actual.n, actual.n_u, actual.n_y):
        raise AnalysisError("the family in ρ needs assumed and actual plant of the same size")
    actual = matched(actual, assumed)
    if assumed.states != actual.states:
        raise AnalysisError("the family in ρ needs assumed and actual plant with the same states, in the same order")
    mixed = {name: (1 - rho) * getattr(assumed, name) + rho * getattr(actual, name) for name in ("A", "B", "C", "B_d")}
    return replace(assumed, **mixed)


def _order(what: str, here: tuple[str, ...], there: tuple[str, ...]) -> np.ndarray:
    if sorted(here) == sorted(there):
        return np.array([here.index(name) for name in there], dtype=int)
    if _nameless(what, here) or _nameless(what, there):
        return np.arange(len(here))
    raise AnalysisError(
        f"the actual plant has the {what} {', '.join(here)}, the assumed one {', '.join(there)}; name them alike, "
        f'or match them by position: match="position"'
    )


def _nameless(what: str, names: tuple[str, ...]) -> bool:
    return any(names == tuple(form.format(i) for i in range(len(names))) for form in _GENERATED[what])
