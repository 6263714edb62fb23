"""``icmj export``: rows and events of logs as tables for other tools."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from icmj.cli.arguments import POSITIONAL, RESULTS, Command, Given
from icmj.cli.progress import Working

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal


@dataclass(frozen=True)
class ExportCommand(Command):
    """Export the signals of a log and, in a second file, its events for use in other tools.

    Units are in the header (CSV), in the metadata of each field (Parquet) or in a separate array (npz).

    Example: icmj export runs/out/three-link-0.9.mujoco.rrd --to csv --rate 100
    """

    group = "Use the logs"

    log: Annotated[Path, POSITIONAL]
    """Log to read, folder of logs, or name of a case with logs in runs/out."""
    to: str | None = None
    """Format (default: the one that --out ends in, or else the first)."""
    rate: float | None = None
    """Rate of evenly spaced rows [Hz] (default: the rows as recorded, which include every event)."""
    out: Path | None = None
    """File to write, for one log (default: beside the log, with its name). The file of events has ".events" added to
    its name.
    """

    @classmethod
    def complete(cls) -> type[Command]:
        """With the formats that are written."""
        from icmj.series.writing import find_writers

        endings = tuple(find_writers())
        formats = Literal[tuple(ending.removeprefix(".") for ending in endings)]  # type: ignore[valid-type]
        return cls.extend([("to", formats, Given()), ("out", Path, Given(writes=endings))])

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Write rows and events of logs, say where they are."""
        from icmj.errors import DataError
        from icmj.log.selection import find_logs

        logs = find_logs([self.log], RESULTS)
        if len(logs) > 1 and self.out is not None:
            raise DataError(
                f"--out {self.out}: {len(logs)} logs are exported, each beside itself; give one, or no --out"
            )
        for log in logs:
            _export(log, self, out, err)


def _export(log: Path, command: ExportCommand, out: Terminal, err: Terminal) -> None:
    from icmj.base.files import expect_replaceable
    from icmj.errors import DataError
    from icmj.log.reader import read_log
    from icmj.series.writing import find_writers, write_series

    endings = [f".{command.to}"] if command.to else list(find_writers())
    path = log.with_suffix(endings[0]) if command.out is None else command.out
    if path.suffix not in endings:
        expected = f"{endings[0]}, as --to says" if command.to else ", ".join(endings)
        raise DataError(f"--out {path}: expected a name that ends in {expected}")
    events_path = path.with_suffix(f".events{path.suffix}")
    expect_replaceable(path, events_path)
    with Working(f"exporting {log.name}", err):
        result = read_log(log)
        rows, events = result.to_series(command.rate), result.events_to_series()
        write_series(rows, path)
        write_series(events, events_path)
    for what, series, file in (("rows", rows, path), ("events", events, events_path)):
        size = f"{len(series)} rows, {len(series.names)} signals"
        out.say(f"{what:<7} {file}  {size}", wrap=False)


COMMAND = ExportCommand
