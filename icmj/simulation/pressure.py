"""The ground's reaction on a body that stands on a floor: centre of pressure and load of each contact, over time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from icmj.base.array import Array

_MOVES = 1e-9  # m: an axis along which the centre moves less is not shown


@dataclass(frozen=True, eq=False)
class Pressure:
    """The ground's reaction over time.

    Attributes:
        t: times of the rows [s], shape (N,).
        centre: centre of pressure (x, y) in the world [m], shape (N, 2); NaN in flight.
        at_rest: the same at the operating point, shape (2,).
        geoms: what stands on the ground.
        load: normal force on each of them [N], shape (N, G).
        load_at_rest: the same at the operating point, shape (G,).
        t_after: times of the events [s], shape (K,); empty where it is not known what follows them, as with a delay.
        centre_after, load_after: right after each event, where torque has jumped; shapes (K, 2), (K, G).
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
        """The rows and events from ``t`` on, so that a start can be left out."""
        late, after = self.t >= t, self.t_after >= t
        return replace(
            self,
            t=self.t[late], centre=self.centre[late], load=self.load[late],
            t_after=self.t_after[after], centre_after=self.centre_after[after], load_after=self.load_after[after],
        )  # fmt: skip

    @property
    def lifted(self) -> bool:
        """Whether something that bears load at rest bears none at some time."""
        return bool((self._borne <= 0).any())

    @property
    def unloading(self) -> float:
        """How far anything is unloaded: 0 at rest, 1 where it lifts off. At small sway it grows with the threshold."""
        share = self._borne / self.load_at_rest[self.load_at_rest > 0]
        return float((1 - share[np.isfinite(share)]).max(initial=0.0))

    @property
    def axes(self) -> tuple[str, ...]:
        """The axes along which the centre moves, of x and y."""
        with np.errstate(invalid="ignore"):
            far = np.abs(np.concatenate([self.centre, self.centre_after]) - self.at_rest) > _MOVES
        return tuple(name for i, name in enumerate("xy") if far[:, i].any())

    @property
    def facts(self) -> Mapping[str, float]:
        """Numbers that tell of it: the centre at rest, its ends along each axis that it moves on [m], unloading."""
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
        """The same for people: where the centre went, and what was unloaded."""
        facts, said = self.facts, []
        for axis in self.axes:
            least, most, rest = (1e3 * facts[f"{axis}_{which}"] for which in ("least", "most", "at_rest"))
            said.append(f"centre of pressure, {axis}: {least:.3g} to {most:.3g} mm, at rest {rest:.3g} mm")
        lifts = "lifts for a moment" if self.lifted else f"is unloaded by {facts['unloading']:.2g} of its load at most"
        return (*said, f"what stands on the ground ({', '.join(self.geoms)}) {lifts}")

    @property
    def _borne(self) -> Array:
        """What is borne, row by row and right after events, by what bears load at rest."""
        return np.concatenate([self.load, self.load_after])[:, self.load_at_rest > 0]
