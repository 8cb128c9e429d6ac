"""Errors of exported equations: the largest one seen at random states, and a bound over all states within the limits.

Errors are divided by a scale of each entry, in which joints with other units or lighter links count alike:

    d_i = √(max M_ii),   s_i = d_i max_j (|τ_j| / d_j)
    M_ij: d_i d_j      C_ij: s_i / max |v_j|      N_i, τ_i: s_i of N or τ      a_i: max_j (|a_j| d_j) / d_i
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, final

import numpy as np
from flint import arb

import robot_dyn as rd
from robot_dyn.codegen import CompiledPlant, Kind, Program
from robot_dyn.foundations import MissingTimeError, OnFirstUse
from robot_dyn.tools.export.equations import Equations
from robot_dyn.tools.export.operations import evaluated

FASTEST = 3.0  # rad/s or m/s, of joints without a speed limit
_FARTHEST = {"prismatic": 1.0}  # m, of joints without position limits; π rad of others
MOST_ACCELERATION = 10.0  # rad/s² or m/s²
UNITS = {"float64": 2.0**-53, "float32": 2.0**-24}  # largest relative error of rounding


@dataclass(frozen=True, eq=False)
class States(ABC):
    """Random states, and the results of a reference there.

    Attributes:
        dtype: Precision of the states.
        count: Number of states.
        seed: Seed of the random numbers.
    """

    dtype: str
    count: int
    seed: int = field(default=0, kw_only=True)

    @cached_property
    @abstractmethod
    def inputs(self) -> Mapping[str, np.ndarray]:
        """Arguments by name, (count, size)."""

    @abstractmethod
    def results(self, name: str) -> np.ndarray:
        """Return a quantity by the reference, (count, …)."""

    @abstractmethod
    def scale(self, name: str) -> np.ndarray:
        """Return the scale of the entries of a quantity, in the shape of one result."""

    def largest_error(self, name: str, program: Program, arguments: Sequence[str]) -> float:
        """Return the largest error of a program at the states, divided by the scale."""
        results = self.results(name)
        ours = evaluated(program, [self.inputs[x] for x in arguments], self.dtype)
        return float(np.max(np.abs(ours.reshape(results.shape) - results) / self.scale(name)))


@final
@dataclass(frozen=True, eq=False)
class StatesOfArm(States):
    """Random states within the limits of an arm.

    Attributes:
        equations: The equations.
    """

    equations: Equations

    @cached_property
    def reference(self) -> rd.Robot | rd.Plant:
        """The robot, computed by Pinocchio, or the interpreted plant."""
        compiled = self.equations.compiled
        return compiled.interpreted if isinstance(compiled, CompiledPlant) else compiled.robot

    @cached_property
    def inputs(self) -> Mapping[str, np.ndarray]:
        """Arguments by name; torques are those of random accelerations."""
        robot, rng = self.equations.robot, np.random.default_rng(self.seed)
        state = {
            "t": rng.uniform(0, 10, (self.count, 1)),
            "q": rng.uniform(*limits(robot, "q"), (self.count, robot.n)),
            "v": rng.uniform(*limits(robot, "v"), (self.count, robot.n)),
            "a": rng.uniform(-1, 1, (self.count, robot.n)) * MOST_ACCELERATION,
        }
        state = {name: x.astype(self.dtype).astype(float) for name, x in state.items()}
        tau = self._asked("inverse_dynamics", state).astype(self.dtype).astype(float)
        p = np.tile(self.equations.p.astype(self.dtype).astype(float), (self.count, 1))
        return state | {"tau": tau, "u": tau, "p": p}

    def results(self, name: str) -> np.ndarray:
        return self._results[name]

    @cached_property
    def _results(self) -> OnFirstUse:
        return OnFirstUse(lambda name: self._asked(str(name), self.inputs))

    def _asked(self, name: str, state: Mapping[str, np.ndarray]) -> np.ndarray:
        arguments = [state[x] for x in self.equations.row(name).arguments if x != "t"]
        method: Any = getattr(self.reference, name)
        try:
            return method(*arguments)
        except MissingTimeError:
            return np.array([method(*row[1:], t=float(row[0][0])) for row in zip(state["t"], *arguments, strict=True)])

    @cached_property
    def _d(self) -> np.ndarray:
        d = np.sqrt(np.max(np.diagonal(self.results("M"), axis1=1, axis2=2), axis=0))
        return np.maximum(d, 1e-6 * d.max())  # of a joint without inertia

    def scale(self, name: str) -> np.ndarray:
        d, state = self._d, self.inputs
        if name == "M":
            return np.outer(d, d)
        if name == "forward_dynamics":
            return np.max(np.abs(self.results(name)) * d) / d
        torque = np.max(np.abs(state["tau"]) / d) * d
        if name == "N":  # may vanish, as for axes that are all vertical
            return np.maximum(np.max(np.abs(self.results(name)) / d) * d, 1e-6 * torque)
        return torque[:, None] / np.max(np.abs(state["v"]), axis=0) if name == "C" else torque


def bound(program: Program, boxes: Sequence[Sequence[arb]], unit: float) -> list[float] | None:
    """Return a bound of the rounding error of each result over boxes of inputs, or None without one.

    A value x + e in floats, with x in a ball and |e| ≤ e_x, obeys |e_z| ≤ (error of exact arithmetic) + u (|z| + that):
    u for +, −, · and constants, 2 u for a sine or cosine, whose error may be one unit in the last place. Nothing
    underflows.
    """
    values = [(x, arb(0)) for box in boxes for x in box]
    values += [(arb(x), unit * abs(arb(x))) for x in program.constants]
    table = dict(enumerate(values))
    for op in program.ops:
        (x, e), *rest = (table[k] for k in op.operands)
        if op.kind in (Kind.ADD, Kind.SUBTRACT):
            y, f = rest[0]
            results, rounds = [(x + y if op.kind is Kind.ADD else x - y, e + f)], 1
        elif op.kind in (Kind.MULTIPLY, Kind.SQUARE):
            y, f = rest[0] if rest else (x, e)
            results, rounds = [(x * y, _size(x) * f + _size(y) * e + e * f)], 1
        elif op.kind in (Kind.NEGATE, Kind.TWICE):
            results, rounds = [(-x, e) if op.kind is Kind.NEGATE else (x + x, e + e)], 0
        elif op.kind in (Kind.MINIMUM, Kind.MAXIMUM):
            (y, f), rounds = rest[0], 0
            results = [(x.min(y) if op.kind is Kind.MINIMUM else x.max(y), e.max(f))]
        elif op.kind is Kind.SINE_COSINE:
            results, rounds = [(z, e) for z in x.sin_cos()], 2
        else:
            return None
        for k, (z, g) in zip(op.results, results, strict=True):
            table[k] = z, (g + rounds * unit * (_size(z) + g)).abs_upper()
    return [float(table[k][1].abs_upper()) for k in program.outputs]


def box_of(equations: Equations, argument: str) -> list[arb]:
    """Return the balls of an argument: positions and speeds within `limits`, parameters at their values."""
    robot = equations.robot
    if argument == "p":
        return [arb(x) for x in equations.p.tolist()]
    lower, upper = (x.tolist() for x in limits(robot, argument))
    return [arb((a + b) / 2, (b - a) / 2 * (1 + 1e-12)) for a, b in zip(lower, upper, strict=True)]


def limits(robot: rd.Robot, argument: str) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper limits of q or v, (n,); without limits ±π rad or ±1 m, and 3 rad/s or m/s."""
    if argument == "q":
        far = np.array([_FARTHEST.get(kind, np.pi) for kind in robot.joint_types])
        lower, upper = robot.lower, robot.upper
        return np.where(np.isfinite(lower), lower, -far), np.where(np.isfinite(upper), upper, far)
    speed = robot.velocity_limit
    speed = np.where(np.isfinite(speed) & (speed > 0), speed, FASTEST)
    return -speed, speed


def _size(x: arb) -> arb:
    return x.abs_upper()
