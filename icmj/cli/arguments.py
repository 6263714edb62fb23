"""A command: a class whose fields are its arguments on the command line."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields, make_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, get_args, get_origin, get_type_hints

from icmj.errors import IcmjError

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal

RESULTS = Path("runs/out")
"""The folder of results where none is given."""


@dataclass(frozen=True)
class Given:
    """How an argument is given on the command line, where its type does not say so: a note of ``Annotated``.

    Attributes:
        positional: whether it has no option.
        repeated: whether the option stands once for each value, instead of once before all of them.
        metavar: placeholder of a value in the help.
        name: of the option, where it is not that of the field.
        short: a second name of the option.
        meaning: what it is, where no docstring stands under the field.
        least: smallest number that is allowed.
        writes: what the path of something that is written may end in: of a file the usual ending first, of a folder
            none; ``None`` where nothing is written.
    """

    positional: bool = False
    repeated: bool = False
    metavar: str = ""
    name: str = ""
    short: str = ""
    meaning: str = ""
    least: int | None = None
    writes: tuple[str, ...] | None = None


POSITIONAL, FOLDER, PAGE = Given(positional=True), Given(writes=()), Given(writes=(".html",))
PROCESSES = Given(least=1)
ALSO = "Also"


@dataclass(frozen=True, kw_only=True)
class Command(ABC):
    """A command of the program, and the options of every command.

    The docstring of its class is its help, beginning with a sentence on what it is for, and ending with an example. Its
    fields are its arguments, each with its meaning beneath it.
    """

    group: ClassVar[str]
    """The heading under which ``icmj --help`` lists it; of ``ALSO``, its name alone."""

    quiet: Annotated[bool, Given(short="-q")] = False
    """Print results and errors only, without progress and notes."""
    verbose: Annotated[bool, Given(short="-v")] = False
    """Log every step to standard error, with the time."""

    @classmethod
    def complete(cls) -> type[Command]:
        """The command with the options that it takes of a list; most take none."""
        return cls

    @classmethod
    def extend(cls, options: Iterable[tuple[str, Any, Given]]) -> type[Command]:
        """The command with these options, each with its type, how it is given, and ``None`` where it is not."""
        new = [(name, Annotated[kind | None, given], None) for name, kind, given in options]
        return make_dataclass(cls.__name__, new, bases=(cls,), frozen=True, namespace={"__doc__": cls.__doc__})

    @abstractmethod
    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Do what is asked for.

        Args:
            out: where results are printed.
            err: where progress is shown, and what does not belong to the results.

        Raises:
            IcmjError: one line, if it cannot be done.
        """


def list_arguments(cls: type[Command]) -> Iterator[tuple[str, Any, Given]]:
    """Each argument of a command: its field, its type, and how it is given."""
    hints = get_type_hints(cls, include_extras=True)
    for field in fields(cls):
        hint = hints[field.name]
        yield field.name, *(get_args(hint) if get_origin(hint) is Annotated else (hint, Given()))


def name_option(field: str, given: Given) -> str:
    """The option by which an argument is given."""
    return f"--{(given.name or field).replace('_', '-')}"


def refuse_values(command: Command) -> None:
    """See that numbers are large enough, and that what is written is a file where one is meant, or else a folder.

    The name of a folder that is written may look like that of a file, and the reverse, if it is there.

    Raises:
        IcmjError: one line that says what to give instead.
    """
    for name, _, given in list_arguments(type(command)):
        value, option = getattr(command, name), name_option(name, given)
        if value is None:
            continue
        if given.least is not None and value < given.least:
            raise IcmjError(f"{option} {value}: expected at least {given.least}")
        if given.writes is not None:
            _refuse_other_kind(option, name, value, given.writes)


def _refuse_other_kind(option: str, name: str, path: Path, endings: tuple[str, ...]) -> None:
    from icmj.base.files import is_file_name

    if not endings and is_file_name(path) and not path.is_dir():
        raise IcmjError(f"{option} {path}: looks like a file, and a folder is meant; give one, such as {path.stem}")
    if endings and (path.is_dir() or not (path.suffix or path.exists())):
        at, is_folder = (path / name, "a folder is there") if path.is_dir() else (path, "looks like a folder")
        such = " or ".join(f"{at}{suffix}" for suffix in endings)
        raise IcmjError(f"{option} {path}: {is_folder}, and a file is meant; give one, such as {such}")
