"""The interpreted engine: the functions of a state equation in Python, its Jacobian by differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from math import inf
from typing import Any, ClassVar, final

import numpy as np

from robot_dyn.effects.plant import in_mode
from robot_dyn.effects.set_valued import Mode
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.integrator import System
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.moreau_jean import after_step, stepped
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.engine import Evaluated, Watched
from robot_dyn.simulation.events.contact_mode import Places
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass(frozen=True)
class Interpreted:
    """The engine that evaluates a state equation in Python; see `Engine` for the attributes."""

    equation: StateEquation
    label: str = "interpreted"
    most_evaluations: float = inf
    is_compiled: ClassVar[bool] = False
    most_steps: float = field(default=1, init=False)

    def evaluated(self, equation: StateEquation, watch: Watched) -> Evaluated:
        """Return the functions of an equation; see `Engine`."""
        if equation.impulses and watch.setup.finds_events:
            functions, numbers = in_modes(equation, watch), np.zeros(3 * equation.plant.dynamics.n)
        else:
            functions, numbers = interpreted(equation, watch), np.zeros(0)
        return Evaluated(functions, functions, numbers)

    def places(self) -> Places:
        """Return the places of the mode; apart from the zero-order hold, the run parameters are the mode."""
        n = self.equation.plant.dynamics.n
        first = n * self.equation.sampled
        return Places(*(np.array([first + k * n], np.int64) for k in range(3)))  # held, direction and contact

    def loop(self) -> None:
        """Return None: the plain time loop runs."""

    def compiling_s(self) -> float:
        """Return 0: nothing is compiled."""
        return 0.0


def interpreted_engine(setup: Setup, reason: str = "", most: float = inf) -> Interpreted:
    """Return the engine that runs a setup in Python.

    Args:
        setup: The setup to run.
        reason: Reason for this engine, for its label.
        most: Number of evaluations after which the engine is chosen again.
    """
    reasons = [reason] * bool(reason) + ["Jacobian by differences"] * setup.method.needs_jacobian
    label = f"interpreted ({'; '.join(reasons)})" if reasons else "interpreted"
    return Interpreted(setup.equation, label, most)


def interpreted(equation: StateEquation, watch: Watched) -> Functions:
    """Return the functions of a state equation as Python functions.

    If the equation cannot be evaluated, `rate` and `jacobian` raise its error, `tick` and `energy` raise the
    DivergedError of the watch, and `sample` writes nan.
    """
    n, m = equation.plant.dynamics.n, equation.size

    def at(t: float, y: Array, p: Array, run_parameters: Array) -> tuple[float, Array, Array | None]:
        """Return the time within the segment, the state, and the torques in zero-order hold."""
        return min(max(t, p[0]), p[1]), _state(y), run_parameters[:n, 0].copy() if equation.sampled else None

    def rate(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        out[:m, 0], out[m:, 0] = equation.rate(*at(t, y, p, run_parameters))

    def tick(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        after, held = watch.tick(t, _state(y))
        out[:n, 0], out[n:, 0] = held, after[2 * n : 2 * n + equation.state_size]

    def energy(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        x = _state(y)
        q, v, _, _ = watch.attempt(t, x, lambda: equation.state(x))
        out[:, 0] = watch.attempt(t, x, lambda: equation.energies(t, q, v))

    def sampled(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        sample(equation, *at(t, y, p, run_parameters), out[:, 0])

    def jacobian(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        end = p[1] if t - p[0] < p[1] - t else p[0]
        out[:, :, 0] = system(functions, equation, p, run_parameters, exact=False).derivatives(t, y[:, 0], end)

    def step(t: float, x: Array, p: Array, run_parameters: Array, out: Array) -> None:
        result = stepped(equation, *at(t, x, p, run_parameters))
        out[: len(result), 0] = result

    def after(t: float, x: Array, p: Array, solved: Array, out: Array) -> None:
        out[:, 0] = after_step(equation, x[:, 0], solved[:, 0])

    def bodies(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        out[:, 0] = equation.bodies(*at(t, y, p, run_parameters))

    def events(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
        out[:, 0] = equation.event_values(*at(t, y, p, run_parameters))

    functions = Functions(rate, tick, energy, sampled, jacobian, events, step, after, bodies=bodies)
    return functions


def in_modes(equation: StateEquation, watch: Watched) -> Functions:
    """Return the functions of a state equation in the mode of the last 3 n run parameters: held, direction, contact."""
    cache: dict[bytes, Functions] = {}

    def in_mode_of(run_parameters: Array) -> Functions:
        numbers = run_parameters[len(run_parameters) - 3 * equation.plant.dynamics.n :, 0]
        key = numbers.tobytes()
        if key not in cache:
            mode = Mode(*numbers.copy().reshape(3, -1))
            cache[key] = interpreted(replace(equation, plant=in_mode(equation.plant, mode)), watch)
        return cache[key]

    def forwarded(name: str) -> Callable[..., None]:
        def function(t: float, y: Array, p: Array, run_parameters: Array, out: Array) -> None:
            getattr(in_mode_of(run_parameters), name)(t, y, p, run_parameters, out)

        return function

    names = "rate", "tick", "energy", "sample", "jacobian", "bodies"
    return interpreted(equation, watch)._replace(**{name: forwarded(name) for name in names})


def sample(equation: StateEquation, t: float, y: Array, held: Array | None, out: Array) -> None:
    """Write the numbers of a sample, y', u, K, V, into `out` (m + n + 2,); nan for those that cannot be evaluated."""
    n, m = equation.plant.dynamics.n, equation.size
    out[...] = np.nan
    try:
        with np.errstate(all="ignore"):
            q, v, z, _ = equation.state(y)
            out[:n], out[m + n :] = v, equation.energies(t, q, v)
            out[m : m + n] = u = equation.actuation(t, q, v, z, held)
            out[m - len(equation.sources) : m] = equation.powers(t, q, v, z, u)
            out[:m], _ = equation.rate(t, y, held)
    except RobotDynError:
        pass


def _state(y: Array) -> Array:
    """Return a read-only copy of a state, (m,), which user-defined code may store."""
    x = y[:, 0].copy()
    x.setflags(write=False)
    return x


def system(
    functions: Functions,
    equation: StateEquation,
    p: Array,
    run_parameters: Array,
    latest: Array | None = None,
    exact: bool = True,
) -> System:
    """Return the equation y' = f(t, y) on one segment.

    Args:
        functions: Functions of the state equation, in Python.
        equation: The state equation.
        p: Numbers of the segment.
        run_parameters: Torques of a sampled controller in zero-order hold, (n, 1); (0, 1) without one.
        latest: Array for y' and u of the latest evaluation, (m + n, 1), or None.
        exact: True to use the Jacobian of `functions` if there is one; False for differences.
    """
    n, m = equation.plant.dynamics.n, equation.size
    out, J = np.empty((m + n, 1)) if latest is None else latest, np.empty((m + 1, m, 1))

    def rate(t: Any, y: Array) -> Array:
        if y.ndim > 1:  # states of the differences for a Jacobian
            return np.array([rate(t, row) for row in y.reshape(-1, m)]).reshape(y.shape)
        evaluate(functions.rate, float(t), np.ascontiguousarray(y)[:, None], p, run_parameters, out)
        return out[:m, 0].copy()

    def derivatives(t: Any, y: Array) -> Array:
        evaluate(functions.jacobian, float(t), np.ascontiguousarray(y)[:, None], p, run_parameters, J)
        return J[:, :, 0].copy()

    return System(rate, n, equation.widths, derivatives if exact and functions.jacobian else None)
