"""Cost of alternative algorithms on one arm, by the kernels of `compiled`: many states together on one thread.

full C(q, v) against C(q, v) v;   M = L D Lᵀ against articulated bodies;   C v in forward dynamics, on and off;
∂a/∂(q, v, τ) exact against central differences, 6 n evaluations;   float64 against float32
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from time import process_time
from typing import final

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
from robot_dyn.model.right_angles import with_exact_right_angles
from robot_dyn.model.robot import Robot
from robot_dyn.report.timing import seconds

STATES = 1024  # side by side
PER_STATE = f"state, {STATES} side by side"
_MIN_LOOP_S = 2e-3  # duration of a timed loop
_MAX_TIMED = 30_000  # instructions, some seconds of compiling; longer programs are counted but not timed
_FORWARD, _DERIVATIVES = "forward_dynamics", "forward_dynamics_derivatives"


@final
@dataclass(frozen=True)
class QueryCost:
    """Comparisons of algorithms for the queries of a robot.

    Attributes:
        robot: The robot, with the right angles stated in its file.
    """

    robot: Robot

    @cached_property
    def _trace(self) -> Trace:
        return Trace(with_exact_right_angles(self.robot)[0])

    @cached_property
    def _forward(self) -> dict[str, ca.Function]:
        """Forward dynamics by formulation."""
        return self._trace.formulations(_FORWARD)

    @cached_property
    def _best(self) -> tuple[ca.Function, Program]:
        """Forward dynamics with the fewest instructions, and its program."""
        programs = [(function, program_of(function)) for function in self._forward.values()]
        return min(programs, key=lambda pair: len(pair[1]))

    def pairs(self) -> Iterator[tuple[str, Callable[[], ABComparison]]]:
        """Yield the names of the comparisons, with functions that compute them.

        Such a function raises QueryError if the comparison is not possible on this arm.
        """
        for group, name, versions in (
            ("algorithms", "Coriolis matrix", self._coriolis_matrix),
            ("algorithms", "forward dynamics", self._forward_dynamics),
            ("algorithms", "C(q, v) v in forward dynamics", self._coriolis_torque),
            ("algorithms", "derivatives of forward dynamics", self._derivatives),
            ("machine code", "right angles of the file", self._right_angles),
            ("machine code", "numbers of forward dynamics", self._floats),
        ):
            yield name, lambda group=group, name=name, make=versions: ABComparison(group, name, PER_STATE, *make())

    def _coriolis_matrix(self) -> tuple[Version, Version]:
        full, product = (self._quantity(name) for name in ("C", "coriolis_torque"))
        return self._version("full C", full), self._version("C v alone", product)

    def _forward_dynamics(self) -> tuple[Version, Version]:
        for name, reason in _REASONS.items():
            if name not in self._forward:
                raise QueryError(reason)
        recursion, articulated = (program_of(self._forward[name]) for name in _REASONS)
        return self._version("M, Cholesky", recursion), self._version("articulated body", articulated)

    @property
    def at_rest(self) -> ca.Function:
        """Forward dynamics of (q, v, τ) without C(q, v) v, evaluated at v = 0."""
        q, v, tau = (self._trace.symbols[name][0] for name in ("q", "v", "tau"))
        function, zero = self._best[0], ca.DM.zeros(self.robot.n)
        return ca.Function("f", [q, v, tau], [ca.cse(ca.densify(function(q, zero, tau)))])

    def _coriolis_torque(self) -> tuple[Version, Version]:
        return self._version("on", self._best[1]), self._version("off", program_of(self.at_rest))

    def _derivatives(self) -> tuple[Version, Version]:
        n, evaluations = self.robot.n, 6 * self.robot.n
        once = self._version(f"differences, {evaluations} evaluations", self._best[1])
        run, count = once.run, evaluations * once.instructions
        differences = replace(once, instructions=count, run=lambda: evaluations * run() if run else 0.0)
        return differences, self._version("exact", self._quantity(_DERIVATIVES), (3, n, n))

    def _right_angles(self) -> tuple[Version, Version]:
        if not with_exact_right_angles(self.robot)[1]:
            raise QueryError("the file states all right angles to full precision")
        stated = program_of(Trace(self.robot).quantity(_FORWARD).function)
        return self._version("as stated", stated), self._version("exact", self._best[1])

    def _floats(self) -> tuple[Version, Version]:
        return self._version("float64", self._best[1]), self._version("float32", self._best[1], dtype="float32")

    def _quantity(self, name: str) -> Program:
        return program_of(self._trace.quantity(name).function)

    def _version(self, name: str, program: Program, shape: tuple[int, ...] = (), dtype: str = "float64") -> Version:
        """Return a version that times a program per state."""
        outputs = shape or (len(program.outputs),)
        kernel = Kernel(program, outputs, dtype, store=default_store(), about=f"{self.robot.name}: {name}, {dtype}")
        rng = np.random.default_rng(8)
        inputs = [rng.normal(size=(STATES, length)).astype(dtype) for length in program.inputs]
        y = np.empty((STATES, len(program.outputs)), dtype)

        def run() -> float:
            if len(program) > _MAX_TIMED:
                raise RobotDynError(f"{len(program)} instructions, more than {_MAX_TIMED}, take too long to compile")
            if kernel.many(inputs, y) is not Status.FINE:
                raise RobotDynError("it has no reliable result at some random state")
            return seconds(lambda: kernel.many(inputs, y), _MIN_LOOP_S, process_time) / STATES

        return Version(name, len(program), run)


_REASONS = {  # formulations of forward dynamics, each with the reason why an arm lacks it
    "recursion": "with more than 8 joints in series, solving with M takes more instructions than articulated bodies,"
    " and is not traced",
    "articulated body": "joints are coupled: articulated bodies support only free joints, so M is factorised",
}
