"""What the commands do that take time series out of the package, or into it."""

from __future__ import annotations

from rich.console import Console
from rich.markup import escape

from icmj.cli import series_arguments as arguments
from icmj.cli.working import Working

OUT = Console()
ERR = Console(stderr=True)


def export(command: arguments.Export) -> None:
    """Write rows and events of a log, say where they are."""
    from icmj.errors import DataError
    from icmj.log import read_log
    from icmj.series.writing import FORMATS, write_series

    out = command.log.with_suffix(f".{command.to or 'csv'}") if command.out is None else command.out
    if out.suffix not in ([f".{command.to}"] if command.to else FORMATS):
        expected = f".{command.to}, as --to says" if command.to else ", ".join(FORMATS)
        raise DataError(f"--out {out}: expected a name that ends in {expected}")
    events_out = out.with_suffix(f".events{out.suffix}")
    with Working(f"exporting {command.log.name}", ERR):
        result = read_log(command.log)
        rows, events = result.to_series(command.rate), result.events_to_series()
        write_series(rows, out)
        write_series(events, events_out)
    for what, series, path in (("rows", rows, out), ("events", events, events_out)):
        size = f"{len(series)} rows, {len(series.names)} signals"
        OUT.print(f"{what:<7} {escape(str(path))}  {size}", highlight=False, soft_wrap=True)
