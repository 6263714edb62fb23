"""``icmj measure``: the measures of sway in logs and recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import pi
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from icmj.cli.arguments import POSITIONAL, RESULTS, Command, Given
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.measurement.sway import Measured, Sway
    from icmj.series.series import Series


MOST = 6  # signals in one table
RATE = 100.0  # Hz: at which a log is measured
# what people read: factor on the value, and unit
UNITS = {"rad": (180 / pi, "deg"), "rad/s": (180 / pi, "deg/s"), "m": (1e3, "mm")}


@dataclass(frozen=True)
class MeasureCommand(Command):
    """Measure sway: RMS, speed, range, prediction ellipse, frequencies, stabilogram diffusion.

    In a log, the centre of pressure is measured if the body stands on a floor, else the outputs; in a table (CSV,
    Parquet, npz, OpenSim's mot and sto), all columns; in a C3D file, the centre of pressure of its force plates, else
    its points. Two columns with the same unit are also measured together, as the path of a point in a plane.

    Example: icmj measure sway.csv --columns ap ml --rate 100
    """

    group = "Use the logs"

    file: Annotated[Path, POSITIONAL]
    """Log, folder of logs, name of a case with logs in runs/out, or file of time series."""
    columns: tuple[str, ...] = ()
    """Columns to measure (default: see above)."""
    rate: float | None = None
    """Rate to resample to (default: 100 for a log), or the rate of a file without times [Hz]."""
    since: float | None = None
    """Time from which the series are measured [s] (default: all rows, those before 0 too)."""
    until: float | None = None
    """Time up to which they are measured [s]."""
    low_pass: float | None = None
    """Corner frequency of a low-pass filter applied before all measures [Hz]."""
    measure: Annotated[tuple[str, ...], Given(metavar="NAME")] = ()
    """Measures beside the standard ones: the module:name of your own, or the name of one that is not standard."""
    allow_code: bool = False
    """Run Python code that --measure names as module:name. Read the code first."""
    torque: str | None = None
    """Column of the ankle torque, from which the centre of pressure is computed."""
    weight: float | None = None
    """Vertical force on the foot [N], for --torque."""
    unit: str | None = None
    """Unit of the columns that do not state one, such as mm, or "N mm" for --torque."""
    json: bool = False
    """Print JSON, in the units of the file, instead of a table."""

    @classmethod
    def complete(cls) -> type[Command]:
        """With the options of the measures."""
        from icmj.measurement.measures import list_options

        return cls.extend([(one.name, one.kind, Given(meaning=one.meaning)) for one in list_options().values()])

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Print the measures of sway in logs or a file."""
        from icmj.errors import DataError
        from icmj.log.selection import find_logs
        from icmj.series.long_table import label_of, labels_of

        if (self.torque is None) != (self.weight is None):
            raise DataError("--torque and --weight go together: the centre of pressure is torque over weight")
        found = [
            (path, *measured) for path in find_logs([self.file], RESULTS) for measured in _measure_file(path, self, err)
        ]
        if self.json:
            records = [
                {**labels_of(sway.series.facts), **plain_sway(sway), "notices": notes} for _, sway, notes in found
            ]
            out.show(records[0] if len(records) == 1 else records)
            return
        for path, sway, notes in found:
            filtered = "" if sway.low_pass is None else f", low-pass {sway.low_pass:g} Hz"
            title = ", ".join(filter(None, (path.name, label_of(sway.series))))
            show_sway(sway, f"{title}: {sway.duration:.6g} s at {sway.rate:.6g} Hz{filtered}", out)
            for note in notes:
                out.note(note)


def _measure_file(path: Path, command: MeasureCommand, err: Terminal) -> list[tuple[Sway, tuple[str, ...]]]:
    """The sway in a log or a file, with notes; of each trial, where there are several."""
    from icmj.errors import DataError
    from icmj.measurement.measures import find_measure, list_options
    from icmj.series.long_table import label_of
    from icmj.work.own_code import Code

    further = [find_measure(name, Code(Path.cwd(), command.allow_code)) for name in command.measure]
    given = {name: getattr(command, name) for name in list_options()}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}

    with Working(f"measuring {path.name}", err):
        found = []
        for series, notes in _read_signals(path, command):
            where = ", ".join(filter(None, (str(path), label_of(series))))
            try:
                sway = _measure_series(series, command, path.suffix == ".rrd", further, options)
            except DataError as error:
                raise DataError(f"{where}: {error}") from error
            found.append((sway, (*notes, *sway.series.remarks)))
    return found


def _measure_series(
    series: Series, command: MeasureCommand, log: bool, measures: Sequence[Any], options: Mapping[str, Any]
) -> Sway:
    """The sway in one series, whose columns without a unit have that of the command."""
    from icmj.errors import DataError
    from icmj.measurement.sway import from_torque, measure_sway

    # a log is in SI units; of an actuator's own they are not known, and its torque is in N m
    unit = command.unit or ("N m" if command.torque is not None and log else "")
    series = replace(series, units=tuple(own or unit for own in series.units))
    if command.torque is not None and command.weight is not None:
        if not series.units[series.place(command.torque)]:
            raise DataError(f"{command.torque} has no unit; say it with --unit, such as 'N m' or 'N mm'")
        series = from_torque(series, command.torque, command.weight)
    if len(series.names) > MOST and not command.json:
        some = ", ".join(series.names[:4])
        raise DataError(f"{len(series.names)} signals ({some}, ...); name up to {MOST} by --columns")
    return measure_sway(series, low_pass=command.low_pass, measures=measures, **options)


def _read_signals(path: Path, command: MeasureCommand) -> list[tuple[Series, tuple[str, ...]]]:
    """The series to be measured, from a log or a file, evenly sampled for a log or with a rate; and notes."""
    from icmj.errors import DataError
    from icmj.series.even_rows import resample_series
    from icmj.series.plausibility import note_oddities
    from icmj.series.reading import cut_rows, read_long_table

    columns = command.columns if command.torque is None else (*command.columns, command.torque)
    if path.suffix == ".rrd":
        from icmj.log.reader import read_log

        result = read_log(path)
        notes = tuple(notice for notice in result.notices if notice.startswith("slow noise"))
        series = result.to_series(RATE if command.rate is None else command.rate)
        try:
            series = cut_rows(series, command.since, command.until)
        except DataError as error:
            raise DataError(f"{path}: {error}") from error
        ground = result.simulation.pressure
        moving = () if ground is None else tuple(f"cop.{axis}" for axis in ground.axes)
        series = series.chosen(columns or moving or [name for name in series.names if name.startswith("y.")])
        return [(replace(series, facts={k: v for k, v in series.facts.items() if k != "resampled"}), notes)]
    read = read_long_table(path, columns=columns, rate=command.rate, since=command.since, until=command.until)
    noted = map(note_oddities, read)
    return [(one if command.rate is None else resample_series(one, command.rate), ()) for one in noted]


def show_sway(sway: Sway, title: str, out: Terminal) -> None:
    """Measures down, signals across, the plane of two of them last."""
    from icmj.base.numbers import MISSING

    values = [_list_rows(c) for c in sway.coordinates]
    units = [_find_unit(c.unit)[1] for c in sway.coordinates]
    heads = [f"{c.name} ({unit})" if unit else c.name for c, unit in zip(sway.coordinates, units, strict=True)]
    if sway.plane is not None:
        values.append(_list_rows(sway.plane))
        heads.append(f"plane ({_find_unit(sway.plane.unit)[1]})".replace(" ()", ""))
    labels = dict.fromkeys(label for column in values for label in column)
    rows = [(label, *(column.get(label, MISSING) for column in values)) for label in labels]
    show_table((Column(""), *(Column(head, "right") for head in heads)), rows, out, title=title)


def plain_sway(sway: Sway) -> dict[str, Any]:
    """What ``--json`` prints: every measure, in the units of the series."""
    from icmj.base.numbers import plain

    found: dict[str, Any] = {
        "duration": sway.duration,
        "rate": sway.rate,
        "samples": len(sway.series),
        "low_pass": sway.low_pass,
        "resampled": sway.series.facts.get("resampled"),
        "coordinates": [{"name": c.name, "unit": c.unit, **c.record()} for c in sway.coordinates],
        "plane": None,
    }
    if (plane := sway.plane) is not None:
        found["plane"] = {"names": plane.names, "unit": plane.unit, **plane.record()}
    found["spectrum"] = {"frequency": sway.spectrum.frequency, "power": sway.spectrum.power.T}
    return dict(plain(found))


def _list_rows(of: Measured) -> dict[str, str]:
    """Values by label, in the units that people read."""
    from icmj.base.numbers import amount

    factor, angle = _find_unit(of.unit)[0], UNITS["rad"]
    found = {}
    for one, value in of.numbers.items():
        mark = one.unit.replace("U", "unit").replace("rad", angle[1])
        label = one.words + {"": "", "unit": "", "unit/s": " (per s)"}.get(mark, f" ({mark})")
        by = factor ** (2 if "U²" in one.unit else "U" in one.unit) * (angle[0] if one.unit == "rad" else 1)
        found[label] = amount(by * value, figures=4)
    return found


def _find_unit(unit: str) -> tuple[float, str]:
    return UNITS.get(unit, (1.0, unit))


COMMAND = MeasureCommand
