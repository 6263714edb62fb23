"""``icmj fit``: families of controllers fitted to recordings of standing people."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.base.text import one_line
from icmj.cli.arguments import ALSO, FOLDER, POSITIONAL, PROCESSES, RESULTS, Command, Given
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import FitError

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.fits.fit import Fit as DoneFit
    from icmj.fits.fit import Subject


_COLUMNS, _REQUIRED = ("file", "column", "person", "group", "condition"), ("file", "person")


@dataclass(frozen=True)
class FitCommand(Command):
    """Fit families of controllers to recordings of standing people (exploratory): parameters, reliability, comparison.

    Needs pip install -e '.[fit]' in a checkout. Each family is simulated, and its network trained, only once for all
    people.

    Example: icmj fit anna-1.csv anna-2.csv anna-3.csv --model event --model switching --out runs/out/anna
    """

    group = ALSO

    recordings: Annotated[tuple[Path, ...], POSITIONAL] = ()
    """Recordings of one person (CSV, Parquet, npz, C3D), each of one trial or several; or of several people, where a
    column of the file names them."""
    model: Annotated[tuple[Path, ...], Given(repeated=True, metavar="FAMILY")] = ()
    """Family file, or name of a shipped family. May be repeated; the families are then compared, which depends
    on the noise that they assume."""
    table: Path | None = None
    """CSV table that lists the recordings of several people, instead of RECORDINGS (required columns: file and person;
    optional columns: column, group and condition); or BDSinfo.txt of the public data set (Santos and Duarte 2016),
    beside its trials."""
    columns: tuple[str, ...] = ()
    """Columns of the recordings that hold the front-to-back centre of pressure, one column for each trial."""
    unit: Literal["m", "cm", "mm"] | None = None
    """Unit of recordings that do not state one."""
    rate: float | None = None
    """Rate of recordings without times [Hz]."""
    since: float | None = None
    """Time from which each recording is fitted [s] (default: all of it)."""
    until: float | None = None
    """Time up to which it is fitted [s]."""
    hold_out: Annotated[int, Given(least=0)] = 0
    """Number of trials of each person, counted from the last, that are predicted instead of fitted."""
    out: Annotated[Path, FOLDER] = RESULTS / "fit"
    """Folder for posteriors (netCDF, for ArviZ), tables, figures and page. The same command resumes a fit."""
    trained: Annotated[Path, FOLDER] = RESULTS / "families"
    """Folder for simulated and trained families, which are reused for all people."""
    simulations: Annotated[int, Given(least=200)] = 6000
    """Number of draws from the prior of each family that are simulated to train its network."""
    draws: Annotated[int, Given(least=100)] = 2000
    """Number of draws from each posterior."""
    seed: Annotated[int, Given(least=0)] = 0
    """Seed of all random numbers."""
    jobs: Annotated[int | None, PROCESSES] = None
    """Number of processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers run the simulations instead of local processes."""
    allow_code: bool = False
    """Run Python code that the run files of families name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of tables."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Fit families to recordings; whatever is finished stays, however it ends."""
        from icmj.fits.family import DELAY, load_family
        from icmj.fits.fit import fit as fitted
        from icmj.fits.network import library
        from icmj.fits.page import PAGE, summary, write_fit
        from icmj.fits.page import RESULTS as NUMBERS

        if not self.model:
            raise FitError("no family; give --model, such as --model event")
        if bool(self.recordings) == (self.table is not None):
            raise FitError("give either recordings or --table")
        with Working("reading recordings", err) as working:
            people = list_people(self, working.tell)
        families = [load_family(path, allow_code=self.allow_code) for path in self.model]
        if delayed := [family.name for family in families if family.has_delay]:
            err.note(f"{', '.join(delayed)}: {DELAY}")  # before hours of simulation
        library()
        with Working("fit", err) as working:
            done = fitted(
                people,
                families,
                self.out,
                trained=self.trained,
                simulations=self.simulations,
                draws=self.draws,
                seed=self.seed,
                jobs=self.jobs,
                dask=self.dask,
                progress=working.tell,
            )
            working.tell("writing", 1.0)
            write_fit(done, self.out)
        if self.json:
            out.show({**summary(done), "folder": str(self.out)})
            return
        _show_fit(done, out)
        for what, path in (("results", NUMBERS), ("page", PAGE)):
            out.say(f"{what:<8} {self.out / path}", wrap=False)


def list_people(command: FitCommand, progress: Callable[[str, float], None] = lambda what, done: None) -> list[Subject]:
    """Those whose recordings were given, or whom a table lists; the trials of a person and condition are one.

    Raises:
        FitError: one line, if a recording or the table cannot be used, or a recording is listed twice for one person.
    """
    from hashlib import sha256

    from icmj.fits.fit import Subject
    from icmj.fits.recording_tables import MOST
    from icmj.fits.recordings import TrialOf, read_trials

    if command.table is None:
        rows = [{"file": str(path), "person": command.recordings[0].stem} for path in command.recordings]
        base = Path()
    else:
        rows, base = _list_rows(command.table), command.table.parent
    listed: set[tuple[str, ...]] = set()
    found: dict[tuple[str, ...], list[tuple[str, TrialOf]]] = {}
    same: dict[tuple[tuple[str, ...], bytes], str] = {}
    count = 0
    for i, row in enumerate(rows):
        columns = (row["column"],) if row.get("column") else command.columns
        whose = row["person"], row.get("group", ""), row.get("condition", "")
        recording = *whose, os.path.abspath(base / row["file"]), *columns
        if recording in listed:
            raise FitError(f"{command.table or row['file']}: {row['file']} is given twice for {row['person']}")
        listed.add(recording)
        part = {"since": command.since, "until": command.until}
        trials = read_trials(base / row["file"], columns, unit=command.unit, rate=command.rate, **part)
        count += len(trials)
        if count > MOST:
            raise FitError(f"{base / row['file']}: the recordings hold more than {MOST} trials; fit them in parts")
        if command.table is not None and len({one.person for one in trials}) > 1:
            raise FitError(f"{base / row['file']}: holds several people; give it instead of --table")
        for one in trials:
            person = row["person"] if command.table is not None else one.person or row["person"]
            key = person, row.get("group", ""), row.get("condition") or one.condition
            if (other := same.setdefault((key, sha256(one.cop.tobytes()).digest()), row["file"])) != row["file"]:
                raise FitError(f"{base / row['file']}: holds the same values as {other}; a copy is no further trial")
            found.setdefault(key, []).append((row["file"], one))
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


def _list_rows(path: Path) -> list[dict[str, str]]:
    """The rows of a table of people, or of the public data set's own table."""
    from icmj.fits.recording_tables import INFO, public_trials, read_table

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


def _show_fit(done: DoneFit, out: Terminal) -> None:
    """A table of numbers for each person and family, then what else was found, in words."""
    import numpy as np

    from icmj.base.numbers import amount
    from icmj.fits.choice import say_probability
    from icmj.fits.page import caveats, words_of

    for one in done.people:
        for note in one.notes:
            out.say(f"note: {note}")
    for each in done.trained.values():
        out.say(each.words)
    for found in done.fitted:
        trained = done.trained[found.family]
        low, median, high = np.quantile(found.theta, (0.05, 0.5, 0.95), axis=0)
        prior, verdicts = trained.family.prior, trained.calibration.judge(found.contraction)
        rows = [
            (name, prior.units[i], *(amount(of[i], figures=4) for of in (median, low, high)), verdicts[i])
            for i, name in enumerate(prior.names)
        ]
        columns = (
            Column("number"), Column("unit", rank=1), Column("median", "right"), Column("5 %", "right"),
            Column("95 %", "right"), Column("verdict"),
        )  # fmt: skip
        show_table(columns, rows, out, title=f"{found.person.label}: {trained.family.title}")
        out.say(words_of(found))
    if done.confusion is not None and done.probabilities is not None:
        head = (Column("probability"), *(Column(name, "right") for name in done.trained))
        shares = [
            (one.label, *map(say_probability, each)) for one, each in zip(done.people, done.probabilities, strict=True)
        ]
        show_table(head, shares, out, title="Which family")
        out.say(done.confusion.words + ".")
    for said in caveats(done):
        out.say(said)
    for name, differences in done.differences.items():
        for difference in differences:
            out.say(f"{name}: {difference.words}")


COMMAND = FitCommand
