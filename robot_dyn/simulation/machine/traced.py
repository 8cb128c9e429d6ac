"""The state equation of a plant in symbols: the lines of `StateEquation` traced to functions of (t, y, p, own).

    rate = (y', u),   tick = (u, z⁺),   energy = (K, V),   sample = what is kept beside the state

Within a segment a reference is one polynomial, so that p, its coefficients, are inputs; so are the numbers that are
each run's own: the zero-order hold of a sampled controller, and the sweep parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from inspect import getdoc
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.compiled.right_angles import completed
from robot_dyn.compiled.symbolic import Symbolic, Symbols, array_of, column, inputs
from robot_dyn.compiled.trace import Trace
from robot_dyn.control.controller import Controller
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.effects.effect import Bound, Conservative, Effect, Force
from robot_dyn.effects.plant import Plant
from robot_dyn.lagrange.manipulator import Lagrangian
from robot_dyn.model.description import Description
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.model.robot import Robot
from robot_dyn.model.tree import Described
from robot_dyn.simulation.machine.parts import (
    Piece,
    TracedBound,
    TracedConservative,
    TracedController,
    TracedForce,
    wide,
    with_,
)
from robot_dyn.simulation.machine.payloads import carrying, of_links, others
from robot_dyn.simulation.plan import BOUNDS
from robot_dyn.simulation.state_equation import StateEquation


def _least(name: str) -> Any:
    """A quantity from the formulation of fewest instructions, as a method."""

    def ask(self: SymbolicDynamics, *arguments: Array) -> Any:
        return self._ask(name, arguments)

    ask.__doc__ = getattr(Dynamics, name).__doc__
    return ask


def _closed_form(name: str) -> Any:
    """An attribute of the closed form."""
    return property(lambda self: getattr(self._trace.lagrangian, name), doc=getdoc(getattr(Lagrangian, name)))


@final
class SymbolicDynamics:
    """A `Dynamics` of symbols; each quantity from the formulation of fewest instructions."""

    M, N, coriolis_torque, coriolis_transpose = map(_least, ("M", "N", "coriolis_torque", "coriolis_transpose"))
    inverse_dynamics, forward_dynamics, momentum = map(_least, ("inverse_dynamics", "forward_dynamics", "momentum"))
    kinetic_energy, potential_energy = map(_least, ("kinetic_energy", "potential_energy"))
    C, total_energy, n, joint_names = map(_closed_form, ("C", "total_energy", "n", "joint_names"))
    placement, jacobian, jacobian_rate = map(_closed_form, ("placement", "jacobian", "jacobian_rate"))
    arithmetic = _closed_form("arithmetic")

    def __init__(self, robot: Described, parameters: tuple[Any, ...] = ()) -> None:
        self._trace = Trace(robot, parameters)
        self._functions: dict[str, ca.Function] = {}

    def carrying(self, masses: Mapping[str, Any]) -> SymbolicDynamics:
        """The same with masses of payloads, by link, that are inputs."""
        if not masses:
            return self
        return SymbolicDynamics(carrying(self._trace.robot, masses), tuple(m.expression for m in masses.values()))

    def _ask(self, name: str, arguments: tuple[Array, ...]) -> Any:
        if name not in self._functions:
            self._functions[name] = self._trace.quantity(name).function
        value = array_of(self._functions[name](*map(column, arguments), *self._trace.given))
        shape = self._trace.shape(name)
        return value[0, 0] if shape == (1,) else value.reshape(shape).view(Symbols)


def robot_of(dynamics: Any) -> Robot | None:
    """The robot whose equations a dynamics has, its right angles written out in full; None if there is none."""
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(getattr(robot, "description", None), Description) or not isinstance(robot, Robot):
        return None
    return completed(robot)[0]


def degree(controller: Controller | None) -> int | None:
    """Degree of the polynomials that a controller follows; None without."""
    reference = getattr(controller, "reference", None)
    return reference.coefficients.shape[1] - 1 if isinstance(reference, PiecewisePolynomial) else None


def trace(
    equation: StateEquation,
    dynamics: Callable[[Any], SymbolicDynamics],
    sweep: Mapping[str, int],
    kept: tuple[str, ...] | None,
) -> dict[str, ca.Function]:
    """The state equation as CasADi Functions: rate, energy, tick if it is sampled, and sample.

    Args:
        equation: What to trace.
        dynamics: Gives the symbols of the plant's and of the controller's rigid bodies.
        sweep: Names of the sweep parameters, each run's own, with their lengths: "kp", "viscous_friction.damping", or
            "payload_mass:tool0".
        kept: Which of "u", "v" and "energy" a sample of runs in lock step holds; None for a single run, whose rate
            gives u as well and whose samples hold y', u, K and V.

    Raises:
        TraceError: If a part cannot be traced; names it.
    """
    n, d, held = equation.plant.dynamics.n, degree(equation.controller), equation.plant.dynamics.n * equation.sampled
    sizes = 1, equation.size, BOUNDS + (0 if d is None else 1 + (d + 1) * n), held + sum(sweep.values())
    (t, ts), (y, ys), (p, ps), (own, owns) = (
        inputs(name, size) for name, size in zip(("t", "y", "p", "own"), sizes, strict=True)
    )
    ends = np.cumsum([held, *sweep.values()])
    chosen = {name: owns[a:b].view(Symbols) for name, a, b in zip(sweep, ends, ends[1:], strict=False)}
    state, time = ys.view(Symbols), np.minimum(np.maximum(ts.view(Symbols), ps[:1]), ps[1:2])[0]
    with Symbolic().scope():
        symbolic = _symbolic(equation, dynamics, ps[BOUNDS:], chosen)
        rate, u = symbolic.rate(time, state, owns[:held].view(Symbols) if equation.sampled else None)
        q, v, z, _ = symbolic.state(state)
        parts = {"u": wide(u, n), "v": v, "energy": symbolic.energy(time, q, v)}
        single = kept is None
        made = {"rate": np.concatenate([rate, parts["u"]]) if single else rate, "energy": parts["energy"]}
        made["sample"] = np.concatenate(
            [rate, parts["u"], parts["energy"]] if single else [parts[x] for x in kept] or [[]]
        )
        if equation.sampled and symbolic.controller is not None:
            after = symbolic.controller.next_state(time, q, v, z) if equation.state_size else z
            made["tick"] = np.concatenate([wide(symbolic.command(time, q, v, z), n), after])
    return {name: ca.Function("f", [t, y, p, own], [ca.cse(ca.densify(column(x)))]) for name, x in made.items()}


def with_values(equation: StateEquation, sweep: Mapping[str, Array]) -> StateEquation:
    """The same state equation with other values of the sweep parameters."""
    effects = [with_(effect, _own(effect, sweep)) for effect in equation.plant.effects]
    dynamics: Any = equation.plant.dynamics
    if loads := {link: float(mass) for link, mass in of_links(sweep).items()}:
        dynamics = Robot(dynamics.description, carrying(dynamics, loads).edits)
    return StateEquation(Plant(dynamics, effects), with_(equation.controller, _gains(sweep)), equation.canonical)


def _own(effect: Effect, sweep: Mapping[str, Array]) -> dict[str, Array]:
    named = ((*name.partition(".")[::2], x) for name, x in others(sweep).items())
    return {key: x for of, key, x in named if of == effect.name and key in vars(effect)}


def _gains(sweep: Mapping[str, Array]) -> dict[str, Array]:
    return {name: x for name, x in others(sweep).items() if "." not in name}


def _symbolic(
    equation: StateEquation, dynamics: Callable[[Any], SymbolicDynamics], p: Array, sweep: Mapping[str, Array]
) -> StateEquation:
    """The same state equation with symbols in place of its numbers."""
    bodies: Any = dynamics(equation.plant.dynamics).carrying(of_links(sweep))  # a controller's model does not know them
    effects: list[Effect] = []
    for effect in equation.plant.effects:
        own = with_(effect, _own(effect, sweep))
        kinds = {Bound: TracedBound, Conservative: TracedConservative, Force: TracedForce}
        effects.append(next(made for kind, made in kinds.items() if isinstance(effect, kind))(own))
    controller = None
    if equation.controller is not None:
        values = _gains(sweep)
        if p.size:
            values["reference"] = Piece(p, equation.plant.dynamics.n)
        if hasattr(equation.controller, "model"):
            values["model"] = dynamics(getattr(equation.controller, "model"))  # noqa: B009
        controller = TracedController(with_(equation.controller, values), equation.controller)
    return StateEquation(Plant(bodies, effects), controller, equation.canonical)
