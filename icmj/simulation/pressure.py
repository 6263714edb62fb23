"""The ground reaction on a body that stands on a floor: centre of pressure and load of each contact, over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from icmj.base.array import Array, is_between

_MOVES = 1e-9  # m: an axis along which the centre moves less is not shown


@dataclass(frozen=True, eq=False)
class Pressure:
    """The ground reaction over time.

    Attributes:
        t: times of the rows [s], shape (N,).
        centre: centre of pressure (x, y) in the world [m], shape (N, 2); NaN in flight.
        at_rest: the same at the operating point, shape (2,).
        geoms: names of the geoms in contact with the ground.
        load: normal force on each of these geoms [N], shape (N, G).
        load_at_rest: the same at the operating point, shape (G,).
        t_after: times of the events [s], shape (K,); empty if the state after them is not known, as with a delay.
        centre_after, load_after: the same right after each event, when the torque has jumped; shapes (K, 2), (K, G).
    """

    t: Array
    centre: Array
    at_rest: Array
    geoms: tuple[str, ...]
    load: Array
    load_at_rest: Array
    t_after: Array
    centre_after: Array
    load_after: Array

    def since(self, t: float) -> Pressure:
        """The rows and events from ``t`` on, to leave out the beginning."""
        late, after = is_between(self.t, t), is_between(self.t_after, t)
        return replace(
            self,
            t=self.t[late], centre=self.centre[late], load=self.load[late],
            t_after=self.t_after[after], centre_after=self.centre_after[after], load_after=self.load_after[after],
        )  # fmt: skip

    @property
    def lifted(self) -> tuple[str, ...]:
        """The geoms that bear load at rest and none at some time."""
        lifts = (self._borne <= 0).any(axis=0)
        return tuple(np.array(self.geoms, dtype=object)[self.load_at_rest > 0][lifts])

    @property
    def unloading(self) -> float:
        """The largest relative unloading: 0 at rest, 1 at lift-off; at small sway proportional to the threshold."""
        share = self._borne / self.load_at_rest[self.load_at_rest > 0]
        return float((1 - share[np.isfinite(share)]).max(initial=0.0))

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes, among x and y, along which the centre moves."""
        with np.errstate(invalid="ignore"):
            far = np.abs(np.concatenate([self.centre, self.centre_after]) - self.at_rest) > _MOVES
        return tuple(name for i, name in enumerate("xy") if far[:, i].any())

    @property
    def facts(self) -> Mapping[str, float]:
        """Its main numbers: the centre at rest, its extremes along each axis of its motion [m], and the unloading."""
        found = {"unloading": self.unloading}
        whole = np.concatenate([self.centre, self.centre_after])
        for name in self.axes:
            i = "xy".index(name)
            values = whole[np.isfinite(whole[:, i]), i]
            found |= {f"{name}_at_rest": float(self.at_rest[i]), f"{name}_least": float(values.min())}
            found |= {f"{name}_most": float(values.max())}
        return found

    @property
    def words(self) -> tuple[str, ...]:
        """The same in words: the range of the centre, and the unloading."""
        facts, said = self.facts, []
        for axis in self.axes:
            least, most, rest = (1e3 * facts[f"{axis}_{which}"] for which in ("least", "most", "at_rest"))
            said.append(f"centre of pressure, {axis}: {least:.3g} to {most:.3g} mm, at rest {rest:.3g} mm")
        lifts = "lifts for a moment" if self.lifted else f"is unloaded by {facts['unloading']:.2g} of its load at most"
        return (*said, f"what stands on the ground ({', '.join(self.geoms)}) {lifts}")

    @property
    def _borne(self) -> Array:
        """Load at rows and right after events on the geoms that bear load at rest."""
        return np.concatenate([self.load, self.load_after])[:, self.load_at_rest > 0]
