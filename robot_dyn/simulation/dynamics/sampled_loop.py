"""Whether a sampled control loop is stable, and its longest stable period, linearised at a state.

    from one tick to the next:  δx⁺ = e^{Aδ} δx + (∫₀^δ e^{As} ds) B δu,   δz⁺ = δz,   δu⁺ = δu
    at a tick:                  δu = K δx + K_z δz,   δz⁺ = L δx + L_z δz

A and B are of the plant, K and L of the controller; z holds its states, and what is on its way in a loop with delays.
The two integrals are one exponential. [Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, ch. 2; Van Loan
1978]
"""

from __future__ import annotations

from collections.abc import Callable
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

_NOISE = 1e-10  # of an entry of the map, by differences; and, in [1/s], of an entry of A that should be 0
_ROUNDING = 1e-15
_LEAST_OF_STATES = 1e-3  # first period tried times the fastest rate, where z keeps what goes around: errors of L_z stay
_FADES = 1.03  # at a period so much longer growth is ten times its doubt, unless it fades as a power of the period


@final
@dataclass(frozen=True, eq=False)
class SampledLoop:
    """A sampled loop about a state.

    Attributes:
        matrix: Gives the map of (x, u, z) over a cycle of ticks, of their period in [s].
        A: Of the plant with its actuation held, (m, m).
        continuous: Of the plant and the controller at all times, without the blocks and delays of a `Loop`.
        ticks: Periods in a cycle.
        stateless: Whether there is no z.
    """

    matrix: Callable[[float], Array]
    A: Array
    continuous: Array
    ticks: int
    stateless: bool

    def growth(self, period_s: float) -> Growth:
        """How deviations grow in a cycle; of no bound where the loop has no meaning at the period, as a filter's."""
        try:
            with np.errstate(all="ignore"):
                made = self.matrix(period_s)
        except (RobotDynError, np.linalg.LinAlgError):
            return NO_BOUND
        m, size = len(self.A), float(np.abs(np.linalg.eigvals(self.continuous)).max())
        part = min(1.0, period_s * size) if self.stateless else 1.0
        error = (_NOISE * part + _ROUNDING) * np.abs(made)
        error[:m, :m] += _NOISE * period_s
        return growth(made, error)

    def factor(self, period_s: float) -> float:
        """The factor by which deviations grow in each period in the long run."""
        return self.growth(period_s).factor ** (1 / self.ticks)

    def grows_anyway(self) -> float:
        """The rate in [1/s] at which deviations grow under control at all times; 0 if they do not."""
        rates = np.linalg.eigvals(self.continuous)
        fastest = float(rates.real.max())
        return fastest if fastest > STILL * max(1.0, float(np.abs(rates).max())) else 0.0

    def longest_period(self, also: float = 0.0) -> float:
        """The period up to which it is stable, in [s]; inf if every one is, 0 if none is.

        Delays are as many periods at each. It may be stable again at longer ones.

        Args:
            also: A period that is tried too.
        """
        limit = first_unstable(lambda each: self.growth(each).verdict is Stability.UNSTABLE, self._tried(also))
        return limit if limit == inf or self._crosses(limit) else 0.0

    def adds_growth(self, period_s: float) -> bool:
        """Whether deviations grow at least twice as fast as under control at all times, where they may grow, too."""
        made = self.growth(period_s)
        least = 2 * self.grows_anyway() * period_s * self.ticks
        return made.verdict is Stability.UNSTABLE and log(made.factor) >= least

    def longest_that_adds_none(self, also: float = 0.0) -> float:
        """The period up to which sampling adds no growth, as of `adds_growth` and `longest_period`."""
        return first_unstable(self.adds_growth, self._tried(also))

    def _tried(self, also: float) -> list[float]:
        """Periods at which limits are looked for, and another unless it is 0."""
        free, loop = np.linalg.eigvals(self.A), np.linalg.eigvals(self.continuous)
        rates = np.concatenate([free, loop])
        tried = lengths(rates, free) if self.stateless else lengths(rates, free, _LEAST_OF_STATES)
        return sorted([*tried, also]) if also else tried

    def _crosses(self, limit: float) -> bool:
        """Whether growth begins at a limit; otherwise it is that of shorter periods, below what can be told."""
        if not limit or self.growth(limit / 1.1).most < 0:
            return limit > 0
        beyond = self.growth(limit * _FADES)
        return beyond.least > 10 * beyond.doubt


def remedy(grows_anyway: float) -> str:
    """What makes a loop stable that no period does, by the rate at which deviations grow under control at all times."""
    return (
        "other gains: it is unstable under control at all times, too" if grows_anyway else "lower gains, or less delay"
    )


def linearised(plant: Plant, controller: Controller, t: float, y: Array) -> SampledLoop:
    """The loop about a state.

    Args:
        plant: What is controlled.
        controller: What controls it.
        t: Time, in [s].
        y: State (q, v, z), z of the continuous controller and then of the effects.
    """
    from scipy.linalg import expm

    controller = controller.small_signal()
    continuous = controller.at_period(0.0)
    n, size, free = plant.dynamics.n, continuous.state_size, StateEquation(plant, None).in_a_mode
    law = y[: 2 * n + size]
    x = np.concatenate([y[: 2 * n], y[2 * n + size :], np.zeros(len(free.sources))])
    u = _law(continuous, continuous.torque, t, n)(t, law)
    A = jacobian(free, t, x, u)
    m = len(A)
    B = by_state(rowwise(lambda each: free.rate(t, x, each)[0][:m]), t, u).T
    driven = np.block([[A, B], [np.zeros((n, m + n))]])

    def cycle(period: float) -> Array:
        of_period = controller.at_period(period)
        z = of_period.settled(t, law[:n], law[n : 2 * n], law[2 * n :])
        made = np.eye(m + n + len(z))
        parts = of_period.instants
        flows = [expm(driven * (period * length)) for length in np.diff([*parts, 1.0])]
        for _ in range(of_period.cycle):
            for flow in flows:
                made = _between(flow, len(z)) @ _tick(of_period, t, law[: 2 * n], z, m) @ made
                z = np.asarray(call(of_period.next_state, t, law[:n], law[n : 2 * n], z), dtype=float)
        return made

    at_all_times = _at_all_times(A, B, continuous, t, law)
    return SampledLoop(lru_cache(maxsize=1)(cycle), A, at_all_times, controller.cycle, not controller.state_size)


def _at_all_times(A: Array, B: Array, controller: Controller, t: float, law: Array) -> Array:
    """J of (x, z) under a continuous controller at (q, v, z)."""
    m, n, size = len(A), B.shape[1], controller.state_size
    made = np.zeros((m + size, m + size))
    made[:m, :m] = A
    of_u = by_state(_law(controller, controller.torque, t, n), t, law).T
    made[:m, : 2 * n] += B @ of_u[:, : 2 * n]
    if size:
        of_z = by_state(_law(controller, controller.state_rate, t, n), t, law).T
        made[:m, m:] = B @ of_u[:, 2 * n :]
        made[m:, : 2 * n], made[m:, m:] = of_z[:, : 2 * n], of_z[:, 2 * n :]
    return made


def _between(flow: Array, size: int) -> Array:
    """From one tick to the next: of (x, u, z), z constant."""
    made = np.eye(len(flow) + size)
    made[: len(flow), : len(flow)] = flow
    return made


def _tick(controller: Controller, t: float, joints: Array, z: Array, m: int) -> Array:
    """A tick: of (x, u, z), x constant, with joints the first entries (q, v) of x, of which there are m."""
    n = len(joints) // 2
    law = np.concatenate([joints, z])
    of_u = by_state(_law(controller, controller.torque, t, n), t, law).T
    made = np.eye(m + n + len(z))
    made[m : m + n] = 0
    made[m : m + n, : 2 * n], made[m : m + n, m + n :] = of_u[:, : 2 * n], of_u[:, 2 * n :]
    if len(z):
        of_z = by_state(_law(controller, controller.next_state, t, n), t, law).T
        made[m + n :] = 0
        made[m + n :, : 2 * n], made[m + n :, m + n :] = of_z[:, : 2 * n], of_z[:, 2 * n :]
    return made


def _law(controller: Controller, function: Callable[..., Any], t: float, n: int) -> Callable[[Any, Array], Array]:
    """A function of a controller, of rows (q, v, z)."""
    return rowwise(lambda row: call(function, t, row[:n], row[n : 2 * n], row[2 * n :]))
