"""Controllers that read delayed outputs, and the body of Asai et al. (2009) that they hold upright."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from icmj import Law, LinearPlant, SwitchingPD
from icmj.controller.layout import Layout
from icmj.controller.realisation import Guard, Mode, Realisation

M, H, G, DELAY = 60.0, 1.0, 9.81, 0.2
MGH, INERTIA, DAMPING = M * G * H, M * H * H, 4.0
STIFFNESS = 0.8 * MGH

BODY = LinearPlant(
    np.array([[0.0, 1.0], [(MGH - STIFFNESS) / INERTIA, -DAMPING / INERTIA]]), np.array([0.0, 1 / INERTIA]),
    np.eye(2), ("lean", "lean_rate"), ("ankle",), ("theta", "omega"),
)  # fmt: skip

CONTINUOUS = SwitchingPD(BODY, "theta", "omega", P=0.8 * MGH, D=270.0, delay=DELAY, switches=False)
HOMOGENEOUS = SwitchingPD(BODY, "theta", "omega", P=0.25 * MGH, D=10.0, delay=DELAY, slope=-0.4)
SWITCHING = replace(HOMOGENEOUS, dead_zone=0.004)


@dataclass(frozen=True, eq=False)
class Tapped(Law):
    """Any modes, by their matrices, of a controller that reads delayed outputs."""

    model: LinearPlant
    modes: tuple[Mode, ...]
    taps: tuple[float, ...]
    guards: tuple[Guard, ...] = ()
    table: np.ndarray | None = None

    @property
    def plant(self) -> LinearPlant:
        return self.model

    @property
    def kind(self) -> str:
        return "own"

    def facts(self) -> Mapping[str, Any]:
        return {}

    @cached_property
    def realisation(self) -> Realisation:
        size = len(self.modes[0].M)
        square = np.eye(size)
        return Realisation(
            Layout.of(a=size), self.modes, square, square, np.zeros((0, size)), np.zeros(1, dtype=int),
            taps=self.taps, guards=self.guards, table=self.table,
        )  # fmt: skip


def pid(plant: LinearPlant = BODY, P: float = 0.6 * MGH, I: float = 40.0, D: float = 200.0) -> Tapped:
    """Delayed PID whose integral leaks, as one of one's own would be written."""
    mode = Mode("pid", np.array([[-0.2]]), np.array([[1.0, 0.0]]), np.array([[I]]), np.array([[P, D]]))
    return Tapped(plant, (mode,), (DELAY,))


def two_taps() -> Tapped:
    """Position by a slow nerve, rate by a fast one."""
    none = np.zeros((0, 0)), np.zeros((0, 4)), np.zeros((1, 0))
    return Tapped(BODY, (Mode("both", *none, np.array([[0.0, 150.0, 0.5 * MGH, 0.0]])),), (0.09, 0.21))


PERSON = f"""<mujoco model="person">
  <compiler angle="radian" inertiafromgeom="false"/>
  <option gravity="0 0 -{G}" timestep="0.002" integrator="RK4"><flag constraint="disable" contact="disable"/></option>
  <worldbody><body name="body">
    <joint name="lean" axis="0 1 0" stiffness="{STIFFNESS}" damping="{DAMPING}"/>
    <inertial pos="0 0 {H}" mass="{M}" diaginertia="1e-6 1e-6 1e-6"/>
  </body></worldbody>
  <actuator><motor name="ankle" joint="lean"/></actuator>
  <sensor><jointpos name="theta" joint="lean"/><jointvel name="omega" joint="lean"/></sensor>
</mujoco>"""


@cache
def person(turned: bool = False, gain: float = 1.0):
    """The body on the engine, with its input scaled by ``gain``; its sensors the other way round where asked for."""
    from icmj.engine.deviation import Deviation
    from icmj.engine.plant import load_plant

    text = PERSON
    if turned:
        first, second = '<jointpos name="theta" joint="lean"/>', '<jointvel name="omega" joint="lean"/>'
        text = text.replace(first + second, second + first)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "person.xml"
        path.write_text(text, encoding="utf-8")
        return load_plant(path, Deviation(gain=gain))
