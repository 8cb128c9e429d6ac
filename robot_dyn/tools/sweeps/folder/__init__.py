"""The folder of a sweep: what is done has a file, what has none is left to do.

folder   which chunk is which Parquet file, what is missing
rows     columns of runs; those that every sweep has
samples  samples of runs as Zarr
files    writes that are whole or not there; what dead writers left
"""
