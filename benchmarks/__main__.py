"""``python -m benchmarks``: measure, print a table, and save or compare results.

    python -m benchmarks                          everything (two minutes or so)
    python -m benchmarks --only stepping          one group
    python -m benchmarks --save new.json          keep the numbers
    python -m benchmarks --compare old.json new.json

Rows of Drake and jaxonomy need these beside icmj; both install for Python 3.11 with numpy 2.4:

    pip install -e '.[bench]'

Exits with status 1 if a bound is missed.
"""

import argparse
import json
import platform
import sys
from dataclasses import asdict
from pathlib import Path

from benchmarks import analysis, cycles, linear, live, noise, precision, rivals, startup, stepping, threads
from benchmarks.row import Row
from icmj.cli.table import Column, show_table
from icmj.cli.terminal import Terminal

MEASURED = (*map(Column, ("group", "measured")), *(Column(name, "right") for name in ("value", "bound")))
MEASURED += (Column("note", rank=1),)
COMPARED = (Column("group"), Column("measured"), Column("A", "right"), Column("B", "right"), Column("B / A", "right"))


def _analysis() -> list[Row]:
    bounds = {"three-link analysis": 50.0, "24 states": 1e3, "54 states": 1e4}
    found = analysis.rows()
    return [Row("analysis", name, 1e3 * seconds, "ms", note, bounds.get(name)) for name, seconds, note in found]


MODULES = (stepping, precision, linear, noise, threads, startup, analysis, cycles, live, rivals)
GROUPS = {module.__name__.rpartition(".")[2]: module.rows for module in MODULES} | {"analysis": _analysis}


def main() -> int:
    """Run the command line; returns the exit status."""
    how = {"prog": "python -m benchmarks", "description": __doc__}
    parser = argparse.ArgumentParser(**how, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=list(GROUPS), action="append", help="measure this group only (repeatable)")
    parser.add_argument("--save", type=Path, metavar="FILE.json", help="keep the numbers")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("A.json", "B.json"), help="compare two saved results")
    arguments = parser.parse_args()
    console = Terminal()
    if arguments.compare:
        show_compared(*(load(path) for path in arguments.compare), console)
        return 0
    measured: list[Row] = []
    for name in arguments.only or GROUPS:
        with console.status(f"measuring {name} …"):
            measured += GROUPS[name]()
    show_measured(measured, console)
    if arguments.save:
        facts = {"python": platform.python_version(), "machine": platform.machine(), "cpu": platform.processor()}
        text = json.dumps({"platform": facts, "rows": [asdict(row) for row in measured]}, indent=1)
        arguments.save.write_text(text, encoding="utf-8")
    missed = [row.name for row in measured if row.met is False]
    if missed:
        console.say(f"missed: {'; '.join(missed)}", style="red")
    return 1 if missed else 0


def show_measured(measured: list[Row], out: Terminal) -> None:
    """The measured rows as a table for people."""
    rows = []
    for row in measured:
        bound = "" if row.bound is None else f"{'≤' if row.at_most else '≥'} {row.bound:g}"
        mark = {True: " ✓", False: " ✗", None: ""}[row.met]
        rows.append((row.group, row.name, shown(row), bound + mark, row.note))
    ends = [i for i, row in enumerate(measured[:-1]) if row.group != measured[i + 1].group]
    show_table(MEASURED, rows, out, title="icmj benchmarks", keys=2, sections=ends)


def shown(row: Row) -> str:
    """Value and unit, four digits."""
    return "–" if row.value is None else f"{row.value:.4g} {row.unit}".strip()


def load(path: Path) -> dict[tuple[str, str], Row]:
    """Saved rows by group and name."""
    data = json.loads(path.read_text(encoding="utf-8"))
    return {(row["group"], row["name"]): Row(**row) for row in data["rows"]}


def show_compared(old: dict[tuple[str, str], Row], new: dict[tuple[str, str], Row], out: Terminal) -> None:
    """Two saved results side by side."""
    rows = []
    for key in dict.fromkeys([*old, *new]):
        a, b = old.get(key), new.get(key)
        ratio = b.value / a.value if a and b and a.value and b.value else None
        rows.append((*key, shown(a) if a else "–", shown(b) if b else "–", "–" if ratio is None else f"{ratio:.3f}"))
    show_table(COMPARED, rows, out, title="icmj benchmarks, compared", keys=2)


if __name__ == "__main__":
    sys.exit(main())
