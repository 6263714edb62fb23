"""Centres of pressure in tables: there is one only where somebody stands on the plate, as its vertical force tells."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from icmj.series.c3d_reader import LEAST_LOAD
from icmj.series.series import Series
from icmj.series.units import QUANTITIES, find_factor

# of names in small letters, without what separates their parts; what is left of one tells the plate
_LOAD = re.compile(
    r"(?P<before>.*?)(?:(?:force)?(?:f|force|grf|groundreactionforce)(?P<number>\d*)(?:z|v|vert|vertical)|verticalforce"
    r"|groundforcevy)(?P<after>\d*)"
)
_CENTRE = re.compile(
    r"(?P<before>.*?)(?:cop|cent(?:er|re)ofpressure|groundforcep)(?P<number>\d*)(?:c?x|c?y|z|ap|ml)?(?P<after>\d*)|ap|ml"
    r"|[ac][xy](?P<alone>\d*)"  # of BioWare and Nexus
)


def find_loads(names: Sequence[str], units: Sequence[str]) -> dict[int, tuple[int, ...]]:
    """The vertical forces of the plates that each centre of pressure is of, by their places among some columns.

    Those whose names leave the same when the quantity is taken away (``plate1.cop.x`` and ``plate1.force.z``, ``COPx1``
    and ``Fz1``) are of one plate; what names no plate is of all, and a force that names none is everybody's.
    """
    named = {i: _plate(_LOAD, name) for i, name in enumerate(names) if _is_force(units[i])}
    forces = {i: plate for i, plate in named.items() if plate is not None}
    found = {}
    for i, name in enumerate(names):
        if i in forces or "/" in units[i] or (plate := _plate(_CENTRE, name)) is None:
            continue
        own = tuple(at for at, of in forces.items() if plate in ("", of) or not of)
        if own:
            found[i] = own
    return found


def is_centre(name: str) -> bool:
    """Whether it is the name of a coordinate of a centre of pressure."""
    return _plate(_CENTRE, name) is not None


def leave_out_unloaded(series: Series, loads: Mapping[str, Sequence[str]]) -> Series:
    """Without the centre of pressure in rows whose vertical force is below :data:`icmj.series.c3d_reader.LEAST_LOAD`.

    Where that is so in every row, as of data whose force is no number of newtons, all stay. Either is told among the
    facts.

    Args:
        series: centres and forces.
        loads: names of the vertical forces of each centre's plates.
    """
    values, said = series.values.copy(), dict[str, None]()
    for name, on in loads.items():
        unit = {force: series.units[series.names.index(force)] for force in on}
        size = [find_factor(unit[force], "force", force) if unit[force] else 1.0 for force in on]
        load = np.abs(series.values[:, [series.names.index(force) for force in on]] @ np.diag(size)).sum(axis=1)
        under = load < LEAST_LOAD  # a force that is missing tells nothing
        which = " + ".join(on)
        if under.all():
            said[f"{which} is below {LEAST_LOAD:g} N in every row, as on an empty plate; is it a force in N?"] = None
        elif under.any():
            values[under, series.names.index(name)] = np.nan
            last = f"the last of them at {series.t[under][-1]:.6g} s"
            said[
                f"{which} is below {LEAST_LOAD:g} N in {under.sum()} of {len(series)} rows, {last}, where there is no "
                "centre of pressure"
            ] = None
    facts = {**series.facts, "load": "; ".join(said)} if said else series.facts
    return replace(series, values=values, facts=facts)


def _plate(pattern: re.Pattern[str], name: str) -> str | None:
    """What the name of a quantity leaves when the quantity is taken away; ``None`` if it is no name of one."""
    found = pattern.fullmatch(re.sub(r"[\s._\-]+", "", name.lower()))
    return None if found is None else "".join(part or "" for part in found.groups())


def _is_force(unit: str) -> bool:
    return not unit or unit.replace(" ", "") in QUANTITIES["force"]
