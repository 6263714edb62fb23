"""The deviation of the actual plant from a model: a set of changes, applied before it is compiled."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import mujoco
import numpy as np

from icmj.base.array import Array
from icmj.engine.model_edits import lengthen, write_derived, write_inertia
from icmj.errors import ModelError, prefix_errors
from icmj.plant.body import Change, What

_OUTSIDE = ("input_gain", "sensor_gain", "sensor_bias")  # not in the model but at the plant's ports
_INERTIAL = ("mass", "inertia", "centre_of_mass", "length")
_PASSIVE = ("stiffness", "damping", "armature")

Edit = Callable[[mujoco.MjSpec, float], object]
"""A change of a model in code: of its spec, by ρ: 0 none of it, 1 all."""


@dataclass(frozen=True)
class Deviation:
    """The deviation of the actual plant from an MJCF model; by default there is none.

    Attributes:
        gain: b, the input gain of all inputs (one number), or of each input in the order of their selection; an
            abbreviation for changes of ``input_gain``.
        dynprm: replacements for ``dynprm`` of the named actuators; an abbreviation for changes of ``dynprm``.
        rho: ρ, the scale of every change: 0 for none, 1 for the whole change.
        changes: other changes, by name.
        edit: any other change of the model: a function of its spec and ρ, which is called last.
    """

    gain: float | Sequence[float] = 1.0
    dynprm: Mapping[str, Sequence[float]] = field(default_factory=dict)
    rho: float = 1.0
    changes: tuple[Change, ...] = ()
    edit: Edit | None = None

    def apply(self, spec: mujoco.MjSpec, model: mujoco.MjModel) -> mujoco.MjModel:
        """Apply the changes to the spec, except those of inputs and sensors, which are applied there.

        ``model`` is what the spec compiles to; returns what it then compiles to.

        Raises:
            ModelError: if the model has no element of a given name, or a number does not fit.
        """
        short = [Change("dynprm", actuator, value=tuple(values)) for actuator, values in self.dynprm.items()]
        inside = [change for change in (*short, *self.changes) if change.what not in _OUTSIDE]
        if inside or self.edit is not None:
            write_derived(spec, model)
        if self.edit is not None or any(change.what in _INERTIAL for change in inside):
            write_inertia(spec, model)
        for change in inside:
            try:
                _apply(spec, change, self.rho)
            except (ValueError, mujoco.FatalError) as error:
                raise ModelError(f"change of {change.what}: {' '.join(str(error).split())}") from error
        if self.edit is not None:
            try:
                self.edit(spec, self.rho)
            except (Exception, SystemExit) as error:  # whatever the user's code raises
                raise ModelError(f"edit: {type(error).__name__}: {' '.join(str(error).split())}") from error
        if not inside and self.edit is None:
            return model
        try:
            return spec.compile()
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"the changed model does not compile: {' '.join(str(error).split())}") from error

    def input_gains(self, inputs: Sequence[str], chosen: Sequence[int], name: str) -> Array:
        """Input gain b of each actuator that is ``chosen`` from ``inputs``, in this order, shape (n_u,).

        Raises:
            ModelError: if the number of gains, or a name, does not fit.
        """
        gain = np.asarray(self.gain, dtype=float)
        if gain.ndim > 1 or (gain.ndim == 1 and gain.size != len(chosen)):
            raise ModelError(
                f"{name}: gain has {gain.size} entries for {len(chosen)} inputs, {', '.join(inputs[i] for i in chosen)}"
            )
        b = np.ones(len(inputs))
        b[list(chosen)] = 1 + self.rho * (gain - 1)
        places = {label: (i,) for i, label in enumerate(inputs)}
        return self._ports("input_gain", b, places, "actuator", name)[list(chosen)]

    def sensor_errors(
        self, outputs: Sequence[str], sensors: Mapping[str, Sequence[int]], name: str
    ) -> tuple[Array, Array]:
        """Gain g and bias β of each entry of ``sensordata``; changes name a sensor or one entry of it.

        Raises:
            ModelError: if there is no sensor of a given name, or a gain is zero.
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
                if change.of is not None and change.of not in places:
                    known = ", ".join(filter(None, places))
                    raise ModelError(f"{name}: no {kind} {change.of!r} to change; it has {known}")
                at = list(range(len(values)) if change.of is None else places[change.of])
                if isinstance(change.value, Sequence):  # a list is for the entries of one sensor
                    with prefix_errors(name):
                        values[at] = change(values[at], self.rho)
                else:
                    values[at] = [change(value, self.rho) for value in values[at]]
        return values


def _apply(spec: mujoco.MjSpec, change: Change, rho: float) -> None:
    if change.what == "gravity":
        spec.option.gravity = change(spec.option.gravity, rho)
        return
    if change.what in _INERTIAL:
        known = [(body.name, body) for body in spec.bodies if body.name != "world"]
        verb: Callable[..., None] = {"mass": _mass, "inertia": _inertia, "centre_of_mass": _com, "length": _length}[
            change.what
        ]
        for body in _choose(change, known, "body", lambda body: body.mass > 0):
            verb(body, change, rho)
        return
    if change.what in _PASSIVE:
        kind = "joint, tendon or actuator" if change.what != "stiffness" else "joint or tendon"
        things = [*spec.joints, *spec.tendons, *(spec.actuators if change.what != "stiffness" else ())]
        if change.of is None and change.factor is None:  # a number with a unit fits one kind
            things = list(spec.joints)
    else:
        things, kind = list(spec.actuators), "actuator"
    for thing in _choose(change, [(thing.name, thing) for thing in things], kind, lambda thing: True):
        before = getattr(thing, change.what)
        setattr(thing, change.what, change(before, rho) if np.ndim(before) else float(change(before, rho)))


def _choose(change: Change, known: list, kind: str, where: Callable) -> list:
    """The selected entries; of several with the same name, the first."""
    if change.of is None:
        return [thing for _, thing in known if where(thing)]
    found = [thing for name, thing in known if name == change.of]
    if not found:
        names = ", ".join(filter(None, dict(known)))
        raise ModelError(f"no {kind} {change.of!r} to change; it has {names}")
    if not where(found[0]):
        raise ModelError(f"{kind} {change.of!r} has no mass of its own to change")
    return found[:1]


def _mass(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    before = float(body.mass)
    body.mass = float(change(before, rho))
    body.inertia = np.asarray(body.inertia) * (body.mass / before)


def _inertia(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.inertia = change(body.inertia, rho)


def _com(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    body.ipos = change(body.ipos, rho)


def _length(body: mujoco.MjsBody, change: Change, rho: float) -> None:
    lengthen(body, float(change(1.0, rho)))
