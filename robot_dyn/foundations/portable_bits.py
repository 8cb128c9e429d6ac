"""The setting ROBOT_DYN_PORTABLE=1: machine code of this process has equal bits on every processor."""

from __future__ import annotations

import os
from functools import cache

VARIABLE = "ROBOT_DYN_PORTABLE"


@cache
def has_portable_bits() -> bool:
    """Return True if the machine code of this process is portable, see `codegen.llvm.target`.

    The variable is read once, so that all machine code and all reports of a process agree.
    """
    return os.environ.get(VARIABLE) == "1"
