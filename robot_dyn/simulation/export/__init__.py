"""Files of runs for other programs: tables (CSV, Parquet, netCDF) and MCAP logs."""
