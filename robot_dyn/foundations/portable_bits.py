"""The setting ROBOT_DYN_PORTABLE=1: machine code of this process has equal bits on every processor."""

from __future__ import annotations

import os

VARIABLE = "ROBOT_DYN_PORTABLE"


def has_portable_bits() -> bool:
    """Return True if the machine code of this process is portable, see `codegen.llvm.target`."""
    return os.environ.get(VARIABLE) == "1"
