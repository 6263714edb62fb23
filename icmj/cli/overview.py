"""All commands at once: what each is for, and the script by which a shell completes them."""

from __future__ import annotations

import textwrap

from icmj.base.similar_names import suggest
from icmj.cli.arguments import ALSO, Command
from icmj.cli.commands import COMMANDS
from icmj.cli.parsing import COMPLETION, STYLE, Parser, fill
from icmj.errors import IcmjError

DESCRIPTION = """Event-driven intermittent control of human standing: predict limit cycles from the linear theory,
simulate them on the linear plant and in MuJoCo, and compare."""
_SHELLS = ("bash", "zsh", "tcsh")


def write_overview() -> str:
    """The purpose of the program, and of each command in one sentence; of what is seldom needed the names."""
    lines = ["usage: icmj COMMAND [OPTIONS]", "", *textwrap.wrap(" ".join(DESCRIPTION.split()), 78)]
    commands: dict[str, type[Command]] = {name: COMMANDS[name].COMMAND for name in COMMANDS.names}
    for group in dict.fromkeys(cls.group for cls in commands.values() if cls.group != ALSO):
        lines += ["", f"{group}:"]
        for name, cls in commands.items():
            if cls.group == group:
                indent = f"  {name:<11}"
                lines += textwrap.wrap(_find_purpose(cls), 78, initial_indent=indent, subsequent_indent=" " * 13)
    lines += ["", f"{ALSO}: {', '.join(name for name, cls in commands.items() if cls.group == ALSO)}"]
    more = (
        ("icmj COMMAND --help", "options of a command, with an example"),
        ("icmj --version", "version"),
        (f"icmj {COMPLETION} bash", "completion for the shell: bash, zsh or tcsh"),
    )
    lines += ["", *(f"{words:<36}{purpose}" for words, purpose in more)]
    return "\n".join([*lines, "", "Example: icmj study"])


def write_completion(shell: str) -> str:
    """The script by which a shell completes the commands of icmj and their options.

    Raises:
        IcmjError: if ``shell`` is not one of those.
    """
    import shtab

    if shell not in _SHELLS:
        raise IcmjError(f"{COMPLETION}: expected {' or '.join(_SHELLS)}, got {shell!r}{suggest(shell, _SHELLS)}")
    parser = Parser("icmj", **STYLE)
    commands = parser.add_subparsers()
    for name in COMMANDS.names:
        cls = COMMANDS[name].COMMAND
        fill(commands.add_parser(name, help=_find_purpose(cls), **STYLE), cls.complete(), True, shtab.FILE)
    return str(shtab.complete(parser, shell))


def _find_purpose(cls: type[Command]) -> str:
    return " ".join((cls.__doc__ or "").partition("\n\n")[0].split())
