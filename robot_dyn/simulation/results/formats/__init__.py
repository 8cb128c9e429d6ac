"""Formats of saved runs: run files (.npz), tables (CSV, Parquet, netCDF) and MCAP logs."""
