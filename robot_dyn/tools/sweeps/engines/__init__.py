"""Engines: they fill the folder, and whether it is full is asked of the folder alone.

threads  of this process
cluster  workers of Dask.distributed
share    the chunks of one job of an array
"""
