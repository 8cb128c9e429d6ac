"""The program of a march: its text as machine code, from the store or compiled.

march(work, lanes, timetable…, records…, now, clock, stop) → Ended
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.compiled.emit import emit
from robot_dyn.compiled.overload import Store, compiled, digest
from robot_dyn.compiled.source import FASTMATH, Source
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.machine.march_text import MarchText
from robot_dyn.simulation.machine.places import ARGUMENTS, Places
from robot_dyn.simulation.machine.stages import kept, numbers
from robot_dyn.simulation.machine.traced import Equations

_OPTIONS: dict[str, Any] = {"fastmath": FASTMATH, "error_model": "numpy", "nogil": True}


@final
@dataclass(frozen=True, eq=False)
class Program:
    """The march of a motion by a method.

    Attributes:
        equations: The motion in symbols.
        method: A method that `steps_whole`; None for the rate alone.
        lanes: Runs side by side; 1 for one that Python follows.
        n: Number of joints.
        memory: Number of states of the controller.
        name: What it is, for people.
        store: Where compiled code is kept, or None.
    """

    equations: Equations
    method: Integrator | None
    lanes: int
    n: int
    memory: int
    name: str = ""
    store: Store | None = None

    @cached_property
    def places(self) -> Places:
        """Where rows stand in `work`."""
        _, m, _, held, free = self.equations.sizes
        return Places(
            self.lanes, m, held, free, self.equations.rate.numel_out(0), kept(self.method) if self.method else 0
        )

    @cached_property
    def sources(self) -> dict[str, Source]:
        """Straight-line code of rate, energy, tick and actuation."""
        made = {name: getattr(self.equations, name) for name in ("rate", "energy", "tick", "actuation")}
        return {name: emit(function) for name, function in made.items() if function is not None}

    @cached_property
    def text(self) -> MarchText:
        """What is compiled."""
        return MarchText(self.sources, self.places, self.method, self.n, self.memory)

    @property
    def instructions(self) -> int:
        """Operations in all."""
        return sum(source.instructions for source in self.sources.values())

    @property
    def actuations(self) -> int:
        """Rows of what is recorded beside the state: u, or u and v."""
        return self.sources["actuation"].outputs if "actuation" in self.sources else 0

    @cached_property
    def march(self) -> Callable[..., int]:
        """The machine code; see the module."""
        return compiled(self._fresh, self._types, self.store, self._identity, "the march of a run")

    @property
    def known(self) -> bool:
        """Whether the machine code is in the store, or here already."""
        from numba.core import types

        if "march" in vars(self):
            return True
        key = digest([str(types.int64(*self._types)), *self._identity])
        return self.store is not None and self.store.load(key) is not None

    @cached_property
    def rate(self) -> Callable[..., int]:
        """The rate by itself: (t, work, p, y), of the state in x of `work`."""
        return self._alone("rate")

    @cached_property
    def energy(self) -> Callable[..., int]:
        """The energies by themselves: (t, work, p, y), of the state in y of `work`."""
        return self._alone("energy")

    def _alone(self, name: str) -> Callable[..., int]:
        from numba.core import types

        array: Any = types.Array(types.float64, 1, "C")
        number: Any = types.float64
        constants = repr(self.sources[name].constants)
        return compiled(
            lambda: self._function(name), [number, array, array, array], self.store,
            [self.text.function(name), constants], f"the {name} of a run",
        )  # fmt: skip

    @cached_property
    def _types(self) -> list[Any]:
        from numba.core import types

        axes = {"lanes": 2, "pieces": 2, "at_ticks": 2, "given": 2, "out_y": 3, "out_u": 3, "out_e": 3}
        axes |= {"out_step": 2, "out_shared": 2, "columns": 2}
        whole = {"alive", "counts", "ticks", "which", "out_step", "now", "stop"}
        return [
            types.Array(types.int64 if name in whole else types.float64, axes.get(name, 1), "C") for name in ARGUMENTS
        ]

    @cached_property
    def _identity(self) -> list[str]:
        constants = [repr(source.constants) for source in self.sources.values()]
        texts = [self.text.march, *(self.text.function(name) for name in self.sources if name != "rate")]
        return [*texts, *constants, str(self._nodes), str(self.n)]

    @property
    def _nodes(self) -> np.ndarray:
        tableau = self.method is not None and hasattr(self.method, "tableau")
        return np.array(numbers(self.method).c if tableau and self.method else [0.0])

    def _fresh(self) -> Any:
        import numba as nb

        namespace = self.sources["rate"].namespace("float64") | {
            "np": np, "nodes": self._nodes, "infinity": np.inf, "epsilon": float(np.finfo(float).eps), "n": self.n,
        }  # fmt: skip
        namespace |= {name: self._function(name) for name in self.sources if name != "rate"}
        exec(compile(self.text.march, "<robot_dyn march>", "exec"), namespace)
        return nb.njit(**_OPTIONS)(namespace["march"])

    def _function(self, name: str) -> Any:
        import numba as nb

        namespace = self.sources[name].namespace("float64")
        exec(compile(self.text.function(name), f"<robot_dyn {name}>", "exec"), namespace)
        return nb.njit(**_OPTIONS)(namespace[name])
