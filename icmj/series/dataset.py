"""A series as an ``xarray.Dataset``: signals of one kind are one variable, with names and units as coordinates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from icmj.base.array import Array
from icmj.errors import DataError

if TYPE_CHECKING:
    from xarray import Dataset

# signals called x.ankle, x.knee are the variable x along the dimension state, and so on
DIMENSIONS = {
    "x": "state",
    "y": "output",
    "y_max": "output",
    "y_min": "output",
    "u": "input",
    "applied": "input",
    "x_o": "assumed_state",
    "x_h": "assumed_state",
    "push": "push_name",
    "cop": "axis",
    "load": "contact",
    "r": "channel",
}


def dataset(
    t: Array, values: Array, names: Sequence[str], units: Sequence[str], facts: Mapping[str, str], along: str
) -> Dataset:
    """The dataset; see :meth:`icmj.series.series.Series.to_xarray`."""
    try:
        import xarray
    except ImportError as error:
        raise DataError("xarray is not installed; `pip install xarray`, or take the arrays of Series") from error
    variables: dict[str, Any] = {}
    coordinates: dict[str, Any] = {"t": (along, t, {"units": "s", "long_name": "time"})}
    for name, at in _variables(names).items():
        own = [units[i] for i in at]
        attributes = {"units": own[0]} if len(set(own)) == 1 else {}
        if names[at[0]] == name:
            taken = name in ("t", along, *DIMENSIONS.values())
            variables[f"{name}_signal" if taken else name] = (along, values[:, at[0]], attributes)
            continue
        labels, dimension = [names[i].split(".", 1)[1] for i in at], DIMENSIONS[name]
        if dimension in coordinates and list(coordinates[dimension][1]) != labels:
            dimension = f"{name}_name"  # of other signals than the variable before it
        coordinates[dimension] = (dimension, labels)
        coordinates[f"{name}_units"] = (dimension, own)
        variables[name] = ((along, dimension), values[:, at], attributes)
    return xarray.Dataset(variables, coordinates, dict(facts))


def _variables(names: Sequence[str]) -> dict[str, list[int]]:
    """The columns of each variable, in the order of the series."""
    found: dict[str, list[int]] = {}
    for i, name in enumerate(names):
        kind = name.split(".", 1)[0]
        found.setdefault(kind if "." in name and kind in DIMENSIONS else name, []).append(i)
    return found
