"""One case at very many points: in processes or on a cluster, into a folder of Parquet files, whatever happens."""
