"""Files that are not tables of text: refused by kind, with the way to a CSV file, an MCAP log or a data frame."""

from __future__ import annotations

from pathlib import Path

from robot_dyn.foundations.errors import PlanError
from robot_dyn.foundations.files import FileKind, read_start

_FRAME = "pass the data frame of pandas.{}(path)"
_ARRAYS = "pass its arrays in a dict, read by {}(path)"
_KINDS = {  # by suffix, then by first bytes; of two kinds with the same first bytes the first is named
    FileKind("a ROS 2 bag in SQLite", ".db3", b"SQLite format 3\0"): "convert it: mcap convert LOG.db3 LOG.mcap",
    FileKind("a ROS 1 bag", ".bag", b"#ROSBAG V"): "convert it to a ROS 2 log by rosbags-convert --dst-storage mcap",
    FileKind("a spreadsheet", ".xlsx", b"PK\x03\x04"): f"save it as CSV, or {_FRAME.format('read_excel')}",
    FileKind("a spreadsheet", ".xls", b"\xd0\xcf\x11\xe0"): f"save it as CSV, or {_FRAME.format('read_excel')}",
    FileKind("a spreadsheet", ".ods"): f"save it as CSV, or {_FRAME.format('read_excel')}",
    FileKind("a MATLAB file", ".mat", b"MATLAB "): _ARRAYS.format("scipy.io.loadmat"),
    FileKind("an HDF5 file", ".h5", b"\x89HDF"): _ARRAYS.format("h5py.File"),
    FileKind("an HDF5 file", ".hdf5"): _ARRAYS.format("h5py.File"),
    FileKind("a Parquet file", ".parquet", b"PAR1"): _FRAME.format("read_parquet"),
    FileKind("a Feather file", ".feather", b"ARROW1"): _FRAME.format("read_feather"),
    FileKind("a file of NumPy", ".npz"): _ARRAYS.format("numpy.load"),
    FileKind("a file of NumPy", ".npy", b"\x93NUMPY"): "pass the array of numpy.load(path), with time=",
    FileKind("a pickle", ".pkl"): "save it as CSV; pickles run code when they are read",
    FileKind("compressed", ".gz", b"\x1f\x8b"): f"unpack it, or {_FRAME.format('read_csv')}",
    FileKind("compressed", ".zip"): f"unpack it, or {_FRAME.format('read_csv')}",
}


def refuse_other_files(path: str | Path, remedy: str) -> None:
    """Raise a PlanError if a file is of a known binary kind, by its suffix or its first bytes."""
    start, suffix = read_start(path, 16, PlanError, remedy), Path(path).suffix.lower()
    named = [kind for kind in _KINDS if kind.suffix == suffix]
    named += [kind for kind in _KINDS if kind.start and start.startswith(kind.start)]
    for kind in named[:1]:
        raise PlanError(f"{path}: is {kind.name} ({kind.suffix}), which is not supported; {_KINDS[kind]}")
