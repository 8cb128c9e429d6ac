"""Linearisation of a plant about a state: d/dt δx = A δx + B δu with x = (q, v, z), z the states of effects.

A = ∂f/∂x and B = ∂f/∂u of f = (v, a(t, x, u), ż(t, x, u)), by central differences of fourth order.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.effects.effect import Bound, numbered
from robot_dyn.effects.equation_of_motion import EquationOfMotion
from robot_dyn.effects.missing_time import MISSING_TIME
from robot_dyn.effects.plant import Plant, in_mode
from robot_dyn.effects.set_valued import Mode, SetValued
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import JointValues, numbers, one_state
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import without_rounding
from robot_dyn.simulation.dynamics.smooth_differences import ROUNDING, Column

_AT_REST = 1e-9  # part of the sum of magnitudes of the terms of a rate
_SOLVED = 1e-12  # fraction of the largest entry of x: error of the other entries in the solution of a linear system
_LAYER = 20  # widths from v = 0 within which steps resolve a layer of friction
_ITERATIONS = 60
_NEAR = 1e-6  # relative distance of a threshold that is named as the cause of a kink


@final
@dataclass(frozen=True, eq=False, repr=False)
class Linearisation(Answer, ReadOnly):
    """A and B about one state; unpacks as a pair: `A, B = rd.linearise(…)`.

    Attributes:
        A: Matrix of δx, shape (m, m), with x = (q, v, z) and z the states of effects.
        B: Matrix of δu, shape (m, n).
        state_names: Names of the m entries of x, such as "q joint_1", "v joint_1", "actuator_lag state 1".
        input_names: Names of the n entries of u, such as "u joint_1".
        q: Position, shape (n,), in [rad] or [m].
        v: Velocity, shape (n,), in [rad/s] or [m/s].
        z: States of effects, shape (m − 2 n,).
        u: Actuation, shape (n,), in [N m] or [N].
        t: Time, in [s]; None if it was not passed.
    """

    A: np.ndarray
    B: np.ndarray
    state_names: tuple[str, ...]
    input_names: tuple[str, ...]
    q: np.ndarray
    v: np.ndarray
    z: np.ndarray
    u: np.ndarray
    t: float | None

    def __iter__(self) -> Iterator[np.ndarray]:
        return iter((self.A, self.B))

    def __len__(self) -> int:
        return 2

    def __getitem__(self, k: int) -> np.ndarray:
        return (self.A, self.B)[k]

    def blocks(self) -> Iterator[Block]:
        others = self.state_names[2 * len(self.q) :]
        yield f"d/dt {(x := 'δx' if others else '(δq, δv)')} = A {x} + B δu: A {self.A.shape}, B {self.B.shape}"
        if others:
            yield f"x = (q, v, {', '.join(others)})"
        upper = [x for x in np.linalg.eigvals(self.A).tolist() if complex(x).imag >= 0]
        rows = sorted((complex(x) for x in upper), key=lambda x: (-x.real, x.imag))
        headings = ("growth, real part [1/s]", "± imaginary part [rad/s]")
        yield "eigenvalues of A:"
        shown = without_rounding([(x.real, x.imag) for x in rows])
        yield Table(headings, tuple(map(tuple, shown.tolist())), 4)


def linearise(
    plant: Plant | Dynamics,
    q: JointValues,
    v: JointValues | None = None,
    u: JointValues | None = None,
    *,
    z: ArrayLike | None = None,
    t: float | None = None,
) -> Linearisation:
    """Compute A and B of d/dt δx = A δx + B δu about one state, x = (q, v, z).

    Args:
        plant: A plant, or a robot without effects.
        q: Position, shape (n,), in [rad] or [m].
        v: Velocity, shape (n,), in [rad/s] or [m/s]; 0 by default.
        u: Actuation, shape (n,), in [N m] or [N]; by default the actuation at which the acceleration is 0, so that a
            state at rest is an equilibrium.
        z: States of the effects with states, in the order of the plant; by default those at which ż = 0. A state with
            ż = 0 at any value, such as a bristle at rest, keeps its value at the start of a run.
        t: Time, in [s]; required if an effect depends on the time.

    Returns:
        A, shape (m, m), and B, shape (m, n), with the names of the entries of x and u and the state; shown as the
        eigenvalues of A.

    Raises:
        QueryError: If an argument is wrong, the acceleration has no derivative at this state, or no values of the
            arguments u and z that are left out make the rates 0.
    """
    plant = (plant if isinstance(plant, Plant) else Plant(plant)).at(t)
    time = MISSING_TIME if t is None else float(t)
    names, n = plant.dynamics.joint_names, plant.dynamics.n
    q, v = one_state("q", q, names), one_state("v", np.zeros(n) if v is None else v, names)
    rates = _Rates(_sliding(plant, q, v).equation_of_motion, time)
    size = rates.equation.state_size
    x = np.concatenate([q, v, rates.equation.start(q, v), np.zeros(n)])
    unknown = np.zeros(len(x), bool)
    if z is None:
        unknown[2 * n : 2 * n + size] = True
    else:
        x[2 * n : 2 * n + size] = numbers("z", z, (size,))
    if u is None:
        torque = sum(rates.equation.torques(time, q, v, (n,)), start=np.zeros(n))
        x[-n:] = rates.equation.dynamics.inverse_dynamics(q, v, np.zeros(n)) - torque
        unknown[-n:] = True
    else:
        x[-n:] = one_state("u", u, names)
    x = _balanced(rates, x, unknown)
    slopes = _slopes(rates, x)
    if (bad := slopes.first_bad) is not None:
        raise QueryError(
            f"linearise: the rates have no derivative by {[*rates.state_names, *rates.input_names][bad]!r} at this"
            f" state: {_cause(rates, x)}; move the state"
        )
    A, B = np.zeros((2 * n + size, 2 * n + size)), np.zeros((2 * n + size, n))
    A[:n, n : 2 * n], A[n:], B[n:] = np.eye(n), slopes.values[:, :-n], slopes.values[:, -n:]
    q, v, z, u = rates.parts(x)
    return Linearisation(A, B, rates.state_names, rates.input_names, q=q, v=v, z=z, u=u, t=None if t is None else time)


@final
@dataclass(frozen=True)
class _Rates:
    """The rates (a, ż) at x = (q, v, z, u)."""

    equation: EquationOfMotion
    t: float

    def parts(self, x: np.ndarray) -> list[np.ndarray]:
        """Return q, v, z, u."""
        n = self.equation.dynamics.n
        return np.split(x, [n, 2 * n, len(x) - n])

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return (a, ż), shape (n + size,)."""
        q, v, z, u = self.parts(x)
        equation = self.equation
        u, reached = equation.applied(equation.commanded(u), v, z)
        torques = equation.torques(self.t, q, v, (len(q),), z)
        a = np.asarray(equation.acceleration(q, v, sum(torques, start=equation.on_joints(u))), float)
        rates = np.zeros(len(z))
        for place, rate in equation.state_rates(self.t, q, v, u, reached, z, a):
            rates[place] = rate
        return np.concatenate([a, rates])

    def magnitudes(self, x: np.ndarray, slopes: np.ndarray) -> np.ndarray:
        """Return the sum of magnitudes of the terms of each rate, which bounds its rounding, (n + size,).

        The terms are M⁻¹ times each torque, and the slopes times x. A torque of the rigid bodies sums forces of all
        bodies, so that its terms are as large as those of any joint.
        """
        q, v, z, u = self.parts(x)
        equation, rigid = self.equation, self.equation.dynamics
        u, _ = equation.applied(equation.commanded(u), v, z)
        total = np.abs(np.asarray([u, *equation.torques(self.t, q, v, (len(q),), z)], float)).sum(axis=0)
        total += np.abs(np.asarray([rigid.N(q), rigid.coriolis_torque(q, v)], float)).sum(axis=0).max()
        terms = np.abs(slopes) @ np.abs(x)
        terms[: len(q)] += np.abs(np.linalg.inv(np.asarray(rigid.M(q), float))) @ total
        return terms

    @property
    def state_names(self) -> tuple[str, ...]:
        """Names of the entries of q, v and z."""
        joints, equation = self.equation.dynamics.joint_names, self.equation
        effects = numbered(*(equation.effects[k].name for k in equation.states))
        sizes = (place.stop - place.start for place in equation.states.values())
        states = (f"{name} state {k + 1}" for name, size in zip(effects, sizes, strict=True) for k in range(size))
        return *(f"{x} {joint}" for x in "qv" for joint in joints), *states

    @property
    def input_names(self) -> tuple[str, ...]:
        """Names of the entries of u."""
        return tuple(f"u {joint}" for joint in self.equation.dynamics.joint_names)

    def longest_steps(self, x: np.ndarray) -> np.ndarray:
        """Return the longest step by each entry of x: a part of the width of a layer of friction about v = 0."""
        n, longest = self.equation.dynamics.n, np.full(len(x), np.inf)
        v = slice(n, 2 * n)
        for effect in self.equation.effects:
            width = np.broadcast_to(effect.widths[1], n)
            longest[v] = np.minimum(longest[v], np.where(np.abs(x[v]) <= _LAYER * width, width / 4, np.inf))
        return longest


def _sliding(plant: Plant, q: np.ndarray, v: np.ndarray) -> Plant:
    """Return the plant in the mode in which no joint is held and each slides in the direction of its velocity.

    Raises:
        QueryError: If an effect holds a joint or switches between modes at this state; names it.
    """
    effects = [effect for effect in plant.effects if isinstance(effect, SetValued)]
    for effect in effects:
        if effect in plant.equation_of_motion.drives.values():
            raise QueryError(
                f"linearise: {effect.name} switches at each contact of its gear, so that no linear model describes it;"
                " use a SeriesElastic with the same motors"
            )
        interval = effect.at_rest(q)
        acts = np.less(interval.least, 0) | np.greater(interval.most, 0)
        joints = ", ".join(plant.dynamics.joint_names[i] for i in np.flatnonzero(acts & (effect.stops | (v == 0))))
        if joints and effect.stops:
            raise QueryError(
                f"linearise: {effect.name}: {joints} is at a stop, where it may bounce; move q off the stop"
            )
        if joints:
            raise QueryError(
                f"linearise: {effect.name} holds {joints} at rest, where the acceleration has no derivative by v; give"
                " a velocity other than 0 there, or use RegularisedCoulombFriction instead"
            )
    return in_mode(plant, Mode(np.zeros(len(v)), np.sign(v))) if effects else plant


def _balanced(rates: _Rates, x: np.ndarray, unknown: np.ndarray) -> np.ndarray:
    """Return x with unknown u and z at which a = 0, if u is unknown, and ż = 0, by Newton's method.

    Raises:
        QueryError: If there are none near the start.
    """
    n = rates.equation.dynamics.n
    wanted = np.full(len(x) - 2 * n, unknown.any())
    wanted[:n] = unknown[-n:]
    if not wanted.any():
        return x
    slopes = np.zeros((len(wanted), len(x)))
    for _ in range(_ITERATIONS):
        residual = rates(x)
        if _vanishes(rates, x, residual, slopes)[wanted].all():
            return x
        slopes = _slopes(rates, x, unknown).values
        driven = unknown.copy()
        driven[2 * n : -n] &= (slopes[n:] != 0).any(axis=1)  # a state whose rate is constant keeps its value
        x = x.copy()
        x[driven] -= np.linalg.lstsq(slopes[np.ix_(wanted, driven)], residual[wanted], rcond=None)[0]
    if not rates.equation.state_size:
        raise QueryError("linearise: no actuation within the limits of the plant holds this state; give u")
    raise QueryError("linearise: no actuation and no states of effects with rates of 0 were found; give u and z")


def _vanishes(rates: _Rates, x: np.ndarray, residual: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return True for each rate that is 0 to the rounding of its terms and of the largest entry of x."""
    rounding = _AT_REST * rates.magnitudes(x, slopes) + _SOLVED * np.abs(slopes).sum(axis=1) * np.abs(x).max()
    return np.abs(residual) <= rounding


class _Slopes(NamedTuple):
    """Derivatives of rates, and the number of the first entry of x by which there is none."""

    values: np.ndarray
    first_bad: int | None


def _slopes(rates: _Rates, x: np.ndarray, is_needed: np.ndarray | bool = True) -> _Slopes:
    """Return ∂(a, ż)/∂x, (n + size, m), by the needed entries of x; 0 by the others."""
    needed = np.flatnonzero(np.broadcast_to(is_needed, x.shape))
    here, longest = rates(x), rates.longest_steps(x)
    columns = {j: Column.from_function(rates, x, j, here, longest[j]) for j in needed.tolist()}
    values = np.zeros((len(here), len(x)))
    rounding = ROUNDING * rates.magnitudes(x, values)
    for _ in range(2):  # the second time with the rounding from the slopes of the first
        for j, column in columns.items():
            values[:, j] = column.best(rounding)[0]
        rounding = ROUNDING * rates.magnitudes(x, values)
    bad = (j for j, column in columns.items() if not column.is_smooth(rounding))
    return _Slopes(values, next(bad, None))


def _cause(rates: _Rates, x: np.ndarray) -> str:
    """Return the thresholds of effects that the state lies on, in words."""
    q, v, z, u = rates.parts(x)
    equation, causes = rates.equation, []
    _, reached = equation.applied(u, v, z, range(len(equation.effects)))
    for k, effect in enumerate(equation.effects):
        for threshold in effect.thresholds(len(q)):
            values, i = v if threshold.of_velocity else q, threshold.joint
            if threshold.state is not None:
                values, i = z[equation.states[k]], threshold.state
            elif threshold.of_actuation and isinstance(effect, Bound):
                values = effect.limited(reached[k], v)
            if abs(values[i] - threshold.level) <= max(threshold.slack, _NEAR * max(1.0, abs(threshold.level))):
                joint = equation.dynamics.joint_names[threshold.joint]
                causes.append(f"{effect.name} switches at {threshold.name} {threshold.level:.6g} of {joint}")
    return " and ".join(dict.fromkeys(causes)) or "an effect jumps or has a kink there"
