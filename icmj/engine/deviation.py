"""How the actual plant departs from a model: a set of changes that applies itself to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.inertial import frozen, lengthened
from icmj.errors import ModelError
from icmj.plant.change import Change, What

_OUTSIDE = ("input_gain", "sensor_gain", "sensor_bias")  # not in the model but at the plant's ports
_INERTIAL = ("mass", "inertia", "centre_of_mass", "length")


@dataclass(frozen=True)
class Deviation:
    """How the actual plant departs from an MJCF model; the default is no departure.

    Attributes:
        gain: b, input gain of every actuator (one number) or of each; short for changes of ``input_gain``.
        dynprm: in place of ``dynprm`` of the named actuators; short for changes of ``dynprm``.
        rho: ρ, how much of every change there is: 0 none, 1 all of it.
        changes: the others, by name.
    """

    gain: float | Sequence[float] = 1.0
    dynprm: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rho: float = 1.0
    changes: tuple[Change, ...] = ()

    def apply(self, spec: mujoco.MjSpec, name: str) -> None:
        """Change the model; what belongs to the plant's ports is left to them.

        Raises:
            ModelError: if a name is not one of the model's, or a number does not fit; it begins with ``name``.
        """
        short = [Change("dynprm", actuator, value=tuple(values)) for actuator, values in self.dynprm.items()]
        inside = [change for change in (*short, *self.changes) if change.what not in _OUTSIDE]
        if any(change.what in _INERTIAL for change in inside):
            frozen(spec)
        for change in inside:
            try:
                _apply(spec, change, self.rho)
            except (ValueError, mujoco.FatalError) as error:
                raise ModelError(f"{name}: change of {change.what}: {' '.join(str(error).split())}") from error
            except ModelError as error:
                raise ModelError(f"{name}: {error}") from error
        if inside:
            try:
                spec.compile()
            except (ValueError, mujoco.FatalError) as error:
                reason = " ".join(str(error).split())
                raise ModelError(f"{name}: the changed model does not compile: {reason}") from error

    def input_gains(self, inputs: Sequence[str], name: str) -> Array:
        """b of each actuator, shape (n_u,).

        Raises:
            ModelError: if the number of gains, or a name, does not fit.
        """
        gain = np.asarray(self.gain, dtype=float)
        if gain.ndim > 1 or (gain.ndim == 1 and gain.size != len(inputs)):
            raise ModelError(f"{name}: gain has {gain.size} entries for {len(inputs)} actuators")
        b = 1 + self.rho * (np.broadcast_to(gain, (len(inputs),)) - 1)
        return self._ports("input_gain", b, {label: (i,) for i, label in enumerate(inputs)}, "actuator", name)

    def sensor_errors(
        self, outputs: Sequence[str], sensors: Mapping[str, Sequence[int]], name: str
    ) -> tuple[Array, Array]:
        """g and β of each entry of ``sensordata``; a name is that of a sensor or of one entry of it.

        Raises:
            ModelError: if there is no sensor of a name, or a gain is zero.
        """
        places = {**{label: (i,) for i, label in enumerate(outputs)}, **sensors}
        g = self._ports("sensor_gain", np.ones(len(outputs)), places, "sensor", name)
        if not g.all():
            raise ModelError(f"{name}: a sensor gain of 0 leaves nothing to observe; leave the output out instead")
        return g, self._ports("sensor_bias", np.zeros(len(outputs)), places, "sensor", name)

    def _ports(self, what: What, values: Array, places: Mapping[str, Sequence[int]], kind: str, name: str) -> Array:
        values = values.copy()
        for change in self.changes:
            if change.what == what:
                for label in _named(change, places, kind, name):
                    at = list(places[label])
                    values[at] = [change(value, self.rho) for value in values[at]]
        return values


def _named(change: Change, known: Iterable[str], kind: str, name: str) -> list[str]:
    labels = list(known)
    if change.of is None:
        return list(dict.fromkeys(label for label in labels if "." not in label or kind != "sensor"))
    if change.of not in labels:
        raise ModelError(f"{name}: no {kind} {change.of!r} to change; it has {', '.join(filter(None, labels))}")
    return [change.of]


def _apply(spec: mujoco.MjSpec, change: Change, rho: float) -> None:
    if change.what == "gravity":
        spec.option.gravity = change(spec.option.gravity, rho)
        return
    if change.what in _INERTIAL:
        known = {body.name: body for body in spec.bodies if body.name != "world"}
        verb: Callable[..., None] = {"mass": _mass, "inertia": _inertia, "centre_of_mass": _com, "length": _length}[
            change.what
        ]
        for body in _chosen(change, known, "body", lambda body: body.mass > 0):
            verb(body, change, rho)
        return
    if change.what in ("stiffness", "damping", "armature"):
        things, kind = spec.joints, "joint"
    else:
        things, kind = spec.actuators, "actuator"
    for thing in _chosen(change, {thing.name: thing for thing in things}, kind, lambda thing: True):
        before = getattr(thing, change.what)
        setattr(thing, change.what, change(before, rho) if np.ndim(before) else float(change(before, rho)))


def _chosen(change: Change, known: dict, kind: str, where: Callable) -> list:
    if change.of is None:
        return [thing for thing in known.values() if where(thing)]
    if change.of not in known:
        names = ", ".join(filter(None, known))
        raise ModelError(f"no {kind} {change.of!r} to change; it has {names}")
    if not where(known[change.of]):
        raise ModelError(f"{kind} {change.of!r} has no mass of its own to change")
    return [known[change.of]]


def _mass(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    before = float(body.mass)
    body.mass = float(change(before, rho))
    body.inertia = np.asarray(body.inertia) * (body.mass / before)


def _inertia(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.inertia = change(body.inertia, rho)


def _com(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.ipos = change(body.ipos, rho)


def _length(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    lengthened(body, float(change(1.0, rho)))
