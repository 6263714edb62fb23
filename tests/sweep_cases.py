"""Sweeps for tests: small ones of the pendulum, and their rows."""

from pathlib import Path

from icmj.study.plan import Plan

ROOT = Path(__file__).resolve().parent.parent
PENDULUM = ROOT / "runs" / "simple-0.8.toml"

GRID = """
[[vary]]
field = "actual.gain"
name = "b"
low = 0.7
high = 1.3
count = {count}
"""
THRESHOLDS = """
[[vary]]
field = "controller.q_t"
values = [0.01, 0.001]
"""


def sweep_file(folder: Path, vary: str, *, ask="", chunk=7, more="", name="sweep.toml") -> Path:
    """A sweep file of the pendulum in ``folder``."""
    path = folder / name
    head = f'[sweep]\nname = "test"\nrun = "{PENDULUM}"\nchunk = {chunk}\n{more}\n'
    path.write_text(f"{head}{vary}\n[ask]\n{ask}\n", encoding="utf-8")
    return path


def contents(folder: Path) -> dict[str, bytes]:
    """Every file of the dataset, byte for byte."""
    return {path.name: path.read_bytes() for path in sorted((folder / "points").iterdir())}


def computed(plan: Plan) -> dict[str, bytes]:
    """What all chunks of a sweep must hold, computed here, by the names of their files."""
    from icmj.study.chunk import compute

    return {f"{i:08d}.parquet": compute(plan, plan.range(i)).content for i in range(plan.chunks)}
