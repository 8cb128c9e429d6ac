"""A run as netCDF-3 with 64-bit offsets, by xarray and SciPy: `run.to_xarray()` with its units as attributes."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np

from robot_dyn.simulation.results.run_data import RunData
from robot_dyn.simulation.results.run_file import RunFileError

_LARGEST = 2**31 - 1  # netCDF-3 has no longer integers, and SciPy writes no larger variables in bytes


def write(run: RunData, _: object, stream: BinaryIO) -> None:
    """Write the Dataset of a run, or of a batch."""
    data = run.to_xarray()
    for name, x in data.data_vars.items():
        if x.dtype == np.int64:
            data[name] = x.astype(float if (np.abs(x) > _LARGEST).any() else np.int32)
    for name, x in data.variables.items():
        if x.nbytes > _LARGEST:
            size = f"{name} takes {x.nbytes / 2**30:.3g} GiB, more than the 2 GiB of netCDF-3"
            raise RunFileError(f"{size}; write .parquet, or a slice of the runs")
    data.to_netcdf(stream, engine="scipy", format="NETCDF3_64BIT")
