"""Values that hold arrays: these are read-only, in copies of the value as well."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

import numpy as np


class Value:
    """A value whose arrays, where they are read-only, stay so through `copy.deepcopy` and `pickle`."""

    def __getstate__(self) -> Any:
        state = dict(vars(self))
        return state, tuple(name for name, x in state.items() if _arrays(x) and not _writeable(x))

    def __setstate__(self, state: Any) -> None:
        values, frozen = state
        vars(self).update(values)
        for name in frozen:
            for array in _arrays(values[name]):
                array.setflags(write=False)


def read_only(value: Any) -> None:
    """Replace the arrays of a frozen dataclass, and of dictionaries in it, by read-only views; nothing is copied."""
    for field in fields(value):
        x = getattr(value, field.name)
        if isinstance(x, dict):
            object.__setattr__(value, field.name, {key: _view(entry) for key, entry in x.items()})
        elif isinstance(x, np.ndarray):
            object.__setattr__(value, field.name, _view(x))


def _view(x: Any) -> Any:
    if isinstance(x, np.ndarray):
        x = x.view()
        x.setflags(write=False)
    return x


def _arrays(x: Any) -> list[np.ndarray]:
    """An array, or those of a dictionary."""
    return [each for each in (x.values() if isinstance(x, dict) else (x,)) if isinstance(each, np.ndarray)]


def _writeable(x: Any) -> bool:
    return any(array.flags.writeable for array in _arrays(x))
