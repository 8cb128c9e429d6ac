"""The tick of a controller to export, and random states of it: (q, v, q_d, v_d, a_d, z, p) ↦ (u, z⁺)."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import final

import casadi as ca
import numpy as np

import robot_dyn as rd
from robot_dyn.codegen import Parameter, Program, SelfCheckError, TickTrace
from robot_dyn.control import Controller, Loop, PiecewisePolynomial
from robot_dyn.foundations import ExportError, TraceError, with_values
from robot_dyn.tools.export.exported import Exported
from robot_dyn.tools.export.rounding import FASTEST, MOST_ACCELERATION, UNITS, States, limits

_LARGEST = 1e6  # rounding units; a larger difference is an error of the trace


@final
@dataclass(frozen=True)
class Tick(Exported):
    """The tick of a controller.

    Attributes:
        trace: Trace of the tick.
    """

    trace: TickTrace

    kind, states = "controller", 1000  # ticks in Python take a millisecond

    @property
    def controller(self) -> Controller:
        """The controller."""
        return self.trace.controller

    @property
    def period_s(self) -> float:  # pyright: ignore[reportIncompatibleVariableOverride]  read only
        return self.controller.period_s

    @property
    def name(self) -> str:
        return re.sub(r"(?<=[a-z])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", self.controller.name).lower()

    @property
    def title(self) -> str:
        return f"{self.controller.name}: u = {self.controller.term}"

    @property
    def robot(self) -> rd.Robot | None:
        return next(iter(self.trace.models.values()), None)

    @property
    def right_angles(self) -> tuple[str, ...]:
        return tuple(dict.fromkeys(map(str, self.trace.right_angles)))

    @property
    def declared(self) -> tuple[Parameter, ...]:
        return self.trace.parameters

    def function(self, name: str, *, is_open: bool = True) -> ca.Function:
        traced = self.trace.function
        names = traced.name_in()
        return self.bound(name, traced, names, traced.name_out(), {*names} - {"q", "v"}, is_open=is_open)


def tick_of(controller: Controller) -> Tick:
    """Return the tick of a controller.

    Raises:
        ExportError: If it has states and no period, delays, noise, or code that cannot be traced.
    """
    name = controller.name
    if controller.state_size and not controller.period_s:
        raise ExportError(
            f"{name} has states and is continuous; give it a period_s, in [s], or use .at_period(period_s)"
        )
    if isinstance(controller, Loop) and controller.measurement_delay_periods + controller.actuation_delay_periods > 0:
        raise ExportError(
            f"{name} models the delays of your hardware; export it without them, for example"
            " dataclasses.replace(loop, measurement_delay_periods=0, actuation_delay_periods=0)"
        )
    if controller.deviates:
        raise ExportError(f"{name} has noise, which models your sensors; export it without its Noise blocks")
    tick = Tick(TickTrace(controller))
    try:
        tick.trace.function  # noqa: B018  # traced now
    except TraceError as error:
        raise ExportError(f"{name} has no C: {error}") from error
    return tick


@final
@dataclass(frozen=True, eq=False)
class TickStates(States):
    """Random states and references at the ticks of a controller, and the states z and results by the code in Python.

    z follows from tick to tick, from zeros, so that it has values of a run.

    Attributes:
        tick: The tick.
    """

    tick: Tick

    @cached_property
    def inputs(self) -> Mapping[str, np.ndarray]:
        """Arguments by name, and the results u and z_next."""
        tick, n, rng = self.tick, self.tick.controller.n, np.random.default_rng(self.seed)
        far = np.pi, FASTEST, MOST_ACCELERATION
        boxes = [np.outer((-x, x), np.ones(n)) for x in far]
        if tick.robot is not None:
            boxes[:2] = (np.array(limits(tick.robot, x)) for x in ("q", "v"))
        drawn = {"t": np.array([[0.0], [10.0]]), "q": boxes[0], "v": boxes[1]}
        for path, (names, size) in tick.trace.motions.items():
            is_of_joints = path in tick.controller.references
            own = boxes if is_of_joints else [np.outer((-1, 1), np.ones(size))] * 3
            drawn |= dict(zip(names, own, strict=True))
        state = {name: rng.uniform(box[0], box[1], (self.count, box.shape[1])) for name, box in drawn.items()}
        state = {name: x.astype(self.dtype).astype(float) for name, x in state.items()}
        z, u = np.zeros((self.count + 1, tick.controller.state_size)), np.zeros((self.count, n))
        for k in range(self.count):
            z[k] = z[k].astype(self.dtype)
            u[k], z[k + 1] = self._reference({name: x[k] for name, x in state.items()}, z[k])
        p = np.tile(tick.p.astype(self.dtype).astype(float), (self.count, 1))
        return state | {"z": z[:-1], "p": p, "u": u, "z_next": z[1:]}

    def _reference(self, row: Mapping[str, np.ndarray], z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and z⁺ of the controller's own code at a state."""
        trace, (t,) = self.tick.trace, row["t"].tolist()
        own: dict[str, object] = dict(trace.models)
        for path, (names, _) in trace.motions.items():
            q_d, v_d, a_d = (row[name] for name in names)
            own[path] = PiecewisePolynomial([t, t + 1], [[q_d, v_d, a_d / 2]])
        controller, state = with_values(trace.controller, own), (t, row["q"], row["v"], z)
        return controller.torque(*state), controller.next_state(*state)

    def results(self, name: str) -> np.ndarray:
        return np.concatenate([self.inputs["u"], self.inputs["z_next"]], axis=1)

    def largest_error(self, name: str, program: Program, arguments: Sequence[str]) -> float:
        difference = super().largest_error(name, program, arguments)
        if not difference < _LARGEST * UNITS[self.dtype]:
            raise SelfCheckError(
                f"the tick of {self.tick.controller.name} in C differs from that in Python by {difference:.1e}; if its"
                " law jumps, write it with np.where, else report this as a bug"
            )
        return difference

    def scale(self, name: str) -> np.ndarray:
        largest = np.max(np.abs(self.results(name)), axis=0)
        return np.maximum(largest, 1e-4 * largest.max() or 1.0)  # entries may be rounding only
