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
