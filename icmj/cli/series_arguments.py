"""The arguments of the commands that take time series out of the package, or into it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro


@dataclass(frozen=True)
class Export:
    """Write the time series of a log for other tools: its rows, and in a second file its events.

    Units are in the header (CSV), in the metadata of each field (Parquet) or in an array beside the others (npz).

    Example: icmj export runs/out/three-link-0.9.mujoco.rrd --to csv --rate 100
    """

    log: tyro.conf.Positional[Path]
    """Log."""
    to: Literal["csv", "parquet", "npz"] | None = None
    """Format; that of --out, or csv, by default."""
    rate: float | None = None
    """Rows per second [Hz], evenly spaced; the recorded rows, one at every event among them, by default."""
    out: Path | None = None
    """File; beside the log and named after it by default. Events go to the same name with ".events" in it."""


@dataclass(frozen=True)
class Measure:
    """Measure sway: RMS, speed, range, prediction ellipse, frequencies, stabilogram diffusion.

    Of a log that is the centre of pressure where the body stands on a floor, else the outputs; of a file (CSV, Parquet,
    npz) all columns. Two columns of one unit are taken as a point in a plane, too.

    Example: icmj measure sway.csv --columns ap ml --rate 100
    """

    file: tyro.conf.Positional[Path]
    """Log, or file of time series."""
    columns: tuple[str, ...] = ()
    """What to measure."""
    rate: float | None = None
    """Samples per second [Hz]: to take, 100 of a log by default; or that a file without times has."""
    since: float = 0.0
    """Leave out what is before [s]."""
    low_pass: float | None = None
    """Corner of a low-pass filter before all measures [Hz]."""
    band: tuple[float, float] | None = None
    """Frequencies are taken within [Hz]; all by default."""
    torque: str | None = None
    """Ankle torque, to take the centre of pressure from."""
    weight: float | None = None
    """Vertical force on the foot [N], with --torque."""
    json: bool = False
    """Print JSON, in the units of the file, instead of a table."""
