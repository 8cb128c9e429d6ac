"""What algorithms cost on an arm, by the kernels of `compiled`: for many states side by side on one thread.

full C(q, v) against C(q, v) v;   M = L D Lᵀ against articulated bodies;   C v in forward dynamics, on and off;
∂a/∂(q, v, τ) exact against central differences, 6 n evaluations;   float64 against float32
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from time import process_time
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version
from robot_dyn.codegen.kernel import Kernel
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.program import Program
from robot_dyn.codegen.store.cache import default_store
from robot_dyn.codegen.trace.from_casadi import program_of
from robot_dyn.codegen.trace.trace import Trace
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.model.right_angles import completed
from robot_dyn.model.robot import Robot
from robot_dyn.report.timing import seconds

STATES = 1024  # side by side
PER_STATE = f"state, {STATES} side by side"
_LEAST_S = 2e-3  # of a loop that is timed
_MOST_TIMED = 30_000  # instructions, some seconds of compiling; longer programs are counted alone
_FORWARD, _DERIVATIVES = "forward_dynamics", "forward_dynamics_derivatives"


@final
@dataclass(frozen=True)
class QueryCost:
    """The queries of a robot.

    Attributes:
        given: The robot, as its file has it.
    """

    given: Robot

    @cached_property
    def _trace(self) -> Trace:
        return Trace(completed(self.given)[0])

    @cached_property
    def _forward(self) -> dict[str, ca.Function]:
        """Forward dynamics by each formulation."""
        return self._trace.formulations(_FORWARD)

    @cached_property
    def _best(self) -> tuple[ca.Function, Program]:
        """That of the fewest instructions, and its program."""
        programs = [(each, program_of(each)) for each in self._forward.values()]
        return min(programs, key=lambda each: len(each[1]))

    def pairs(self) -> Iterator[tuple[str, Callable[[], ABComparison]]]:
        """What is compared, by name, each made when it is called; QueryError if it cannot be on this arm."""
        for group, what, ways in (
            ("algorithms", "Coriolis matrix", self._coriolis_matrix),
            ("algorithms", "forward dynamics", self._forward_dynamics),
            ("algorithms", "C(q, v) v in forward dynamics", self._coriolis_torque),
            ("algorithms", "derivatives of forward dynamics", self._derivatives),
            ("machine code", "right angles of the file", self._right_angles),
            ("machine code", "numbers of forward dynamics", self._floats),
        ):
            yield what, lambda group=group, what=what, ways=ways: ABComparison(group, what, PER_STATE, *ways())

    def _coriolis_matrix(self) -> tuple[Version, Version]:
        full, alone = (self._quantity(name) for name in ("C", "coriolis_torque"))
        return self._way("full C", full), self._way("C v alone", alone)

    def _forward_dynamics(self) -> tuple[Version, Version]:
        for name, why in _WITHOUT.items():
            if name not in self._forward:
                raise QueryError(why)
        recursion, articulated = (program_of(self._forward[name]) for name in _WITHOUT)
        return self._way("M, Cholesky", recursion), self._way("articulated body", articulated)

    @property
    def at_rest(self) -> ca.Function:
        """Forward dynamics of (q, v, τ) without C(q, v) v: that of v = 0."""
        q, v, tau = (self._trace.symbols[name][0] for name in ("q", "v", "tau"))
        function, zero = self._best[0], ca.DM.zeros(self.given.n)
        return ca.Function("f", [q, v, tau], [ca.cse(ca.densify(function(q, zero, tau)))])

    def _coriolis_torque(self) -> tuple[Version, Version]:
        return self._way("on", self._best[1]), self._way("off", program_of(self.at_rest))

    def _derivatives(self) -> tuple[Version, Version]:
        n, evaluations = self.given.n, 6 * self.given.n
        once = self._way(f"differences, {evaluations} evaluations", self._best[1])
        run: Any = once.run
        count = evaluations * once.instructions
        differences = replace(once, instructions=count, run=lambda: evaluations * run())
        return differences, self._way("exact", self._quantity(_DERIVATIVES), (3, n, n))

    def _right_angles(self) -> tuple[Version, Version]:
        if not completed(self.given)[1]:
            raise QueryError("the file states none with too few digits, so nothing is written out")
        stated = program_of(Trace(self.given).quantity(_FORWARD).function)
        return self._way("as stated", stated), self._way("written out", self._best[1])

    def _floats(self) -> tuple[Version, Version]:
        return self._way("float64", self._best[1]), self._way("float32", self._best[1], dtype="float32")

    def _quantity(self, name: str) -> Program:
        return program_of(self._trace.quantity(name).function)

    def _way(self, name: str, program: Program, shape: tuple[int, ...] = (), dtype: str = "float64") -> Version:
        """The time per state of a program."""
        outputs = shape or (len(program.outputs),)
        kernel = Kernel(program, outputs, dtype, store=default_store(), about=f"{self.given.name}: {name}, {dtype}")
        rng = np.random.default_rng(8)
        inputs = [rng.normal(size=(STATES, length)).astype(dtype) for length in program.inputs]
        y = np.empty((STATES, len(program.outputs)), dtype)

        def run() -> float:
            if len(program) > _MOST_TIMED:
                raise RobotDynError(f"{len(program)} instructions, more than {_MOST_TIMED}, take long to compile")
            if kernel.many(inputs, y) is not Status.FINE:
                raise RobotDynError("its results at random states are doubtful")
            return seconds(lambda: kernel.many(inputs, y), _LEAST_S, process_time) / STATES

        return Version(name, len(program), run)


_WITHOUT = {  # formulations of forward dynamics, with why an arm has none
    "recursion": "more than 8 joints stand one after the other: to solve with M outnumbers articulated bodies, and is"
    " not traced",
    "articulated body": "joints are coupled: articulated bodies take those that are free, so M is solved with",
}
