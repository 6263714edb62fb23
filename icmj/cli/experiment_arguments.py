"""The arguments of the command that carries out an experiment."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from icmj.cli.overrides import Shared


@dataclass(frozen=True)
class Experiment(Shared):
    """Carry out a standard experiment on simulated cases or on recordings; an interrupted one can be resumed.

    Example: icmj experiment intersection-point --out runs/out/intersection-point
    """

    experiment: tyro.conf.Positional[Path]
    """Experiment file, or name of a shipped experiment."""
    out: Path | None = None
    """Folder for trials, results and figure (default: runs/out/NAME). The same command resumes an interrupted
    experiment.
    """
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    recording: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")] = ()
    """Recording to analyse (CSV, Parquet, npz) instead of simulating the cases. Repeat the option for further
    trials of the same condition.
    """
    rate: float | None = None
    """Rate of a recording without times [Hz]."""
    allow_code: bool = False
    """Run Python code that the run files name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of a table."""
