"""Runs as files of other programs: tables (CSV, Parquet, netCDF) and MCAP logs."""
