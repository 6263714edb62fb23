"""The arguments of ``icmj sweep`` and ``icmj identify``."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from icmj.cli.overrides import Overrides, Shared


@dataclass(frozen=True)
class Sweep(Shared):
    """Compute a case at many points of its parameters and write Parquet files; an interrupted sweep can be resumed.

    Example: icmj sweep validity --out runs/out/validity
    """

    sweep: tyro.conf.Positional[Path]
    """Sweep file, or name of a shipped sweep."""
    out: Path | None = None
    """Folder for the results (default: runs/out/NAME). The same command resumes an interrupted sweep."""
    jobs: int | None = None
    """Number of local processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers do the computing."""
    allow_code: bool = False
    """Run Python code that the run file names as module:name. Read the code first."""
    dry_run: bool = False
    """Print the number of points, the estimated time and the size of the results, and stop."""


@dataclass(frozen=True)
class Identify(Overrides):
    """Estimate a model error and its uncertainty from a measured motion, or say that the motion does not determine it.

    The motion is a log; or, with --run, a file of event times, one per line, or of sampled outputs with their times.

    Example: icmj identify runs/out/three-link-0.9.mujoco.rrd
    """

    motions: tyro.conf.Positional[tuple[Path, ...]]
    """Logs, or files of event times or outputs."""
    run: Path | None = None
    """Run file that describes plant and controller (default: that of the log). Its value of the unknown is ignored."""
    unknown: str = "actual.gain"
    """Unknown parameter: a key of the run file, or a change and its target, such as "mass trunk" (its factor)."""
    low: float = 0.5
    """Lower end of the search."""
    high: float = 1.5
    """Upper end of the search."""
    timing: float | None = None
    """Standard deviation of timing errors [s] (default: that of rounding to the sampling interval)."""
    reading: float | None = None
    """Standard deviation of the measurement errors of outputs [rad, or the unit of the plant] (default: a hundredth of
    the size of the outputs).
    """
    plant: Literal["linear", "mujoco"] | None = None
    """Plant that made the motion (default: that of the log; mujoco for other files)."""
    seed: int = 0
    """Seed of the simulations to which a noisy motion is compared."""
    json: bool = False
    """Print JSON instead of sentences."""
