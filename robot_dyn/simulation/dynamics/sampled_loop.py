"""The stability of a sampled control loop, and its longest stable period, linearised at a state.

    from one tick to the next:  δx⁺ = e^{Aδ} δx + (∫₀^δ e^{As} ds) B δu,   δz⁺ = δz,   δu⁺ = δu
    at a tick:                  δu = K δx + K_z δz,   δz⁺ = L δx + L_z δz

A and B belong to the plant, K and L to the controller; z contains its states, and delayed values of a loop.
The two integrals are one exponential. [Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, ch. 2; Van Loan
1978]
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from math import inf, log
from typing import Any, final

import numpy as np

from robot_dyn.control.controller import Controller
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError, call
from robot_dyn.integrate.differences import by_state, rowwise
from robot_dyn.simulation.dynamics.fastest_motion import jacobian
from robot_dyn.simulation.dynamics.stability import NO_BOUND, STILL, Growth, Stability, first_unstable, growth, lengths
from robot_dyn.simulation.dynamics.state_equation import StateEquation

_NOISE = 1e-10  # relative error of an entry of the map by differences; in [1/s], error of an entry of A that is 0
_ROUNDING = 1e-15
_LEAST_OF_STATES = 1e-3  # h |λ| of the first period tried with z, as the errors of L_z do not shrink with the period
_FADES = 1.03  # factor on a limit: at this period the growth is ten times its error if it begins at the limit


@final
@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A sampled loop about a state.

    Attributes:
        matrix: Function of the period in [s]: the map of (x, u, z) over a cycle of ticks.
        A: A of the plant with its actuation held, (m, m).
        continuous: A of the plant under continuous control, without the blocks and delays of a `Loop`.
        ticks: Periods in a cycle.
        stateless: True if there is no z.
    """

    matrix: Callable[[float], Array]
    A: Array
    continuous: Array
    ticks: int
    stateless: bool

    def growth(self, period_s: float) -> Growth:
        """Return the growth of deviations in a cycle; NO_BOUND if the loop, such as a filter, has no such period."""
        try:
            with np.errstate(all="ignore"):
                matrix = self.matrix(period_s)
        except (RobotDynError, np.linalg.LinAlgError):
            return NO_BOUND
        m, size = len(self.A), float(np.abs(np.linalg.eigvals(self.continuous)).max())
        part = min(1.0, period_s * size) if self.stateless else 1.0
        error = (_NOISE * part + _ROUNDING) * np.abs(matrix)
        error[:m, :m] += _NOISE * period_s
        return growth(matrix, error)

    def factor(self, period_s: float) -> float:
        """Return the factor by which deviations grow in each period in the long run."""
        return self.growth(period_s).factor ** (1 / self.ticks)

    def continuous_growth_rate(self) -> float:
        """Return the rate in [1/s] at which deviations grow under continuous control; 0 if they do not."""
        rates = np.linalg.eigvals(self.continuous)
        fastest = float(rates.real.max())
        return fastest if fastest > STILL * max(1.0, float(np.abs(rates).max())) else 0.0

    def longest_period(self, also: float = 0.0) -> float:
        """Return the period up to which the loop is stable, in [s]; inf if it always is, 0 if it never is.

        A delay has the same number of periods at all periods. The loop may be stable again at longer periods.

        Args:
            also: Another period to try, in [s]; 0 for none.
        """
        limit = first_unstable(lambda period: self.growth(period).verdict is Stability.UNSTABLE, self._tried(also))
        return limit if limit == inf or self._crosses(limit) else 0.0

    def adds_growth(self, period_s: float) -> bool:
        """Return True if deviations grow by at least twice the rate under continuous control, which may be 0."""
        growth = self.growth(period_s)
        least = 2 * self.continuous_growth_rate() * period_s * self.ticks
        return growth.verdict is Stability.UNSTABLE and log(growth.factor) >= least

    def longest_period_without_added_growth(self, also: float = 0.0) -> float:
        """Return the period up to which sampling adds no growth, in [s]; see `adds_growth` and `longest_period`."""
        return first_unstable(self.adds_growth, self._tried(also))

    def _tried(self, also: float) -> list[float]:
        """Return the periods at which limits are searched, and another one unless it is 0."""
        free, loop = np.linalg.eigvals(self.A), np.linalg.eigvals(self.continuous)
        rates = np.concatenate([free, loop])
        tried = lengths(rates, free) if self.stateless else lengths(rates, free, _LEAST_OF_STATES)
        return sorted([*tried, also]) if also else tried

    def _crosses(self, limit: float) -> bool:
        """Return True if growth begins at a limit; False if shorter periods grow, too, by less than can be detected."""
        if not limit or self.growth(limit / 1.1).most < 0:
            return limit > 0
        beyond = self.growth(limit * _FADES)
        return beyond.least > 10 * beyond.doubt


def remedy(continuous_growth_rate: float) -> str:
    """Return the remedy for a loop that no period makes stable, by the growth under continuous control in [1/s]."""
    return (
        "other gains: it is unstable even under continuous control"
        if continuous_growth_rate
        else "lower gains, or less delay"
    )


def continuous_form(controller: Controller, t: float, q: Array, v: Array) -> Controller:
    """Return the controller for continuous control; with its period if its law at (t, q, v) divides by the period."""
    continuous = controller.at_period(0.0)
    z = np.zeros(continuous.state_size)
    with suppress(ZeroDivisionError), np.errstate(all="ignore"):
        if all(np.isfinite(call(law, t, q, v, z)).all() for law in (continuous.torque, continuous.state_rate)):
            return continuous
    return continuous.at_period(controller.period_s)


def linearised(plant: Plant, controller: Controller, t: float, y: Array) -> SampledLoop:
    """Return the loop about a state.

    Args:
        plant: The plant.
        controller: Controller of the setup.
        t: Time, in [s].
        y: State (q, v, z), z of the continuous controller and then of the effects.
    """
    from scipy.linalg import expm

    n, controller, free = plant.dynamics.n, controller.small_signal(), StateEquation(plant, None).in_a_mode
    continuous = continuous_form(controller, t, y[:n], y[n : 2 * n])
    size = continuous.state_size
    law = y[: 2 * n + size]
    x = np.concatenate([y[: 2 * n], y[2 * n + size :], np.zeros(len(free.sources))])
    u = _law(continuous.torque, t, n)(t, law)
    A = jacobian(free, t, x, u)
    m = len(A)
    B = by_state(rowwise(lambda torque: free.rate(t, x, torque)[0][:m]), t, u).T
    driven = np.block([[A, B], [np.zeros((n, m + n))]])

    def cycle(period: float) -> Array:
        sampled = controller.at_period(period)
        z = sampled.settled(t, law[:n], law[n : 2 * n], law[2 * n :])
        product = np.eye(m + n + len(z))
        flows = [expm(driven * (period * length)) for length in np.diff([*sampled.instants, 1.0])]
        for _ in range(sampled.cycle):
            for flow in flows:
                product = _between(flow, len(z)) @ _tick(sampled, t, law[: 2 * n], z, m) @ product
                z = np.asarray(call(sampled.next_state, t, law[:n], law[n : 2 * n], z), dtype=float)
        return product

    at_all_times = _at_all_times(A, B, continuous, t, law)
    return SampledLoop(lru_cache(maxsize=1)(cycle), A, at_all_times, controller.cycle, not controller.state_size)


def _at_all_times(A: Array, B: Array, controller: Controller, t: float, law: Array) -> Array:
    """Return J of (x, z) under a continuous controller at (q, v, z)."""
    m, n, size = len(A), B.shape[1], controller.state_size
    J = np.zeros((m + size, m + size))
    J[:m, :m] = A
    K = by_state(_law(controller.torque, t, n), t, law).T
    J[:m, : 2 * n] += B @ K[:, : 2 * n]
    if size:
        L = by_state(_law(controller.state_rate, t, n), t, law).T
        J[:m, m:] = B @ K[:, 2 * n :]
        J[m:, : 2 * n], J[m:, m:] = L[:, : 2 * n], L[:, 2 * n :]
    return J


def _between(flow: Array, size: int) -> Array:
    """Return the map of (x, u, z) from one tick to the next, with z constant."""
    matrix = np.eye(len(flow) + size)
    matrix[: len(flow), : len(flow)] = flow
    return matrix


def _tick(controller: Controller, t: float, joints: Array, z: Array, m: int) -> Array:
    """Return the map of (x, u, z) at a tick, which leaves x (m,) unchanged; `joints` are (q, v), its first entries."""
    n = len(joints) // 2
    law = np.concatenate([joints, z])
    K = by_state(_law(controller.torque, t, n), t, law).T
    matrix = np.eye(m + n + len(z))
    matrix[m : m + n] = 0
    matrix[m : m + n, : 2 * n], matrix[m : m + n, m + n :] = K[:, : 2 * n], K[:, 2 * n :]
    if len(z):
        L = by_state(_law(controller.next_state, t, n), t, law).T
        matrix[m + n :] = 0
        matrix[m + n :, : 2 * n], matrix[m + n :, m + n :] = L[:, : 2 * n], L[:, 2 * n :]
    return matrix


def _law(function: Callable[..., Any], t: float, n: int) -> Callable[[Any, Array], Array]:
    """Return a function of a controller at time t, as a function of rows (q, v, z)."""
    return rowwise(lambda row: call(function, t, row[:n], row[n : 2 * n], row[2 * n :]))
