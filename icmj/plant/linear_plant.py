"""The linear plant ẋ = A x + B u, y = C x (paper, eq. sys) with names for its states, inputs and outputs.

A force may act on the plant itself, not through the actuator. It acts along an
input, on a body, or on all bodies, as their support surface moves: seen from a surface that moves, gravity turns, and
every mass has the force of its inertia.

Inputs and outputs of two plants are matched by name where both have names, else by their place.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from icmj.base.array import Array, argsort_descending, real
from icmj.base.text import one_line
from icmj.errors import AnalysisError, SimulationError

if TYPE_CHECKING:
    from control import NonlinearIOSystem, StateSpace

Vector = tuple[float, float, float]
ZERO: Vector = (0.0, 0.0, 0.0)
Surface = Literal["translation", "gravity", "turning"]


def vector(values: Sequence[float] | np.ndarray) -> Vector:
    """Three numbers."""
    x, y, z = (float(value) for value in values)
    return x, y, z


@dataclass(frozen=True)
class Push:
    """A generalised force of size 1.

    Attributes:
        input: the push acts on the joint or tendon that this input moves, in the direction in which its length
            increases: 1 N m about a hinge, 1 N along a slide or a spatial tendon, whatever the actuator's gear, gain
            and dynamics. Give one of ``input``, ``body`` and ``surface``.
        body: name of the body on which it acts.
        force: force on the body [N], along the axes of the world.
        torque: torque on the body [N m], about the axes of the world.
        point: point of action, fixed in the frame of the body [m]; its centre of mass if ``None``.
        surface: motion of the support surface, to first order; all coordinates are relative to the surface.
            ``translation``: an acceleration of 1 m/s² along ``axis``; ``gravity``: a tilt of 1 rad about ``axis``,
            which changes the direction of gravity; ``turning``: an angular acceleration of 1 rad/s² about the line
            along ``axis`` through ``point`` (the origin of the world if ``None``).
        axis: direction of a translation, or axis of a rotation by the right-hand rule; of length 1.

    Raises:
        SimulationError: on construction, if not exactly one of input, body and surface is given, a vector does not have
            three finite numbers, or neither force nor torque is given for a body.
    """

    input: str | None = None
    body: str | None = None
    force: Vector = ZERO
    torque: Vector = ZERO
    point: Vector | None = None
    surface: Surface | None = None
    axis: Vector = ZERO

    def __post_init__(self) -> None:
        if (self.input, self.body, self.surface).count(None) != 2:
            raise SimulationError("a push acts on an input, on a body or by the surface; give one of them")
        for name in ("force", "torque", "point", "axis"):
            given: Sequence[float] | None = getattr(self, name)
            if given is None:
                continue
            vector = tuple(float(part) for part in given)
            if len(vector) != 3 or not np.isfinite(vector).all():
                raise SimulationError(
                    f"push on {self.where!r}: {name} must be three finite numbers, not {list(vector)}"
                )
            object.__setattr__(self, name, vector)
        acts = any(self.force) or any(self.torque)
        if self.surface is not None:
            if self.surface not in get_args(Surface) or acts:
                raise SimulationError(
                    f"surface {self.surface!r}: expected translation, gravity or turning, without force"
                )
            length = float(np.linalg.norm(self.axis))
            if length == 0:
                raise SimulationError(f"surface {self.surface!r}: its axis has no direction")
            object.__setattr__(self, "axis", tuple(part / length for part in self.axis))
            return
        if self.input is not None and (acts or self.point is not None):
            raise SimulationError(
                f"push on input {self.input!r}: force, torque and point are those of a push on a body"
            )
        if self.body is not None and not acts:
            raise SimulationError(f"push on body {self.body!r}: give it a force [N], a torque [N m], or both")

    @property
    def where(self) -> str:
        """The name of what is pushed."""
        if self.surface is not None:
            return f"surface {'tilt' if self.surface == 'gravity' else self.surface}"
        return self.input if self.input is not None else str(self.body)

    @property
    def magnitude(self) -> float:
        """Magnitude of the force [N] or, without a force, of the torque [N m]; 1 if both are given, or an input."""
        sizes = [float(np.linalg.norm(vector)) for vector in (self.force, self.torque) if any(vector)]
        return sizes[0] if len(sizes) == 1 else 1.0

    def unit(self, input_unit: str = "") -> str:
        """Unit of a size times the magnitude, if known; ``input_unit`` is that of the input's command."""
        if self.surface is not None:
            return {"translation": "m/s²", "gravity": "rad", "turning": "rad/s²"}[self.surface]
        if self.body is not None:
            return "" if any(self.force) and any(self.torque) else "N" if any(self.force) else "N m"
        return next((unit for unit in ("N m", "N") if f" {input_unit}".endswith(f" {unit}")), "")


_AT_REST = 1e-6  # of the plant's fastest rate: what a root finder leaves


@dataclass(frozen=True, eq=False)
class LinearPlant:
    """A linear time-invariant plant.

    Attributes:
        A: state matrix, shape (n, n).
        B: input matrix, shape (n, n_u).
        C: output matrix, shape (n_y, n).
        states, inputs, outputs: names, lengths n, n_u and n_y.
        state_units, input_units, output_units: their units, such as rad or N m; "" if unknown.
        B_d: effect of a push of size 1 along each input on the plant itself, shape (n, n_u), independent of the input
            gain; B if it is empty.
        pushes: effects of other pushes of size 1, shape (n,) each.
        error: what of an entry of A may be an error of differences [1/s]; 0 where each entry is as it is stated.

    B may be given as a vector if there is a single input, and C if there is a single output.

    Raises:
        AnalysisError: on construction, if shapes disagree, an entry is complex or not finite, or a name occurs twice.
    """

    A: Array
    B: Array
    C: Array
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    state_units: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    B_d: Array = field(default_factory=lambda: np.zeros((0, 0)), kw_only=True)
    pushes: Mapping[Push, Array] = field(default_factory=dict, kw_only=True)
    error: float = field(default=0.0, kw_only=True)

    def __post_init__(self) -> None:
        A, B, C = (real(M, letter, AnalysisError) for letter, M in zip("ABC", (self.A, self.B, self.C), strict=True))
        A, C = np.atleast_2d(A), np.atleast_2d(C)
        n = A.shape[0]
        B = B[:, None] if B.ndim == 1 and len(B) == n else np.atleast_2d(B)
        if A.shape != (n, n) or B.shape[0] != n or C.shape[1] != n:
            raise AnalysisError(
                f"plant matrices do not fit: A {A.shape}, B {B.shape}, C {C.shape}; expected (n, n), (n, n_u), (n_y, n)"
            )
        B_d = real(self.B_d, "B_d", AnalysisError)
        B_d = B_d if B_d.size else B.copy()
        B_d = B_d[:, None] if B_d.ndim == 1 and len(B_d) == n else np.atleast_2d(B_d)
        if B_d.shape != B.shape:
            raise AnalysisError(f"plant matrices do not fit: B_d {B_d.shape}; expected the shape of B, {B.shape}")
        if not all(np.isfinite(M).all() for M in (A, B, C, B_d)):
            raise AnalysisError("plant matrices hold a NaN or an infinity; check the model's operating point")
        for name, M in (("A", A), ("B", B), ("C", C), ("B_d", B_d)):
            M.flags.writeable = False
            object.__setattr__(self, name, M)
        for kind, size, letter in (
            ("states", n, "x"),
            ("inputs", B.shape[1], "u"),
            ("outputs", C.shape[0], "y"),
        ):
            names = tuple(getattr(self, kind)) or tuple(f"{letter}{i}" for i in range(size))
            if len(names) != size:
                raise AnalysisError(f"plant has {size} {kind} but {len(names)} names: {', '.join(names)}")
            twice = [name for name in names if names.count(name) > 1]
            if twice:
                raise AnalysisError(f"{kind}: {twice[0]!r} is named twice")
            object.__setattr__(self, kind, names)
            of = f"{kind.removesuffix('s')}_units"
            units = tuple(getattr(self, of)) or ("",) * size
            if len(units) != size:
                raise AnalysisError(f"plant has {size} {kind} but {len(units)} units of them: {', '.join(units)}")
            object.__setattr__(self, of, units)

    @property
    def n(self) -> int:
        """Number of states."""
        return self.A.shape[0]

    @property
    def n_u(self) -> int:
        """Number of inputs."""
        return self.B.shape[1]

    @property
    def n_y(self) -> int:
        """Number of outputs."""
        return self.C.shape[0]

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Eigenvalues of A [rad/s], by decreasing real part."""
        eigenvalues = np.linalg.eigvals(self.A).astype(complex)
        return eigenvalues[argsort_descending(eigenvalues.real, -eigenvalues.imag)]

    def response(self, s: complex) -> NDArray[np.complex128]:
        """C (s I − A)⁻¹ B, shape (n_y, n_u), at an s [1/s] that is no eigenvalue of A."""
        return np.asarray(self.C @ np.linalg.solve(s * np.eye(self.n) - self.A, self.B.astype(complex)))

    def effect(self, push: Push) -> Array:
        """The contribution of a push of size 1 to ẋ, shape (n,).

        Raises:
            SimulationError: if the plant has no such input or body.
        """
        if push.input is not None:
            if push.input not in self.inputs:
                raise SimulationError(f"push on input {push.input!r}: the plant's inputs are {', '.join(self.inputs)}")
            return np.asarray(self.B_d[:, self.inputs.index(push.input)])
        if push not in self.pushes:
            raise SimulationError(
                f"push on {push.where!r}: a linear plant knows no bodies; push an input, or take the linear plant "
                "of a model for these pushes, plant.pushed(settings.pushes)"
            )
        return self.pushes[push]

    def scaled(self, gain: ArrayLike) -> LinearPlant:
        """The same plant with its inputs multiplied by ``gain`` (scalar or one for each input) and unchanged pushes."""
        return replace(self, B=self.B * np.asarray(gain, float))

    def statespace(self) -> StateSpace:
        """The plant as a ``StateSpace`` of python-control with the same names."""
        import control

        return control.ss(self.A, self.B, self.C, 0, states=self.states, inputs=self.inputs, outputs=self.outputs)

    @classmethod
    def from_statespace(cls, system: StateSpace) -> LinearPlant:
        """The plant that a ``StateSpace`` of python-control describes, in continuous time without feed-through.

        Raises:
            AnalysisError: if the system is discrete or D is not zero.
        """
        if system.isdtime(strict=True):
            raise AnalysisError("the plant is a discrete-time system; intermittent control needs a continuous one")
        if np.any(system.D):
            raise AnalysisError("the plant has a direct feed-through D; move it into the states first")
        return cls(
            system.A,
            system.B,
            system.C,
            tuple(system.state_labels),
            tuple(system.input_labels),
            tuple(system.output_labels),
        )

    @classmethod
    def from_system(
        cls,
        system: Any,
        *,
        x0: ArrayLike | None = None,
        u0: ArrayLike | None = None,
        params: Mapping[str, Any] | None = None,
    ) -> LinearPlant:
        """The plant that a system of python-control or scipy.signal, or a set of matrices, describes.

        Args:
            system: a linear plant, which is returned unchanged; a ``StateSpace``; a ``TransferFunction`` (with several
                inputs and outputs only if slycot is installed); a ``NonlinearIOSystem``, linearised by centred
                differences; a system of scipy.signal in any form; any other object with matrices A, B, C and D; or a
                sequence of A, B, C and, if it is zero, D.
            x0, u0: equilibrium of a nonlinear system, shapes (n,) and (n_u,); zero if ``None``. States, inputs and
                outputs of the plant are deviations from it.
            params: parameters of a nonlinear system.

        Raises:
            AnalysisError: if the type is not supported, if the system is discrete, complex or a descriptor system, has
                a direct feed-through, or is not at rest at this point.
        """
        import control

        if isinstance(system, cls):
            return system
        if isinstance(system, tuple | list):
            if not 3 <= len(system) <= 4:
                raise AnalysisError(f"a plant of {len(system)} matrices; expected A, B, C, or A, B, C, D")
            refuse_unusual(D=system[3] if len(system) == 4 else None)
            return cls(*system[:3])
        if isinstance(system, control.TransferFunction):
            try:
                system = control.ss(system)
            except control.exception.ControlMIMONotImplemented:
                raise AnalysisError(
                    "a transfer function of several inputs or outputs has many state-space forms; give one as a "
                    "StateSpace, or install slycot"
                ) from None
            except ValueError as error:
                raise AnalysisError(f"the transfer function has no states: {one_line(error, 200)}") from error
        elif isinstance(system, control.NonlinearIOSystem) and not isinstance(system, control.StateSpace):
            system = _linearise(system, x0, u0, params)
        elif not isinstance(system, control.StateSpace):
            if hasattr(system, "to_zpk"):  # of scipy.signal
                try:
                    system = system.to_ss()
                except (ValueError, TypeError) as error:
                    raise AnalysisError(f"the {type(system).__name__} has no states: {one_line(error, 200)}") from error
            if not all(hasattr(system, letter) for letter in "ABCD"):
                raise AnalysisError(f"no plant can be made from a {type(system).__name__}; see LinearPlant.from_system")
            for letter in "ABCD":
                real(getattr(system, letter), letter, AnalysisError)
            refuse_unusual(E=getattr(system, "E", None))
            system = control.ss(system.A, system.B, system.C, system.D, getattr(system, "dt", None) or 0)
        return cls.from_statespace(system)


def _linearise(
    system: NonlinearIOSystem, x0: ArrayLike | None, u0: ArrayLike | None, params: Mapping[str, Any] | None
) -> StateSpace:
    """A nonlinear system linearised about its equilibrium, with its names."""
    import control

    if system.isdtime(strict=True):
        raise AnalysisError("the plant is a discrete-time system; intermittent control needs a continuous one")
    x, u = (
        np.zeros(size) if given is None else np.atleast_1d(np.array(given, dtype=float))
        for given, size in ((x0, system.nstates), (u0, system.ninputs))
    )
    if x.shape != (system.nstates,) or u.shape != (system.ninputs,):
        raise AnalysisError(
            f"the system has {system.nstates} states and {system.ninputs} inputs; x0 has shape {x.shape}, u0 {u.shape}"
        )
    # python-control takes a difference to one side; two of them, to either side, make a centred one
    size = 1e-5 * max(1.0, float(np.abs(np.concatenate([x, u])).max()))
    up, down = (system.linearize(x, u, params=dict(params or {}), eps=eps) for eps in (size, -size))
    A, B, C, D = ((getattr(up, letter) + getattr(down, letter)) / 2 for letter in "ABCD")
    moving = np.abs(system.dynamics(0.0, x, u, params=dict(params or {})))
    if not moving.max(initial=0.0) <= _AT_REST * max(1.0, float(np.abs(A).max(initial=0.0))):
        name = system.state_labels[int(np.argmax(moving))]
        raise AnalysisError(
            f"the system does not rest at x0, u0: {name} changes by {moving.max():.3g} a second; "
            "control.find_operating_point finds where it does"
        )
    D[np.abs(D) <= 1e-9 * np.abs(C).max(initial=0.0)] = 0.0  # of differences
    return control.ss(A, B, C, D, states=system.state_labels, inputs=system.input_labels, outputs=system.output_labels)


def refuse_unusual(D: object = None, E: object = None, dt: object = None) -> None:
    """Check that further matrices beside A, B and C (such as D) do not change the plant; ``None`` is a missing one.

    Raises:
        AnalysisError: for a feed-through D that is not zero, a descriptor matrix E that is not the identity, or a
            sampling interval dt that is not zero.
    """
    if D is not None and real(D, "D", AnalysisError).any():  # type: ignore[arg-type]
        raise AnalysisError("the plant has a direct feed-through D; move it into the states first")
    if E is not None:
        matrix = np.atleast_2d(real(E, "E", AnalysisError))  # type: ignore[arg-type]
        if matrix.shape[0] != matrix.shape[1] or not np.array_equal(matrix, np.eye(len(matrix))):
            raise AnalysisError("E ẋ = A x + B u is a descriptor system; solve it for ẋ first, A := E⁻¹A and B := E⁻¹B")
    if dt is not None and np.any(np.asarray(dt) != 0):
        raise AnalysisError(
            f"the plant is a discrete-time system, dt = {dt}; intermittent control needs a continuous one"
        )


def expect_linear(plant: object, what: str) -> None:
    """Check that ``plant`` is a linear plant.

    Raises:
        AnalysisError: if it is not; of a plant on the engine it says what to give instead.
    """
    if not isinstance(plant, LinearPlant):
        instead = "; give its linearisation.plant" if hasattr(plant, "linearisation") else ""
        raise AnalysisError(f"{what} is a {type(plant).__name__}; expected a LinearPlant{instead}")


def transformation(assumed: LinearPlant, actual: LinearPlant) -> Array:
    """T̂ of x̂ = T̂x, shape (n̂, n): picks from the actual states those of the same name (paper, section 3).

    States of the assumed plant that the actual one does not have get a row of zeros; the closed loop does
    not depend on this choice of coordinates.
    """
    return np.array([[float(name == other) for other in actual.states] for name in assumed.states])


Match = Literal["name", "position"]
# what a plant gets that has no names, in this order: of icmj, and of python-control
_GENERATED = {"inputs": ("u{}", "u[{}]"), "outputs": ("y{}", "y[{}]")}


def match_ports(actual: LinearPlant, assumed: LinearPlant, match: Match = "name") -> LinearPlant:
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
    return pick(actual, u, y)


def ports(actual: LinearPlant, assumed: LinearPlant, match: Match = "name") -> tuple[np.ndarray, np.ndarray]:
    """Indices of the inputs and outputs of ``actual`` that correspond to those of ``assumed``, shapes (n_u,), (n_y,).

    Raises:
        AnalysisError: see :func:`match_ports`.
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


def pick(plant: LinearPlant, u: np.ndarray, y: np.ndarray) -> LinearPlant:
    """The plant with inputs ``u`` and outputs ``y``, by their indices, in that order."""

    def of(names: tuple[str, ...], at: np.ndarray) -> tuple[str, ...]:
        return tuple(names[i] for i in at)

    return replace(
        plant,
        B=plant.B[:, u], B_d=plant.B_d[:, u], inputs=of(plant.inputs, u), input_units=of(plant.input_units, u),
        C=plant.C[y], outputs=of(plant.outputs, y), output_units=of(plant.output_units, y),
    )  # fmt: skip


def deviate(assumed: LinearPlant, actual: LinearPlant, rho: float) -> LinearPlant:
    """The paper's family A = Â − ρÃ₁, same for B, C and B_d: ``assumed`` at ρ = 0, ``actual`` at ρ = 1.

    Raises:
        AnalysisError: if the two plants differ in size, or in names.
    """
    if (assumed.n, assumed.n_u, assumed.n_y) != (actual.n, actual.n_u, actual.n_y):
        raise AnalysisError("the family in ρ needs assumed and actual plant of the same size")
    actual = match_ports(actual, assumed)
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
