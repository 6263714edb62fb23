"""The commands that export, measure and replay logs and time series."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING

from icmj.cli import series_arguments as arguments
from icmj.cli.arguments import Replay
from icmj.cli.terminal import ERR, OUT
from icmj.cli.working import Working

if TYPE_CHECKING:
    from icmj.series.series import Series

MOST = 6  # signals in one table
RATE = 100.0  # Hz: at which a log is measured


def export(command: arguments.Export) -> None:
    """Write rows and events of a log, say where they are."""
    from icmj.base.files import replaceable
    from icmj.errors import DataError
    from icmj.log import read_log
    from icmj.series.writing import FORMATS, write_series

    out = command.log.with_suffix(f".{command.to or 'csv'}") if command.out is None else command.out
    if out.suffix not in ([f".{command.to}"] if command.to else FORMATS):
        expected = f".{command.to}, as --to says" if command.to else ", ".join(FORMATS)
        raise DataError(f"--out {out}: expected a name that ends in {expected}")
    events_out = out.with_suffix(f".events{out.suffix}")
    replaceable(out, events_out)
    with Working(f"exporting {command.log.name}", ERR):
        result = read_log(command.log)
        rows, events = result.to_series(command.rate), result.events_to_series()
        write_series(rows, out)
        write_series(events, events_out)
    for what, series, path in (("rows", rows, out), ("events", events, events_out)):
        size = f"{len(series)} rows, {len(series.names)} signals"
        OUT.say(f"{what:<7} {path}  {size}", wrap=False)


def measure(command: arguments.Measure) -> None:
    """Print the measures of sway in a log or a file."""
    from icmj.cli.sway_table import record, show_sway
    from icmj.errors import DataError
    from icmj.measurement.sway import from_torque, measure_sway

    if (command.torque is None) != (command.weight is None):
        raise DataError("--torque and --weight go together: the centre of pressure is torque over weight")
    with Working(f"measuring {command.file.name}", ERR):
        series, notes = _signals(command)
        series = series if command.since is None else series.since(command.since)
        if command.torque is not None and command.weight is not None:
            series = from_torque(series, command.torque, command.weight)
        if len(series.names) > MOST and not command.json:
            some = ", ".join(series.names[:4])
            raise DataError(
                f"{command.file}: {len(series.names)} signals ({some}, ...); name up to {MOST} by --columns"
            )
        try:
            sway = measure_sway(series, low_pass=command.low_pass, band=command.band or (0.0, float("inf")))
        except DataError as error:
            raise DataError(f"{command.file}: {error}") from error
    if command.json:
        OUT.show({**record(sway), "notices": notes})
        return
    filtered = "" if sway.low_pass is None else f", low-pass {sway.low_pass:g} Hz"
    show_sway(sway, f"{command.file.name}: {sway.duration:.6g} s at {sway.rate:.6g} Hz{filtered}", OUT)
    if "resampled" in sway.series.facts:
        notes = (*notes, f"resampled by a {sway.series.facts['resampled']}")
    for note in notes:
        OUT.note(note)


def replay(command: Replay) -> None:
    """Open, serve or picture a log."""
    from icmj.log.replay import replay as show

    with Working(f"rendering {command.screenshot}", ERR) if command.screenshot else nullcontext():
        show(command.log, web=command.web, screenshot=command.screenshot, time=command.time, say=ERR.say)


def _signals(command: arguments.Measure) -> tuple[Series, tuple[str, ...]]:
    """The series to be measured, from a log or a file, evenly sampled for a log or with a rate; and notes."""
    from icmj.series.even import even_series
    from icmj.series.reading import read_series

    columns = command.columns if command.torque is None else (*command.columns, command.torque)
    if command.file.suffix == ".rrd":
        from icmj.log import read_log

        result = read_log(command.file)
        notes = tuple(notice for notice in result.notices if notice.startswith("slow noise"))
        series = result.to_series(RATE if command.rate is None else command.rate)
        ground = result.simulation.pressure
        moving = () if ground is None else tuple(f"cop.{axis}" for axis in ground.axes)
        series = series.chosen(columns or moving or [name for name in series.names if name.startswith("y.")])
        return replace(series, facts={k: v for k, v in series.facts.items() if k != "resampled"}), notes
    series = read_series(command.file, columns=columns, rate=command.rate)
    return (series if command.rate is None else even_series(series, command.rate)), ()
