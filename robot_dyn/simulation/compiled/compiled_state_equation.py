"""The state equation of a setup as machine code, compared with the interpreted one before use.

|y' − y'_interpreted| ≤ 1e-13 · cond(M) · scale   at states of the run or at random ones, or it is refused
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.codegen.loops.call import MachineFunction
from robot_dyn.codegen.parameters import CONTROLLER, ROBOT, Parameter, Part, joined, parameters
from robot_dyn.coefficients import value_at
from robot_dyn.control.controller import Controller
from robot_dyn.effects.effect import Effect
from robot_dyn.errors import RobotDynError, because
from robot_dyn.simulation.compiled.checked_states import States, random_states, some, states_of
from robot_dyn.simulation.compiled.functions import STEP, Equations
from robot_dyn.simulation.compiled.jacobian_check import DIFFERENCES, by_differences
from robot_dyn.simulation.dynamics.bodies import bodies
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.moreau_jean import stepped
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.run.state_functions import sample
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

_LANES = 4  # runs in lock step that are compared
_AGREES = 1e-13
_LENGTH = 1e-3  # [s], of a step that is compared
_FUNCTION = ctypes.CFUNCTYPE(None, ctypes.c_double, *[ctypes.c_void_p] * 4)


class MachineError(RobotDynError):
    """Machine code that does not agree with the interpreted equations; nothing of it is used."""


@final
@dataclass(frozen=True, eq=False)
class CompiledStateEquation:
    """A state equation as machine code.

    Attributes:
        equation: The interpreted state equation: that of the setup, with right angles written out in full.
        equations: Its machine code.
        known: Its parameters, with the values of the setup.
        loop: The time loop as machine code; None if steps are made in Python.
        swept: Names of the parameters that differ from run to run.
        refused: Why steps are made in Python, of a method that might have them as machine code.
    """

    equation: StateEquation
    equations: Equations
    known: tuple[Parameter, ...]
    loop: MachineFunction | None

    swept: tuple[str, ...] = ()
    refused: str = ""

    @cached_property
    def parameters(self) -> np.ndarray:
        """The values of the parameters, one row after the other."""
        return joined(self.known)

    def advance(self) -> Callable[..., int] | None:
        """The loop for one run, which keeps the addresses of its arrays."""
        return None if self.loop is None else self.loop.calls()

    def with_parts(self, effects: Sequence[Effect], controller: Controller | None, dynamics: Any = None) -> np.ndarray:
        """The values of the parameters where effects and controller have other coefficients, and bodies other numbers.

        Args:
            effects: As of the plant.
            controller: As of the equation.
            dynamics: A robot that carries something else; unless given, the same.
        """
        of: dict[Part, Any] = {("effect", i): effect for i, effect in enumerate(effects)} | {CONTROLLER: controller}
        known = [
            replace(each, value=np.broadcast_to(value_at(of[each.part], each.key), each.value.shape))
            if each.part in of and value_at(of[each.part], each.key) is not None  # no mode is chosen yet
            else each
            for each in self.known
        ]
        if dynamics is not None:
            bodies = {each.key: each.value for each in parameters(dynamics, (), None, self.swept)}
            known = [replace(each, value=bodies[each.key]) if each.part == ROBOT else each for each in known]
        return joined(known)

    def of(self, equation: StateEquation) -> np.ndarray:
        """The values of the parameters of a state equation with other numbers."""
        plant = equation.plant
        changes = bool(plant.equation_of_motion.payloads)
        return self.with_parts(plant.effects, equation.controller, plant.dynamics if changes else None)

    def run_parameters(self, swept: Mapping[str, np.ndarray]) -> np.ndarray:
        """The numbers of W runs, (O, W): what is held, then row by row what is swept, (W, size) each, then the others.

        A single run has all of them row by row.
        """
        held, W = self.equation.plant.dynamics.n * self.equation.sampled, self.equations.runs
        if W == 1:
            return np.concatenate([np.zeros(held), self.parameters])[:, None]
        shared = [each for each in self.known if each.name not in swept]
        names = [each.name for each in self.known if each.name in swept]
        rows = np.vstack([np.zeros((held, W)), *(swept[name].T for name in names)])
        block = np.zeros((-(-sum(each.size for each in shared) // W), W))
        block.ravel()[: sum(each.size for each in shared)] = joined(shared)
        return np.vstack([rows, block])

    @cached_property
    def in_python(self) -> Functions:
        """The functions as Python calls them."""
        return Functions(*(_callable(address) if address else 0 for address in self.equations.functions))

    def is_kept(self) -> bool:
        """Whether its machine code is in this process or in the store, with its loop."""
        if self.loop in self.equations.checked:
            return True
        kept = bool(self.equations.checked) or self.equations.is_kept()
        return kept and (self.loop is None or self.loop.is_kept())

    def check(self, setup: Setup) -> None:
        """Hold the functions to the interpreted equations.

        Once is enough, at random states, where the version of this library tells the code of all parts. Any other part
        is compared at states of the first second of its run, and at some of these before each later run.

        Raises:
            MachineError: If they differ by more than rounding.
        """
        known = next(iter(self.equations.checked.values()), None)
        if known is None:
            known = states_of(setup) if self.equations.changeable else random_states(setup, self.equation.size)
            self._compare(setup, known)
        elif self.equations.changeable:
            self._compare(setup, some(known))
        self.equations.checked[self.loop] = known

    def _compare(self, setup: Setup, states: States) -> None:
        rng, n, m = np.random.default_rng(20), self.equation.plant.dynamics.n, self.equation.size
        W = self.equations.runs
        table, held = segment_table(setup), n * self.equation.sampled
        made = {name: np.empty((self.equations.programs.results(name), W)) for name in self.equations.programs}
        swept = {each.name: np.tile(each.value.ravel(), (W, 1)) for each in self.known if each.name in self.swept}
        run_parameters = self.run_parameters(swept)
        for i, at in enumerate(states.t.tolist()):
            p = table.parameters[int(np.searchsorted(table.starts[:-1], at, side="right")) - 1]
            t, y = min(max(at, p[0]), p[1]), np.ascontiguousarray(states.y[(i + np.arange(W)) % len(states.y)].T)
            run_parameters[:held] = rng.normal(size=(held, W))
            for name, out in made.items():
                if name not in STEP:
                    getattr(self.in_python, name)(t, y, p, run_parameters, out)
            try:
                for lane in range(min(W, _LANES)):
                    self._compare_lane(t, y, p, run_parameters, made, lane)
            except RobotDynError:
                raise
            except Exception as error:  # of changeable code
                parts = " or ".join(self.equations.changeable)
                raise MachineError(f"{parts} raises at t = {round(t, 9):g} s ({because(error)})") from error
            if "jacobian" in made:
                J = made["jacobian"][:, 0].reshape(m + 1, m)
                worst = by_differences(self.equation, t, y[:, 0], run_parameters[:n, 0] if held else None, p, J)
                if not worst <= 1:
                    raise self._differs("Jacobian", worst * DIFFERENCES, DIFFERENCES, t)

    def _compare_lane(
        self,
        t: float,
        y: np.ndarray,
        p: np.ndarray,
        run_parameters: np.ndarray,
        made: Mapping[str, np.ndarray],
        lane: int,
    ) -> None:
        """What the functions made of one run, beside what the equation makes of it."""
        n = self.equation.plant.dynamics.n
        ours, held = (
            {name: out[:, lane] for name, out in made.items()},
            run_parameters[:n, lane] if self.equation.sampled else None,
        )
        pairs = [*self._pairs(t, y[:, lane], held, ours)]
        if "problem" in made and not lane:
            pairs += self._of_step(t, y, p, run_parameters, min(self.equations.runs, _LANES))
        allowed = _AGREES * max(1.0, float(np.linalg.cond(self.equation.plant.M(y[:n, lane]))))
        worst = max(_difference(mine, theirs, y[:, lane]) for mine, theirs in pairs)
        if not worst <= allowed:
            raise self._differs("state equation", worst, allowed, t)

    def _of_step(
        self, t: float, y: np.ndarray, p: np.ndarray, run_parameters: np.ndarray, lanes: int
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """y⁺, v⁺ and its places by a step of time stepping, run by run, beside what the equation gives."""
        n, m, W = self.equation.plant.dynamics.n, self.equation.size, y.shape[1]
        x = np.vstack([y, np.full((1, W), _LENGTH), np.zeros((n, W))])
        out = np.empty((m + 2 * n + 1 + self.equations.programs.results("problem"), W))
        self.in_python.step(t, x, p, run_parameters, out)
        for lane in range(lanes):
            theirs = stepped(self.equation, t, x[:, lane], run_parameters[:n, lane] if self.equation.sampled else None)
            yield out[:m, lane], theirs[:m]
            yield out[m : m + 2 * n, lane], theirs[m : m + 2 * n]

    def _differs(self, what: str, worst: float, allowed: float, t: float) -> MachineError:
        of, remedy = f"of {self.equations.name}", "take engine='interpreted', and report it"
        if parts := self.equations.changeable:
            of = f"with {' or '.join(parts)}"
            remedy = (
                "methods must be functions of their arguments and of what their part declares; take"
                " engine='interpreted', or make a part anew that was changed after a run"
            )
        return MachineError(
            f"the compiled {what} {of} differs from the interpreted one by {worst:.1e} of its size at"
            f" t = {round(t, 9):g} s, {allowed:.1e} allowed: {remedy}"
        )

    def _pairs(
        self, t: float, y: np.ndarray, held: np.ndarray | None, ours: dict[str, np.ndarray]
    ) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """What the functions gave, quantity by quantity, beside what the equation gives."""
        n, m = self.equation.plant.dynamics.n, self.equation.size
        theirs = np.empty(m + n + 2)
        sample(self.equation, t, y, held, theirs)
        rate, u, energy = np.split(theirs, [m, m + n])
        if "rate" in ours:
            yield ours["rate"][:m], rate
        yield ours["energy"], energy
        if "rate" in ours and self.equations.runs == 1:
            yield ours["rate"][m:], u
        if "actuation" in ours:
            yield ours["actuation"], u
        if self.equations.runs == 1 and "rate" in ours:
            yield from zip(np.split(ours["sample"], [m, m + n]), (rate, u, energy), strict=True)
        if "events" in ours:
            q, v, z, _ = self.equation.state(y)
            demands = self.equation.demands(t, q, v, z, held, self.equation.limited)
            yield ours["events"], np.array([*np.ravel(demands), *self.equation.switching(t, q, v)], dtype=float)
        if "bodies" in ours:
            made = ours["bodies"], bodies(self.equation, t, y, held)
            yield from zip(*(np.split(each, [n * n]) for each in made), strict=True)
        if "tick" in ours:
            after, command = self.equation.tick(t, y)
            yield ours["tick"][:n], np.asarray(command)
            yield ours["tick"][n:], after[2 * n : 2 * n + self.equation.state_size]


def _callable(address: int) -> Callable[..., None]:
    function = _FUNCTION(address)

    def call(t: float, y: np.ndarray, p: np.ndarray, run_parameters: np.ndarray, out: np.ndarray) -> None:
        function(t, y.ctypes.data, p.ctypes.data, run_parameters.ctypes.data, out.ctypes.data)

    return call


def _difference(x: np.ndarray, y: np.ndarray, start: np.ndarray) -> float:
    """Largest difference of two results, by the size of theirs and of the state."""
    size = max(float(np.abs(y).max(initial=1.0)), float(np.abs(start).max()))
    return float(np.abs(x - y).max(initial=0.0) / size) if np.isfinite(x).all() and np.isfinite(y).all() else np.inf
