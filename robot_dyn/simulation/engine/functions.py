"""The functions of a state equation as machine code."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.program import Programs
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.store.keys import digest, sources_of_the_writer
from robot_dyn.foundations.convex import PASSES
from robot_dyn.simulation.dynamics.loop_state import Functions

STEP = "problem", "newton", "behind"  # programs of one function; the last is one by itself, too


class States(NamedTuple):
    """Times (k,), in [s], and states (k, m)."""

    t: np.ndarray
    y: np.ndarray


@final
@dataclass(frozen=True, eq=False)
class CompiledFunctions:
    """The functions of a state equation, as programs and machine code.

    Attributes:
        programs: rate, energy and sample, tick where there is one, and jacobian where a method needs it.
        runs: W.
        name: Of what moves, for messages.
        shared: As of `write_function`.
        changeable: Names of the parts whose code may be another at the next run, or do what a trace does not see.
        checked: States at which they were compared with the interpreted equation, by the loops that they ran in.
    """

    programs: Programs
    runs: int
    name: str
    shared: Mapping[int, int] = field(default_factory=dict)
    changeable: tuple[str, ...] = ()
    checked: dict[Any, States] = field(default_factory=dict, repr=False)

    @cached_property
    def _key(self) -> str:
        return digest([sources_of_the_writer(), str(self.runs), str(sorted(self.shared.items())), str(self.programs)])

    def is_kept(self) -> bool:
        """Whether its machine code is in the store."""
        store = default_store()
        return store is not None and store.load(self._key) is not None

    @cached_property
    def addresses(self) -> Functions:
        """The addresses of the functions, which are compiled unless they are in the store."""

        def write(module: Any, prefix: str) -> None:
            from robot_dyn.codegen.llvm.lock_step import write_function, write_step

            for name, program in self.programs.items():
                if name == "problem":
                    three: Any = tuple(self.programs[each] for each in STEP)
                    write_step(module, f"{prefix}step", three, self.runs, self.shared, PASSES)
                elif name != "newton":
                    shared = {} if name == "behind" else self.shared
                    write_function(module, f"{prefix}{name}", program, self.runs, shared)

        written = {*self.programs, *(["step"] if "problem" in self.programs else [])}
        known = [name for name in Functions._fields if name in written]
        about = f"the state equation of {self.name}"
        addresses = machine_code.addresses(known, self._key, write, default_store(), about)
        return Functions(**dict.fromkeys(Functions._fields, 0) | dict(zip(known, addresses, strict=True)))
