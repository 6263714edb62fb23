"""The arguments of the command that fits families of controllers to recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icmj.cli.overrides import Shared


@dataclass(frozen=True)
class Fit(Shared):
    """Fit families of controllers to recordings of standing people (exploratory): parameters, reliability, comparison.

    Needs pip install 'icmj[fit]'. Each family is simulated, and its network trained, only once for all people.

    Example: icmj fit anna-1.csv anna-2.csv anna-3.csv --model event --model switching --out runs/out/anna
    """

    recordings: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Recordings of one person (CSV, Parquet, npz, C3D), each of one trial or several."""
    model: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FAMILY")] = ()
    """Family file, or name of a shipped family. May be repeated; the families are then compared, which depends
    on the noise that they assume."""
    table: Path | None = None
    """CSV table that lists the recordings of several people, instead of RECORDINGS (required columns: file and person;
    optional columns: column, group and condition); or BDSinfo.txt of the public data set (Santos and Duarte 2016),
    beside its trials."""
    columns: tuple[str, ...] = ()
    """Columns of the recordings that hold the front-to-back centre of pressure, one column for each trial."""
    unit: Literal["m", "cm", "mm"] | None = None
    """Unit of recordings that do not state one."""
    rate: float | None = None
    """Rate of recordings without times [Hz]."""
    hold_out: int = 0
    """Number of trials of each person, counted from the last, that are predicted instead of fitted."""
    out: Path = Path("runs/out/fit")
    """Folder for posteriors (netCDF, for ArviZ), tables, figures and page. The same command resumes a fit."""
    trained: Path = Path("runs/out/families")
    """Folder for simulated and trained families, which are reused for all people."""
    simulations: int = 6000
    """Number of draws from the prior of each family that are simulated to train its network."""
    draws: int = 2000
    """Number of draws from each posterior."""
    seed: int = 0
    """Seed of all random numbers."""
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers run the simulations instead of local processes."""
    allow_code: bool = False
    """Run Python code that the run files of families name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of tables."""
