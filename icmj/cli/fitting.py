"""What ``icmj fit`` does and shows."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from icmj.base.numbers import amount
from icmj.base.text import one_line
from icmj.cli.fit_arguments import Fit
from icmj.cli.tables import Column, show_table
from icmj.cli.terminal import ERR, OUT, Terminal
from icmj.cli.working import Working
from icmj.errors import FitError

if TYPE_CHECKING:
    from icmj.study.fit import Fit as Done
    from icmj.study.fit import Subject

_COLUMNS, _REQUIRED = ("file", "column", "person", "group", "condition"), ("file", "person")
_MOST = 10_000_000  # bytes of a table


def fit(command: Fit) -> None:
    """Fit families to recordings; whatever is finished stays, however it ends."""
    from icmj.fitting.family import DELAY, load_family
    from icmj.fitting.network import library
    from icmj.study.fit import fit as fitted
    from icmj.study.fit_page import PAGE, RESULTS, summary, write_fit

    if command.jobs is not None and command.jobs < 1:
        raise FitError(f"--jobs {command.jobs}: expected at least 1")
    for name, value, least in (
        ("simulations", command.simulations, 200), ("draws", command.draws, 100), ("hold-out", command.hold_out, 0),
        ("seed", command.seed, 0),
    ):  # fmt: skip
        if value < least:
            raise FitError(f"--{name} {value}: expected at least {least}")
    if not command.model:
        raise FitError("no family; give --model, such as --model event")
    if bool(command.recordings) == (command.table is not None):
        raise FitError("give either recordings or --table")
    people = people_of(command)
    families = [load_family(path, allow_code=command.allow_code) for path in command.model]
    if delayed := [family.name for family in families if family.has_delay]:
        ERR.note(f"{', '.join(delayed)}: {DELAY}")  # before hours of simulation
    library()
    with Working("fit", ERR) as working:
        done = fitted(
            people,
            families,
            command.out,
            trained=command.trained,
            simulations=command.simulations,
            draws=command.draws,
            seed=command.seed,
            jobs=command.jobs,
            dask=command.dask,
            progress=working.tell,
        )
        working.tell("writing", 1.0)
        write_fit(done, command.out)
    if command.json:
        OUT.show({**summary(done), "folder": str(command.out)})
        return
    _show(done, OUT)
    for what, path in (("results", RESULTS), ("page", PAGE)):
        OUT.say(f"{what:<8} {command.out / path}", wrap=False)


def people_of(command: Fit) -> list[Subject]:
    """Those whose recordings were given, or whom a table lists; the trials of a person and condition are one.

    Raises:
        FitError: one line, if a recording or the table cannot be used.
    """
    from icmj.fitting.recordings import read_trials
    from icmj.study.fit import Subject

    if command.table is None:
        rows = [{"file": str(path), "person": command.recordings[0].stem} for path in command.recordings]
        base = Path()
    else:
        rows, base = _rows(command.table), command.table.parent
    found: dict[tuple[str, ...], Subject] = {}
    for row in rows:
        columns = (row["column"],) if row.get("column") else command.columns
        key = row["person"], row.get("group", ""), row.get("condition", "")
        trials = read_trials(base / row["file"], columns, unit=command.unit, rate=command.rate)
        before = found.get(key)
        notes = tuple(f"{row['file']}, {one.name}: {note}" for one in trials for note in one.notes)
        found[key] = Subject(
            row["person"],
            (*(before.trials if before else ()), *(one.cop for one in trials)),
            command.hold_out,
            key[1],
            key[2],
            (*(before.notes if before else ()), *notes),
        )
    return list(found.values())


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table of people, or of the public data set's own table."""
    from icmj.fitting.recordings import INFO, public_trials

    if path.name == INFO:
        return [
            {
                "file": one.file.name,
                "person": one.person,
                "group": one.group,
                "condition": f"eyes {one.vision}, {one.surface}".lower(),
            }
            for one in public_trials(path.parent)
        ]
    try:
        if path.stat().st_size > _MOST:
            raise FitError(f"{path}: is too large for a table of people")
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            rows = [{k: (v or "").strip() for k, v in row.items() if k} for row in reader]
            names = [name.strip() for name in reader.fieldnames or ()]
    except OSError as error:
        raise FitError(f"{path}: cannot be read: {error.strerror}") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise FitError(f"{path}: is not a CSV table ({one_line(error, 100)})") from error
    unknown = [name for name in names if name not in _COLUMNS]
    missing = [name for name in _REQUIRED if name not in names]
    if unknown or missing:
        wrong = f"no column {missing[0]!r}" if missing else f"unknown column {unknown[0]!r}"
        raise FitError(f"{path}: {wrong}; expected {', '.join(_COLUMNS)}, of which file and person are required")
    if not rows:
        raise FitError(f"{path}: lists no people")
    for line, row in enumerate(rows, 2):
        if not row["file"] or not row["person"]:
            raise FitError(f"{path}, line {line}: lacks the file or the person")
    return rows


def _show(done: Done, out: Terminal) -> None:
    """A table of numbers for each person and family, then what else was found, in words."""
    from icmj.study.fit_page import caveats, words_of

    for one in done.people:
        for note in one.notes:
            out.say(f"note: {note}")
    for each in done.trained.values():
        out.say(each.words)
    for found in done.fitted:
        trained = done.trained[found.family]
        low, median, high = np.quantile(found.theta, (0.05, 0.5, 0.95), axis=0)
        prior, verdicts = trained.family.prior, trained.calibration.verdicts
        rows = [
            (name, prior.units[i], *(amount(of[i], figures=4) for of in (median, low, high)), verdicts[i])
            for i, name in enumerate(prior.names)
        ]
        columns = (
            Column("number"), Column("unit", rank=1), Column("median", "right"), Column("5 %", "right"),
            Column("95 %", "right"), Column("on synthetic people"),
        )  # fmt: skip
        show_table(columns, rows, out, title=f"{found.person.label}: {trained.family.title}")
        out.say(words_of(found))
    if done.confusion is not None and done.probabilities is not None:
        head = (Column("probability"), *(Column(name, "right") for name in done.trained))
        shares = [
            (one.label, *(f"{p:.2f}" for p in each)) for one, each in zip(done.people, done.probabilities, strict=True)
        ]
        show_table(head, shares, out, title="Which family")
        out.say(done.confusion.words + ".")
    for said in caveats(done):
        out.say(said)
    for name, differences in done.differences.items():
        for difference in differences:
            out.say(f"{name}: {difference.words}")
