"""What ``icmj sweep`` does and shows."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

from icmj.base.numbers import lapse
from icmj.cli.working import Working
from icmj.errors import SweepError

if TYPE_CHECKING:
    from icmj.cli.arguments import Sweep
    from icmj.cli.terminal import Terminal
    from icmj.sweeps.plan import Plan
    from icmj.sweeps.sweep import Progress


def carry_out(command: Sweep, out: Terminal, err: Terminal) -> None:
    """Carry out a sweep, or say what it would cost; what was finished stays, however it ends."""
    from icmj.sweeps.sweep import carry_out as compute
    from icmj.sweeps.sweep import planned

    if command.jobs is not None and command.jobs < 1:
        raise SweepError(f"--jobs {command.jobs}: expected at least 1")
    if command.jobs is not None and command.dask is not None:
        raise SweepError("--jobs and --dask: give one; the workers of a cluster are started with it")
    with Working("sweep", err) as working:
        plan = planned(command.sweep, allow_code=command.allow_code)
        folder = command.out or Path("runs/out") / plan.file.sweep.name
        if command.dry_run:
            _cost(plan, out)
            return

        begun: list[Progress] = []

        def tell(progress: Progress) -> None:
            begun[:] = [progress]
            working.tell(_words(progress), progress.done / progress.points)

        try:
            done = compute(plan, folder, jobs=command.jobs, dask=command.dask, progress=tell)
        except BaseException as error:
            if begun or not isinstance(error, SweepError):  # else it refuses the folder, and goes on with nothing
                _left(plan, folder, err)
            raise
    _show(folder, done, out)


def _cost(plan: Plan, out: Terminal) -> None:
    from icmj.sweeps.sweep import estimate

    cost = estimate(plan)
    out.say(f"{cost.points} points in {cost.chunks} chunks of {plan.chunk}")
    out.say(
        f"about {lapse(cost.seconds)} of one core ({1e3 * cost.seconds / cost.points:.3g} ms a point), "
        f"{cost.size / 1e6:.3g} MB"
    )


def _left(plan: Plan, folder: Path, err: Terminal) -> None:
    """Say what an interrupted sweep left, if it had begun."""
    count = len(list((folder / "points").glob("*.parquet")))
    if count:
        err.say(f"icmj: {count} of {plan.chunks} chunks are finished in {folder}; the same command goes on", wrap=False)


def _show(folder: Path, done: Progress, out: Terminal) -> None:
    from icmj.sweeps.dataset import statuses

    found: Counter[str] = statuses(folder)
    bad = ", ".join(f"{count} {status}" for status, count in sorted(found.items()) if status != "ok")
    out.say(f"{done.points} points{f', of which {bad}' if bad else ''}")
    size = sum(path.stat().st_size for path in (folder / "points").iterdir()) / 1e6
    out.say(f"dataset  {folder / 'points'} ({size:.3g} MB)")


def _words(progress: Progress) -> str:
    failed = f", {progress.failed} failed" if progress.failed else ""
    return f"{progress.done} of {progress.points} points, {progress.rate:.3g}/s{failed}"
