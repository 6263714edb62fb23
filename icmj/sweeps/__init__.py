"""One case at very many points, in processes or on a cluster, written to a resumable folder of Parquet files."""
