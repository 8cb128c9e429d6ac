"""The folder of a sweep: what is done has a file, what has none is left to do.

folder      which chunk is which file, what is missing
chunk_file  rows and a footer as .npz or Parquet
rows        what is kept of runs
samples     samples of runs as Zarr
files       writes that are whole or not there; what dead writers left
"""
