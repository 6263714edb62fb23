"""The arguments of the commands that export and measure time series."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import tyro

from icmj.cli.overrides import Shared


@dataclass(frozen=True)
class Export(Shared):
    """Export the signals of a log and, in a second file, its events for use in other tools.

    Units are in the header (CSV), in the metadata of each field (Parquet) or in a separate array (npz).

    Example: icmj export runs/out/three-link-0.9.mujoco.rrd --to csv --rate 100
    """

    log: tyro.conf.Positional[Path]
    """Log to read."""
    to: Literal["csv", "parquet", "npz"] | None = None
    """Format (default: the one that --out ends in, else csv)."""
    rate: float | None = None
    """Rate of evenly spaced rows [Hz] (default: the rows as recorded, which include every event)."""
    out: Path | None = None
    """File to write (default: beside the log, with its name). The file of events has ".events" added to its name."""


@dataclass(frozen=True)
class Measure(Shared):
    """Measure sway: RMS, speed, range, prediction ellipse, frequencies, stabilogram diffusion.

    In a log, the centre of pressure is measured if the body stands on a floor, else the outputs; in a table (CSV,
    Parquet, npz, OpenSim's mot and sto), all columns; in a C3D file, the centre of pressure of its force plates, else
    its points. Two columns with the same unit are also measured together, as the path of a point in a plane.

    Example: icmj measure sway.csv --columns ap ml --rate 100
    """

    file: tyro.conf.Positional[Path]
    """Log, or file of time series."""
    columns: tuple[str, ...] = ()
    """Columns to measure (default: see above)."""
    rate: float | None = None
    """Rate to resample to (default: 100 for a log), or the rate of a file without times [Hz]."""
    since: float | None = None
    """Time from which the series are measured [s] (default: all rows, those before 0 too)."""
    low_pass: float | None = None
    """Corner frequency of a low-pass filter applied before all measures [Hz]."""
    band: tuple[float, float] | None = None
    """Lowest and highest frequency of the spectral measures [Hz] (default: all frequencies)."""
    torque: str | None = None
    """Column of the ankle torque, from which the centre of pressure is computed."""
    weight: float | None = None
    """Vertical force on the foot [N], for --torque."""
    json: bool = False
    """Print JSON, in the units of the file, instead of a table."""
