"""Modules of a notebook's cell: their source can be read, and run again after an edit."""

from __future__ import annotations

import linecache
import sys
from types import ModuleType
from typing import Any


def cell(text: str, **known: Any) -> Any:
    """Return the module of a cell's text, in which names are known."""
    file = f"<cell {hash(text)}>"
    linecache.cache[file] = (len(text), None, text.splitlines(keepends=True), file)
    module = ModuleType("a_notebook")
    vars(module).update(known)
    sys.modules["a_notebook"] = module  # dataclasses look there
    exec(compile(text, file, "exec", dont_inherit=True), module.__dict__)
    return module
