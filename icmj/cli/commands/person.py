"""``icmj person``: the model of a person of some height and mass."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import ALSO, POSITIONAL, Command, Given

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class PersonCommand(Command):
    """Scale the three-link model to the height and mass of a person, and write it.

    Example: icmj person three_link --height 1.65 --mass 60 --out person.xml
    """

    group = ALSO

    model: Annotated[Path, POSITIONAL]
    """MJCF file with the bodies shank, thigh and trunk, or name of a shipped model."""
    height: float = 1.80
    """Height of the person [m]."""
    mass: float = 80.0
    """Mass of the person [kg]."""
    out: Annotated[Path, Given(writes=(".xml",))] = Path("person.xml")
    """MJCF file to write."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Write a person's model and say what it is."""
        from icmj.base.files import expect_replaceable, write_text
        from icmj.engine.plant import shape_to_person
        from icmj.plant.person import Person
        from icmj.work.shipped import model_file

        expect_replaceable(self.out)
        measures = Person(self.height, self.mass)
        write_text(self.out, shape_to_person(model_file(self.model), measures))
        G = ", ".join(f"{value:.4g}" for value in measures.toppling_stiffness())
        out.say(f"toppling stiffness of ankle, knee and hip {G} N m/rad")
        out.say(f"model    {self.out}")


COMMAND = PersonCommand
