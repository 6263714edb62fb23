"""The arguments of the command that fits families of controllers to recordings."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from icmj.cli.overrides import Shared


@dataclass(frozen=True)
class Fit(Shared):
    """Fit families of controllers to recordings of standing people: posteriors, how far to trust them, which family.

    Needs pip install 'icmj[fit]'. A family is simulated and trained once, for all people.

    Example: icmj fit anna-1.csv anna-2.csv anna-3.csv --model event --model switching --out runs/out/anna
    """

    recordings: tyro.conf.Positional[tuple[Path, ...]] = ()
    """Recordings of one person (CSV, Parquet, npz, C3D), a trial or several each."""
    model: Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], tyro.conf.arg(metavar="FAMILY")] = ()
    """Family file, or name of a shipped family. May be repeated: then the families' probabilities are told, too."""
    table: Path | None = None
    """CSV table of people instead of recordings: columns file, person, and if wanted column, group, condition; or
    BDSinfo.txt of the public data set (Santos and Duarte 2016), beside its trials."""
    columns: tuple[str, ...] = ()
    """Columns of the recordings with the front-to-back centre of pressure, one a trial."""
    unit: Literal["m", "cm", "mm"] | None = None
    """Unit of recordings that state none."""
    rate: float | None = None
    """Rate of recordings without times [Hz]."""
    hold_out: int = 0
    """How many of the last trials of each person are not fitted, but compared with what the fit predicts."""
    out: Path = Path("runs/out/fit")
    """Folder for posteriors (netCDF, for ArviZ), tables, figures and page. The same command resumes."""
    trained: Path = Path("runs/out/families")
    """Folder of simulated and trained families, which serve for all people."""
    simulations: int = 6000
    """Draws of each family's prior that are simulated and trained on."""
    draws: int = 2000
    """Draws from each posterior."""
    seed: int = 0
    """Of everything random."""
    jobs: int | None = None
    """Number of processes (default: one per core)."""
    dask: str | None = None
    """Address of a Dask scheduler, whose workers simulate instead of local processes."""
    allow_code: bool = False
    """Run Python code that the run files of families name as module:name. Read the code first."""
    json: bool = False
    """Print JSON instead of tables."""
