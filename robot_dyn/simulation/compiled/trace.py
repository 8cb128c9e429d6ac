"""The state equation in symbols: the code of `StateEquation`, traced to functions of (t, y, p, run_parameters).

    rate = (y', u),   tick = (u, z⁺),   energy = (K, V),   sample = recorded quantities that are not in y
    bodies = (M, loads) if an effect may hold joints
    jacobian = (∂y'/∂y₁, …, ∂y'/∂y_m, ∂y'/∂t)
    in lock step: rate = y', and actuation = u if it changes between ticks

p are the numbers of a segment, which all runs share: its ends, and the polynomials of the references.
`run_parameters` differ from run to run: the torques of a sampled controller in zero-order hold, and the parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import casadi as ca
import numpy as np

from robot_dyn.codegen.parameters import ROBOT, Parameter, Part, split
from robot_dyn.codegen.trace.symbolic import Symbolic, Symbols, column, inputs
from robot_dyn.codegen.trace.symbolic_dynamics import SymbolicDynamics
from robot_dyn.codegen.trace.symbolic_plant import Piece, symbolic_controller, symbolic_plant, whichever_way, wide
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import call
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.dynamics.moreau_jean import after_step, problem, solution
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.setup.segment_table import BOUNDS, lengths, polynomials

Bodies = Callable[[Dynamics, Part], SymbolicDynamics]


def trace(
    equation: StateEquation,
    symbols_of: Bodies,
    parameters: Sequence[Parameter],
    extras: tuple[str, ...] | None,
    jacobian: bool = False,
    nonsmooth: bool = False,
) -> dict[str, ca.Function]:
    """Return the functions of a state equation, see `Functions`, as CasADi Functions by name.

    Args:
        equation: The state equation.
        symbols_of: Function that returns the symbols of a robot, that of the plant or of a model.
        parameters: Parameters of the functions.
        extras: Which of "u", "v" and "energy" are in a sample of runs in lock step. None for a single run, whose
            samples are y', u, K and V.
        jacobian: True if the method needs the Jacobian.
        nonsmooth: True if the method needs the convex problem of each step instead of the rate.

    Raises:
        TraceError: If a part cannot be traced; names the part.
    """
    n, held = equation.plant.dynamics.n, equation.plant.dynamics.n * equation.sampled
    references = polynomials(equation.controller)
    sizes = 1, equation.size, BOUNDS + sum(map(lengths, references)), held + sum(x.size for x in parameters)
    (t, ts), (y, ys), (p, ps), (run_parameters, rs) = (
        inputs(name, size) for name, size in zip(("t", "y", "p", "own"), sizes, strict=True)
    )
    state, time = ys.view(Symbols), np.minimum(np.maximum(ts.view(Symbols), ps[:1]), ps[1:2])[0]
    with Symbolic().scope():
        values, pieces = split(parameters, rs[held:].view(Symbols)), _pieces(references, ps[BOUNDS:])
        symbolic = _symbolic(equation, symbols_of, values, pieces)
        u_held = rs[:held].view(Symbols) if equation.sampled else None
        q, v, z, _ = symbolic.state(state)
        rate = np.full(equation.size, np.nan, dtype=object)
        u = symbolic.actuation(time, q, v, z, u_held) if nonsmooth else None
        if u is None:
            rate, u = symbolic.rate(time, state, u_held)
        parts = {"u": wide(u, n), "v": v, "energy": symbolic.energies(time, q, v)}
        single = extras is None
        results = {"rate": np.concatenate([rate, parts["u"]]) if single else rate, "energy": parts["energy"]}
        results["sample"] = np.concatenate(
            [rate, parts["u"], parts["energy"]] if single else [parts[x] for x in extras] or [[]]
        )
        if not single and (not equation.sampled or equation.equation_of_motion.bounds_at_all_times):
            results["actuation"] = parts["u"]
        if single and equation.impulses and not nonsmooth:
            results["bodies"] = symbolic.bodies(time, state, u_held)
        if equation.events or equation.limited:
            demands = symbolic.demands(time, q, v, z, u_held, equation.limited)
            levels = [_value(event, time, q, v) for event in equation.events]
            results["events"] = np.concatenate([*(wide(demand, n) for demand in demands), *levels])
        if equation.sampled and symbolic.controller is not None:
            after = z[: equation.state_size]
            if equation.state_size:
                after = symbolic.controller.next_state(time, q, v, after)
            results["tick"] = np.concatenate([wide(symbolic.command(time, q, v, z), n), after])
        columns = {name: column(x) for name, x in results.items()}
        if jacobian:
            # by a time that is not clipped to the segment, so that the derivative at its ends is not 0
            unbounded, [free] = inputs("time", 1)
            changing, _ = symbolic.rate(free, state, u_held)
            J = ca.jacobian(column(changing), ca.vertcat(y, unbounded))
            columns["jacobian"] = ca.vec(ca.substitute(J, unbounded, column(time)))
        arguments: dict[str, list[Any]] = {name: [t, y, p, run_parameters] for name in columns}
        if nonsmooth:
            del columns["rate"]
            for name, (of_program, x) in _of_step(symbolic, time, [t, p, run_parameters], u_held).items():
                arguments[name], columns[name] = of_program, x
    return {name: ca.Function("f", arguments[name], [ca.cse(ca.densify(x))]) for name, x in columns.items()}


def _of_step(
    symbolic: StateEquation, time: Any, shared: list[Any], held: Array | None
) -> dict[str, tuple[list[Any], Any]]:
    """Return the arguments and the column of results of `problem`, `newton` and `after_step`."""
    n, (t, p, run_parameters) = symbolic.plant.dynamics.n, shared
    x, xs = inputs("x", symbolic.size + 1)
    empty = ca.SX.sym("empty", 0)
    data = problem(symbolic, time, xs.view(Symbols), held)
    numbers, numbers_array = inputs("numbers", len(data))
    place, place_array = inputs("place", n)
    solved, solved_array = inputs("solved", 2 * n + 1 + len(data))
    newton = solution(n, numbers_array.view(Symbols), place_array.view(Symbols))
    after = after_step(symbolic, xs.view(Symbols), solved_array.view(Symbols))
    return {
        "problem": ([t, x, p, run_parameters], column(data)),
        "newton": ([t, numbers, empty, place], column(newton)),
        "after_step": ([t, x, empty, solved], column(after)),
    }


def _value(event: Event, t: Any, q: Array, v: Array) -> Array:
    """Return the value of the switching function of an event, (1,)."""
    return whichever_way(f"event {event.name}", lambda: wide(call(event.function, t, q, v), 1))


def _pieces(references: Sequence[PiecewisePolynomial], p: Array) -> list[Piece]:
    """Return the polynomials of the references on a segment, from the numbers p of the segment without its ends."""
    ends = np.cumsum([0, *map(lengths, references)])
    return [Piece(p[a:b], x.n) for x, a, b in zip(references, ends, ends[1:], strict=False)]


def _symbolic(
    equation: StateEquation, symbols_of: Bodies, values: dict[Part, dict[str, Any]], pieces: list[Piece]
) -> StateEquation:
    """Return the equation with symbols instead of its numbers."""
    plant = symbolic_plant(
        equation.plant, symbols_of(equation.plant.dynamics, ROBOT).with_parameters(values.get(ROBOT, {})), values
    )
    controller = equation.controller
    if controller is not None:
        models = {}
        for name, model in controller.models.items():
            part = ("model", name)
            models[name] = symbols_of(model, part).with_parameters(values.get(part, {}))
        controller = symbolic_controller(controller, models, values, pieces)
    return StateEquation(plant, controller, equation.canonical, equation.events)
