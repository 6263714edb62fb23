"""Time series with names and units: even times, and files of them (CSV, Parquet, npz). Knows nothing of control."""
