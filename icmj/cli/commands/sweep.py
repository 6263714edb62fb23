"""``icmj sweep``: a case at many points of its parameters."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from icmj.cli.arguments import FOLDER, POSITIONAL, PROCESSES, RESULTS, Command
from icmj.cli.progress import Working
from icmj.cli.table import Column, show_table
from icmj.errors import SweepError

if TYPE_CHECKING:
    from icmj.cli.terminal import Terminal
    from icmj.study.plan import Plan
    from icmj.study.sweep import Progress


SHOWN = 6  # points of a sweep that are printed
SUFFIXES = ("delta_crit", "verdict", "outcome", "interval", "error")


@dataclass(frozen=True)
class SweepCommand(Command):
    """Compute a case at many points of its parameters and write Parquet files; an interrupted sweep can be resumed.

    Example: icmj sweep validity --out runs/out/validity
    """

    group = "Simulate"

    sweep: Annotated[Path, POSITIONAL]
    """Sweep file, or name of a shipped sweep."""
    out: Annotated[Path | None, FOLDER] = None
    """Folder for the results (default: runs/out/NAME). The same command resumes an interrupted sweep."""
    jobs: Annotated[int | None, PROCESSES] = None
    """Number of local processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers do the computing."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""
    dry_run: bool = False
    """Print the number of points, the estimated time and the size of the results, and stop."""

    def carry_out(self, out: Terminal, err: Terminal) -> None:
        """Carry out a sweep, or say what it would cost; what was finished stays, however it ends."""
        from icmj.study.sweep import carry_out as compute
        from icmj.study.sweep import make_plan

        if self.jobs is not None and self.dask is not None:
            raise SweepError("--jobs and --dask: give one; the workers of a cluster are started with it")
        with Working("sweep", err) as working:
            plan = make_plan(self.sweep, allow_code=self.allow_code)
            folder = self.out or RESULTS / plan.file.sweep.name
            if self.dry_run:
                _show_cost(plan, out)
                return

            begun: list[Progress] = []

            def tell(progress: Progress) -> None:
                begun[:] = [progress]
                working.tell(_say_progress(progress), progress.done / progress.points)

            try:
                done = compute(plan, folder, jobs=self.jobs, dask=self.dask, progress=tell)
            except BaseException as error:
                if begun or not isinstance(error, SweepError):  # else it refuses the folder, and goes on with nothing
                    _report_left(plan, folder, err)
                raise
        _show(folder, done, out)


def _show_cost(plan: Plan, out: Terminal) -> None:
    from icmj.base.numbers import format_duration
    from icmj.study.sweep_cost import estimate

    cost = estimate(plan)
    out.say(f"{cost.points} points in {cost.chunks} chunks of {plan.chunk}")
    out.say(
        f"about {format_duration(cost.seconds)} of one core ({1e3 * cost.seconds / cost.points:.3g} ms a point), "
        f"{cost.size / 1e6:.3g} MB"
    )


def _report_left(plan: Plan, folder: Path, err: Terminal) -> None:
    """Say what an interrupted sweep left, if it had begun."""
    count = len(list((folder / "points").glob("*.parquet")))
    if count:
        err.say(f"icmj: {count} of {plan.chunks} chunks are finished in {folder}; the same command goes on", wrap=False)


def _show(folder: Path, done: Progress, out: Terminal) -> None:
    from icmj.study.sweep_folder import statuses

    found: Counter[str] = statuses(folder)
    bad = ", ".join(f"{count} {status}" for status, count in sorted(found.items()) if status != "ok")
    out.say(f"{done.points} points{f', of which {bad}' if bad else ''}")
    size = sum(path.stat().st_size for path in (folder / "points").iterdir()) / 1e6
    _show_rows(folder, out)
    out.say(f"dataset  {folder / 'points'} ({size:.3g} MB, Parquet; icmj.read_sweep or pandas.read_parquet reads it)")
    out.say(f"columns  their meanings are in {folder / 'sweep.json'}")
    out.say(f"next     icmj report {folder} --out {folder.name}.html", wrap=False)


def _show_rows(folder: Path, out: Terminal) -> None:
    """The first points of a sweep, in the columns that matter most."""
    from itertools import islice

    from icmj.study.sweep_folder import Dataset

    dataset = Dataset(folder)
    facts = dataset.facts
    chunks = (table.slice(0, SHOWN).to_pylist() for _, table in dataset.chunks())
    rows = list(islice((row for chunk in chunks for row in chunk), SHOWN))
    matter = ("root_real", *(f"{of}_{suffix}" for of in ("predicted", "linear", "mujoco") for suffix in SUFFIXES))
    names = [name for name in matter if any(row.get(name) is not None for row in rows)]
    columns = [*map(Column, facts.varies), *(Column(name, rank=rank) for rank, name in enumerate(names, 1))]
    cells = [[_write_cell(row[name]) for name in (*facts.varies, *names)] for row in rows]
    title = facts.title or facts.name
    more = "" if len(rows) == facts.points else f"; the first {len(rows)} of {facts.points} points"
    show_table(columns, cells, out, title=f"{title}{more}", keys=len(facts.varies))


def _write_cell(value: object) -> str:
    from icmj.base.numbers import number

    if value is None or isinstance(value, float):
        return number(value)
    return str(value)


def _say_progress(progress: Progress) -> str:
    failed = f", {progress.failed} failed" if progress.failed else ""
    return f"{progress.done} of {progress.points} points, {progress.rate:.3g}/s{failed}"


COMMAND = SweepCommand
