"""The shelf of commands: each in a file of its own, by whose name it is called, and their list.

To add one, write a file here and enter its name below. The file defines ``COMMAND``, a class that inherits from
:class:`icmj.cli.arguments.Command`: its fields are the arguments, its ``group`` is the heading under which it is
listed, and its method ``carry_out`` does what is asked for and prints it. Help, messages about wrong words, completion
and reference follow. All are imported to list them, so that a file imports libraries within its functions alone.
"""

from icmj.base.catalogue import Catalogue

COMMANDS = Catalogue(
    __name__,
    (
        "cases",
        "new",
        "person",
        "linearise",
        "schema",
        "analyse",
        "cycle",
        "continue",
        "run",
        "study",
        "live",
        "sweep",
        "experiment",
        "report",
        "replay",
        "export",
        "measure",
        "identify",
        "fit",
    ),
)
"""The commands, in the order in which they are listed."""
