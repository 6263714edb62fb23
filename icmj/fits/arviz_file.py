"""The file that ArviZ reads: a netCDF with groups posterior, prior, posterior_predictive and observed_data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from icmj.base.array import Array
from icmj.base.files import whole
from icmj.errors import FitError


def write_archive(
    path: Path | str,
    names: Sequence[str],
    units: Sequence[str],
    theta: Array,
    prior: Array,
    measures: Sequence[str],
    simulated: Array,
    observed: Array,
    facts: Mapping[str, str | float | int],
) -> None:
    """Write what was found of one person.

    Args:
        path: of the file, ending in ``.nc``.
        names, units: of the p numbers.
        theta, prior: draws of both, shape (n, p) each; one chain, as they are independent.
        measures: names of the measures of sway.
        simulated, observed: what trials measure, shape (n, m) and (k, m).
        facts: kept as attributes.

    Raises:
        FitError: if xarray and h5netcdf are missing, or it cannot be written.
    """
    try:
        import h5netcdf  # noqa: F401
        import xarray
    except ImportError as error:
        raise FitError(f"{path}: needs xarray and h5netcdf; in a checkout: pip install -e '.[fit]'") from error

    def numbers(drawn: Array) -> xarray.Dataset:
        draws = {"chain": [0], "draw": np.arange(len(drawn))}
        each = {
            name: (("chain", "draw"), column[None], {"units": unit})
            for name, unit, column in zip(names, units, drawn.T, strict=True)
        }
        return xarray.Dataset(each, draws)

    at = {"measure": list(measures)}
    predicted = xarray.Dataset(
        {"sway": (("chain", "draw", "measure"), simulated[None])},
        {"chain": [0], "draw": np.arange(len(simulated)), **at},
    )
    recorded = xarray.Dataset({"sway": (("trial", "measure"), observed)}, {"trial": np.arange(len(observed)), **at})
    tree = xarray.DataTree.from_dict(
        {
            "/": xarray.Dataset(attrs=dict(facts)),
            "/posterior": numbers(theta),
            "/prior": numbers(prior),
            "/posterior_predictive": predicted,
            "/observed_data": recorded,
        }
    )
    try:
        with whole(Path(path)) as part:
            tree.to_netcdf(part, engine="h5netcdf")
    except OSError as error:
        raise FitError(f"{path}: cannot be written ({error.strerror})") from error
