"""What ``icmj fit`` does and shows."""

from __future__ import annotations

import os
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
    from collections.abc import Callable

    from icmj.study.fit import Fit as Done
    from icmj.study.fit import Subject

_COLUMNS, _REQUIRED = ("file", "column", "person", "group", "condition"), ("file", "person")


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
    with Working("reading recordings", ERR) as working:
        people = people_of(command, working.tell)
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


def people_of(command: Fit, progress: Callable[[str, float], None] = lambda what, done: None) -> list[Subject]:
    """Those whose recordings were given, or whom a table lists; the trials of a person and condition are one.

    Raises:
        FitError: one line, if a recording or the table cannot be used, or a recording is listed twice for one person.
    """
    from icmj.fitting.recordings import MOST, TrialOf, read_trials
    from icmj.study.fit import Subject

    if command.table is None:
        rows = [{"file": str(path), "person": command.recordings[0].stem} for path in command.recordings]
        base = Path()
    else:
        rows, base = _rows(command.table), command.table.parent
    listed: set[tuple[str, ...]] = set()
    found: dict[tuple[str, ...], list[tuple[str, TrialOf]]] = {}
    count = 0
    for i, row in enumerate(rows):
        columns = (row["column"],) if row.get("column") else command.columns
        key = row["person"], row.get("group", ""), row.get("condition", "")
        recording = *key, os.path.abspath(base / row["file"]), *columns
        if recording in listed:
            raise FitError(f"{command.table or row['file']}: {row['file']} is given twice for {row['person']}")
        listed.add(recording)
        trials = read_trials(base / row["file"], columns, unit=command.unit, rate=command.rate)
        count += len(trials)
        if count > MOST:
            raise FitError(f"{base / row['file']}: the recordings hold more than {MOST} trials; fit them in parts")
        found.setdefault(key, []).extend((row["file"], one) for one in trials)
        progress("reading recordings", (i + 1) / len(rows))
    return [
        Subject(
            person,
            tuple(one.cop for _, one in trials),
            command.hold_out,
            group,
            condition,
            tuple(f"{file}, {one.name}: {note}" for file, one in trials for note in one.notes),
        )
        for (person, group, condition), trials in found.items()
    ]


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table of people, or of the public data set's own table."""
    from icmj.fitting.recordings import INFO, public_trials, read_table

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
    names, rows = read_table(path, _COLUMNS, required=_REQUIRED)
    unknown = [name for name in names if name not in _COLUMNS]
    missing = [name for name in _REQUIRED if name not in names]
    if unknown or missing:
        wrong = f"no column {missing[0]!r}" if missing else f"unknown column {one_line(unknown[0], 40)!r}"
        raise FitError(f"{path}: {wrong}; expected {', '.join(_COLUMNS)}, of which file and person are required")
    if not rows:
        raise FitError(f"{path}: lists no people")
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
