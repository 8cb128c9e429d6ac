"""Runs as files of other programs: CSV, Parquet, netCDF and MCAP, one format a file."""
