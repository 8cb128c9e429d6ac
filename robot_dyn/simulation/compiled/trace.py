"""The state equation in symbols: the lines of `StateEquation` traced to functions of (t, y, p, run_parameters).

    rate = (y', u),   tick = (u, z⁺),   energy = (K, V),   sample = what is recorded beside the state
    bodies = (M, loads), where something may hold joints
    in lock step rate = y', and actuation = u where it changes between ticks
    jacobian = (∂y'/∂y₁, …, ∂y'/∂y_m, ∂y'/∂t)

p holds what all runs share on a segment: its ends, and the polynomials of the references. `run_parameters` differ from
run to run: what a sampled controller holds, and the parameters.
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
from robot_dyn.simulation.dynamics.event import Event
from robot_dyn.simulation.dynamics.moreau_jean import behind, problem, solution
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.setup.segment_table import BOUNDS, lengths, polynomials

Bodies = Callable[[Any, Part], SymbolicDynamics]


def trace(
    equation: StateEquation,
    bodies: Bodies,
    known: Sequence[Parameter],
    extras: tuple[str, ...] | None,
    jacobian: bool = False,
    nonsmooth: bool = False,
) -> dict[str, ca.Function]:
    """The state equation as CasADi Functions: rate, energy, tick if it is sampled, sample, and jacobian if requested.

    Args:
        equation: What to trace.
        bodies: Gives the symbols of a robot, the plant's or a model's.
        known: The parameters.
        extras: Which of "u", "v" and "energy" a sample of runs in lock step holds; None for a single run, whose
            samples hold y', u, K and V.
        jacobian: Whether a method needs it.
        nonsmooth: Whether the method needs the convex problem of each step in place of the rate.

    Raises:
        TraceError: If a part cannot be traced; names it.
    """
    n, held = equation.plant.dynamics.n, equation.plant.dynamics.n * equation.sampled
    followed = polynomials(equation.controller)
    sizes = 1, equation.size, BOUNDS + sum(map(lengths, followed)), held + sum(each.size for each in known)
    (t, ts), (y, ys), (p, ps), (run_parameters, rs) = (
        inputs(name, size) for name, size in zip(("t", "y", "p", "own"), sizes, strict=True)
    )
    state, time = ys.view(Symbols), np.minimum(np.maximum(ts.view(Symbols), ps[:1]), ps[1:2])[0]
    with Symbolic().scope():
        symbolic = _symbolic(equation, bodies, split(known, rs[held:].view(Symbols)), _pieces(followed, ps[BOUNDS:]))
        held_here = rs[:held].view(Symbols) if equation.sampled else None
        q, v, z, _ = symbolic.state(state)
        rate = np.full(equation.size, np.nan, dtype=object)
        u = symbolic.actuation(time, q, v, z, held_here) if nonsmooth else None
        if u is None:
            rate, u = symbolic.rate(time, state, held_here)
        parts = {"u": wide(u, n), "v": v, "energy": symbolic.energies(time, q, v)}
        single = extras is None
        results = {"rate": np.concatenate([rate, parts["u"]]) if single else rate, "energy": parts["energy"]}
        results["sample"] = np.concatenate(
            [rate, parts["u"], parts["energy"]] if single else [parts[x] for x in extras] or [[]]
        )
        if not single and (not equation.sampled or equation.equation_of_motion.bounds_at_all_times):
            results["actuation"] = parts["u"]
        if single and equation.impulses and not nonsmooth:
            results["bodies"] = symbolic.bodies(time, state, held_here)
        if equation.events or equation.limited:
            demands = symbolic.demands(time, q, v, z, held_here, equation.limited)
            values = [wide(each, n) for each in demands] + [_value(each, time, q, v) for each in equation.events]
            results["events"] = np.concatenate(values)
        if equation.sampled and symbolic.controller is not None:
            after = z[: equation.state_size]
            if equation.state_size:
                after = symbolic.controller.next_state(time, q, v, after)
            results["tick"] = np.concatenate([wide(symbolic.command(time, q, v, z), n), after])
        columns = {name: column(x) for name, x in results.items()}
        if jacobian:
            # of the time before it is bounded: a segment goes on, for its derivatives
            unbounded, [free] = inputs("time", 1)
            changing, _ = symbolic.rate(free, state, held_here)
            J = ca.jacobian(column(changing), ca.vertcat(y, unbounded))
            columns["jacobian"] = ca.vec(ca.substitute(J, unbounded, column(time)))
        given: dict[str, list[Any]] = {name: [t, y, p, run_parameters] for name in columns}
        if nonsmooth:
            del columns["rate"]
            for name, (arguments, x) in _of_step(symbolic, time, [t, p, run_parameters], held_here).items():
                given[name], columns[name] = arguments, x
    return {name: ca.Function("f", given[name], [ca.cse(ca.densify(x))]) for name, x in columns.items()}


def _of_step(
    symbolic: StateEquation, time: Any, shared: list[Any], held: Array | None
) -> dict[str, tuple[list[Any], Any]]:
    """Arguments and column of `problem`, `newton` and `behind`."""
    n, (t, p, run_parameters) = symbolic.plant.dynamics.n, shared
    x, xs = inputs("x", symbolic.size + 1)
    nothing = ca.SX.sym("nothing", 0)
    given = problem(symbolic, time, xs.view(Symbols), held)
    known, knowns = inputs("known", len(given))
    place, places = inputs("place", n)
    solved, solveds = inputs("solved", 2 * n + 1 + len(given))
    step = (
        solution(n, knowns.view(Symbols), places.view(Symbols)),
        behind(symbolic, xs.view(Symbols), solveds.view(Symbols)),
    )
    return {
        "problem": ([t, x, p, run_parameters], column(given)),
        "newton": ([t, known, nothing, place], column(step[0])),
        "behind": ([t, x, nothing, solved], column(step[1])),
    }


def _value(event: Event, t: Any, q: Array, v: Array) -> Array:
    """The switching function of an event, (1,)."""
    return whichever_way(f"event {event.name}", lambda: wide(call(event.function, t, q, v), 1))


def _pieces(followed: Sequence[PiecewisePolynomial], p: Array) -> list[Piece]:
    """The polynomials of a segment, from its numbers."""
    ends = np.cumsum([0, *map(lengths, followed)])
    return [Piece(p[a:b], each.n) for each, a, b in zip(followed, ends, ends[1:], strict=False)]


def _symbolic(
    equation: StateEquation, bodies: Bodies, values: dict[Part, dict[str, Any]], pieces: list[Piece]
) -> StateEquation:
    """The same equation with symbols in place of its numbers."""
    plant = symbolic_plant(equation.plant, bodies(equation.plant.dynamics, ROBOT).of(values.get(ROBOT, {})), values)
    controller = equation.controller
    if controller is not None:
        models = {}
        for name, model in controller.models.items():
            part = ("model", name)
            models[name] = bodies(model, part).of(values.get(part, {}))
        controller = symbolic_controller(controller, models, values, pieces)
    return StateEquation(plant, controller, equation.canonical, equation.events)
