"""A control law given as a function, τ = f(t, q, v)."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from inspect import signature
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import Stateless
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import ControlError


@final
@dataclass(frozen=True, eq=False)
class ControlLaw(Stateless):
    """A function (t, q, v) → τ as a continuous controller.

    An arm inside a function cannot be traced: make it an attribute of a `Stateless` controller.

    Attributes:
        function: Returns the torque of each joint, shape (n,), in [N m] or [N].
        joints: n.

    Raises:
        ControlError: If the function does not take three arguments.
    """

    function: Callable[[float, Array, Array], Any]
    joints: int

    def __post_init__(self) -> None:
        super().__post_init__()
        with suppress(ValueError):  # the arguments of some functions written in C are unknown
            known = signature(self.function)
            try:
                known.bind(0.0, None, None)
            except TypeError:
                raise ControlError(f"controller {self.name}{known}: give a function of (t, q, v)") from None

    @property
    def name(self) -> str:
        return getattr(self.function, "__name__", type(self.function).__name__)

    @property
    def term(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return f"{self.name}(t, q, v)"

    @property
    def n(self) -> int:
        return self.joints

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return np.asarray(self.function(t, q, v))
