"""The arguments of the commands that compute very many points, and that go back from a motion to its cause."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from icmj.cli.overrides import Overrides


@dataclass(frozen=True)
class Sweep:
    """Compute a case at very many points into a folder of Parquet files; one that was ended goes on where it was.

    Example: icmj sweep validity --out runs/out/validity
    """

    sweep: tyro.conf.Positional[Path]
    """Sweep file, or name of a shipped one."""
    out: Path | None = None
    """Folder of the dataset; runs/out/NAME by default."""
    jobs: int | None = None
    """Local processes; as many as there are cores by default."""
    dask: str | None = None
    """Address of a Dask scheduler, whose workers compute instead."""
    dry_run: bool = False
    """Say how many points there are, how long they take and how many bytes, and compute nothing else."""


@dataclass(frozen=True)
class Identify(Overrides):
    """Estimate a model error from measured motion, with its uncertainty; or say that the motion cannot tell.

    From logs; or, with --run, from files of event times, one a line, or of sampled outputs with their times.

    Example: icmj identify runs/out/three-link-0.9.mujoco.rrd
    """

    motions: tyro.conf.Positional[tuple[Path, ...]]
    """Logs, or files of event times or outputs."""
    run: Path | None = None
    """Run file with all that is known; a log's own by default. What it says of the unknown is not looked at."""
    unknown: str = "actual.gain"
    """What is sought: a key of the run file, or a change and of what, as "mass trunk", whose factor is sought."""
    low: float = 0.5
    """Least value that is thought of."""
    high: float = 1.5
    """Largest value that is thought of."""
    timing: float | None = None
    """Standard deviation of the errors of times [s]; what rounding to the sampling interval makes, by default."""
    reading: float | None = None
    """Standard deviation of the errors of outputs [rad, or the plant's unit]; a hundredth of their size by default."""
    plant: Literal["linear", "mujoco"] | None = None
    """What moved; a log says it itself, and MuJoCo's stands for what was measured elsewhere."""
    seed: int = 0
    """Of the motions that are simulated for comparison under noise."""
    json: bool = False
    """Print JSON instead of sentences."""
