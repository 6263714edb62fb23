"""``icmj linearise``: the linear plant of a model, whole where it is small, in outline where it is large."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from icmj.cli.arguments import POSITIONAL, Command, Given
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import ModelError, explain_refusal

if TYPE_CHECKING:
    from icmj.base.array import Array
    from icmj.cli.terminal import Terminal
    from icmj.engine.linearisation import Linearisation
    from icmj.plant.linear_plant import LinearPlant
    from icmj.plant.quality import Notice, Quality


MODES = ("neutral", "uncontrollable", "unobservable")
FEW = 8  # states whose matrices are shown without being asked for
POLES = tuple(map(Column, ("pole (rad/s)", "damping", "time constant (s)", "frequency (Hz)")))
GAP = 3  # columns of the terminal between two of a table


@dataclass(frozen=True)
class LineariseCommand(Command):
    """Linearise an MJCF model by centred finite differences; print the matrices A, B, C and the poles.

    Example: icmj linearise three_link --keyframe upright
    """

    group = "Begin"

    model: Annotated[Path, POSITIONAL]
    """MJCF file, or name of a shipped model."""
    keyframe: str | None = None
    """Keyframe of the operating point (default: the reference configuration)."""
    operating_point: Literal["as given", "static control", "balance"] | None = None
    """How the operating point is completed: as given, controls only, or controls and pose (default: as given for a
    keyframe; without one, as given if the model is at rest there, else balance).
    """
    free: tuple[str, ...] = ()
    """Joints that may move to complete the pose with --operating-point balance (default: all)."""
    outputs: tuple[str, ...] = ()
    """Sensors or joints to take as outputs; the word joints means all joints (default: all sensors)."""
    json: bool = False
    """Print JSON instead of tables."""
    full: bool = False
    """Print the matrices even if they are large."""
    out: Annotated[Path | None, Given(writes=(".npz",))] = None
    """File (.npz) for A, B, C, poles, names and units."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Linearise an MJCF model and print it."""
        from icmj.base.files import expect_replaceable
        from icmj.engine.plant import load_plant
        from icmj.plant.body import OperatingRule, Selection
        from icmj.work.shipped import model_file

        if self.out is not None:
            expect_replaceable(self.out)
        chosen = "joints" if self.outputs == ("joints",) else self.outputs or None
        kind = self.operating_point or ("as given" if self.keyframe else "found")
        with Working(f"linearising {self.model.name}", err):
            loaded = load_plant(
                model_file(self.model),
                keyframe=self.keyframe,
                selection=Selection(outputs=chosen),
                operating=OperatingRule(kind, self.free),
            )
        linearisation = loaded.linearisation
        plant = linearisation.plant
        if self.out is not None:
            save_plant(plant, self.out)
        if self.json:
            out.show(plain_linearisation(linearisation, loaded.quality, loaded.told), indent=None)
            return
        show_plant(plant, out, full=self.full)
        for notice in (*loaded.told, *loaded.quality.notices):
            out.note(notice)
        if self.out is not None:
            out.say(f"matrices  {self.out}")


def plain_linearisation(linearisation: Linearisation, quality: Quality, told: Iterable[Notice]) -> dict[str, Any]:
    """What ``icmj linearise --json`` prints; ``told`` is what was chosen where nothing was named."""
    from icmj.base.numbers import pick, plain

    plant = linearisation.plant
    return plain(
        {
            **pick(plant, "A", "B", "C", "B_d", "poles", "states", "inputs", "outputs"),
            "units": {"states": plant.state_units, "inputs": plant.input_units, "outputs": plant.output_units},
            "residual": linearisation.residual,
            "quality": {
                "residual": quality.residual,
                "errors": dict(zip("ABC", quality.errors, strict=True)),
                **pick(quality, "kinks", "margins", "room", "feedthrough", "excesses", "dead", *MODES),
            },
            "notices": (*told, *quality.notices),
        }
    )


def show_plant(plant: LinearPlant, out: Terminal, *, full: bool = False) -> None:
    """Matrices and poles; of a plant with more than :data:`FEW` states an outline, unless ``full``."""
    if full or plant.n <= FEW:
        for name, matrix, rows, columns in _matrices(plant):
            _show_matrix(name, matrix, rows, columns, out)
    else:
        _show_outline(plant, out)
    _show_poles(plant, out)
    if not full and plant.n > FEW:
        out.say("--full prints the matrices, --out FILE.npz saves them.", style="dim")


def save_plant(plant: LinearPlant, path: Path) -> None:
    """A, B, C, B_d, poles, names and units as arrays for ``numpy.load``.

    Raises:
        ModelError: if the file cannot be written, or is not called ``.npz``.
    """
    from io import BytesIO

    import numpy as np

    from icmj.base.files import write_bytes
    from icmj.base.numbers import pick

    if path.suffix != ".npz":
        raise ModelError(f"{path}: the matrices are saved as .npz; call it {path.with_suffix('.npz').name}")
    words = pick(plant, "states", "inputs", "outputs", "state_units", "input_units", "output_units")
    stream = BytesIO()
    np.savez_compressed(
        stream, allow_pickle=False, **pick(plant, "A", "B", "C", "B_d", "poles"),
        **{name: np.array(each, dtype=str) for name, each in words.items()},
    )  # fmt: skip
    with explain_refusal(ModelError, f"{path}: cannot be written"):
        write_bytes(path, stream.getvalue())


def _matrices(plant: LinearPlant) -> tuple[tuple[str, Array, tuple[str, ...], tuple[str, ...]], ...]:
    states = _with_units(plant.states, plant.state_units)
    return (
        ("A", plant.A, states, plant.states),
        ("B", plant.B, states, _with_units(plant.inputs, plant.input_units)),
        ("C", plant.C, _with_units(plant.outputs, plant.output_units), plant.states),
    )


def _with_units(names: tuple[str, ...], units: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(names, units, strict=True))


def _show_matrix(name: str, matrix: Array, rows: tuple[str, ...], columns: tuple[str, ...], out: Terminal) -> None:
    """In blocks of as many columns as fit beside the names of the rows."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    cells = [["·" if value == 0 else f"{value:.5g}" for value in column] for column in matrix.T]
    widths = [max(map(len, (head, *column))) + GAP for head, column in zip(columns, cells, strict=True)]
    room = out.width - max((len(row) for row in rows), default=0) - GAP
    blocks: list[list[int]] = [[]]
    for i, width in enumerate(widths):
        if blocks[-1] and sum(widths[j] for j in blocks[-1]) + width > room:
            blocks.append([])
        blocks[-1].append(i)
    for block in blocks:
        table = Table(name, *(columns[i] for i in block), box=SIMPLE_HEAD)
        for k, label in enumerate(rows):
            table.add_row(label, *(cells[i][k] for i in block))
        out.print(table)


def _show_outline(plant: LinearPlant, out: Terminal) -> None:
    """Names with units, and what drives and what shows each state."""
    out.say(f"{plant.n} states, {plant.n_u} inputs, {plant.n_y} outputs")
    units = plant.state_units or ("",) * plant.n
    rows = [
        (state, unit, *(_largest(row, names) for row, names in (
            (plant.A[i], plant.states), (plant.B[i], plant.inputs), (plant.C[:, i], plant.outputs),
        )))
        for i, (state, unit) in enumerate(zip(plant.states, units, strict=True))
    ]  # fmt: skip
    heads = Column("state"), Column("unit", rank=3), Column("largest in A", rank=2), Column("driven most by", rank=1)
    show_table((*heads, Column("shown most by", rank=1)), rows, out)


def _largest(values: Array, names: tuple[str, ...]) -> str:
    import numpy as np

    if not len(values) or not np.abs(values).max():
        return "·"
    at = int(np.abs(values).argmax())
    return f"{names[at]} {values[at]:.4g}"


def _show_poles(plant: LinearPlant, out: Terminal) -> None:
    """Poles from the most unstable on, each pair once, with what they mean in time."""
    import numpy as np

    from icmj.base.numbers import pairs

    rows = []
    for pole in sorted((p for p in plant.poles if p.imag >= 0), key=lambda p: (-p.real, p.imag)):
        size = abs(pole)
        oscillates = pole.imag > 1e-9 * max(1.0, size)
        rows.append(
            (
                pairs([pole if oscillates else pole.real]),
                f"{-pole.real / size:.3g}" if oscillates else "–",
                f"{-1 / pole.real:.4g}" if abs(pole.real) > 1e-9 else "–",
                f"{pole.imag / (2 * np.pi):.4g}" if oscillates else "–",
            )
        )
    show_table(POLES, rows, out)


COMMAND = LineariseCommand
