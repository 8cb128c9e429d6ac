"""Monitor a run: detect divergence and stalled steps."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import PortableError, RobotDynError, is_mistake
from robot_dyn.foundations.values import cached
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.run.outcome import Outcome, Reason
from robot_dyn.simulation.run.time_loop import RUNAWAY
from robot_dyn.simulation.setup.setup import Setup

LARGEST = 1e100  # limit on Σ |y|; products of larger numbers overflow
_PACED = 2000  # steps between checks of the pace of an adaptive method
_MOST_AHEAD = 1e7  # steps that may remain at the current pace: about an hour
_STEEP = 1e-3  # in q or v: an effect that bends over a smaller range makes the system stiff

T = TypeVar("T")


class DivergedError(PortableError):
    """Internal: the run cannot continue; `outcome` states when and why."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(outcome.text)
        self.outcome = outcome


def one_step(method: Integrator, system: System, t: float, y: Array, h: float, watch: Watch) -> Array:
    """Return the state after a step; raises DivergedError if the step fails or a number overflows."""
    after = watch.attempt(t, y, lambda: method.step(system, t, y, h))
    if overflowed(after):
        raise watch.diverged(Reason.STATE_OVERFLOWS, t, y)
    return after


def overflowed(y: Array) -> bool:
    """Return True if Σ |y| has reached LARGEST or is nan; the time loop applies the same test to runs in lock step."""
    with np.errstate(over="ignore"):
        return not np.abs(y).sum() < LARGEST


def start_energies(setup: Setup) -> tuple[float, float]:
    """Return the kinetic and the potential energy at the start, in [J]."""
    energies = PayloadEvents(setup.equation).equation.energies
    K, V = (float(x[0]) for x in energies(np.zeros(1), setup.q0[None], setup.v0[None]))
    return K, V


@final
class Watch:
    """Monitor of a run: checks energy, torques and the pace of steps, and turns errors into outcomes.

    Energy grows without a source if the ledger's residual exceeds 1000 times the initial energy plus work.
    """

    def __init__(self, setup: Setup, equation: StateEquation) -> None:
        self.setup, self.equation = setup, equation
        K, V = cached(setup, start_energies)
        self.energy, self.scale = K + V, 1.0 + abs(K) + abs(V)
        self.pace_t, self.pace_steps = 0.0, 0  # time and steps at the last check of the pace

    def tick(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """Run one controller tick; raises DivergedError if the tick fails or the torque is not finite."""
        y, held = self.attempt(t, y, lambda: self.equation.tick(t, y))
        if held is not None and not np.isfinite(held).all():
            raise self.diverged(Reason.TORQUE_NOT_FINITE, t, y)
        return y, held

    def check_energy(self, t: float, y: Array) -> None:
        """Raise DivergedError if energy grows without a source."""
        if self.attempt(t, y, lambda: self.energy_grows(t, y)):
            raise self.diverged(Reason.ENERGY_WITHOUT_SOURCE, t, y)

    def attempt(self, t: float, y: Array, compute: Callable[[], T]) -> T:
        """Return the result of `compute`; raises DivergedError if the equations cannot be evaluated at t and y.

        Mistakes in user-written code are raised unchanged, see `is_mistake`.
        """
        try:
            return compute()
        except IntegrationError as error:  # the message already suggests a remedy
            facts: dict[str, float | str] = {"error": str(error), **self._steepest()}
            raise DivergedError(Outcome(Reason.STAGES_NOT_FOUND, t, self.equation.fastest_joint(y), facts)) from None
        except RobotDynError as error:
            if is_mistake(error):
                raise
            raise self.diverged(Reason.CANNOT_EVALUATE, t, y, error=str(error)) from None

    def check_pace(self, t: float, y: Array, steps: int) -> None:
        """Raise DivergedError if the steps of an adaptive method are too short for the run to finish."""
        taken = steps - self.pace_steps
        if taken < _PACED:
            return
        advanced, self.pace_t, self.pace_steps = t - self.pace_t, t, steps
        remaining = (self.setup.duration_s - t) / max(advanced, 1e-300) * taken
        if remaining > _MOST_AHEAD:
            implicit = "" if self.setup.method.name == "Rodas5P" else "Rodas5P, "
            facts: dict[str, float | str] = {"steps": taken, "advanced_s": advanced, "remaining": remaining}
            facts["remedy"] = f"{implicit}softer effects or a larger tolerance"
            motion = self._fastest(t, y, advanced / taken)
            facts |= motion.facts if motion else {}
            joint = motion.joint if motion else ""
            raise DivergedError(Outcome(Reason.STALLED, t, joint, facts | self._steepest()))

    def _fastest(self, t: float, y: Array, h: float) -> Fastest | None:
        """Return the fastest motion at a state if stability limits h to it; None also if it cannot be computed."""
        held = np.zeros(self.equation.plant.dynamics.n) if self.equation.sampled else None
        try:
            motion = fastest(self.equation, t, y, held)
        except (RobotDynError, np.linalg.LinAlgError):
            return None
        return motion if abs(motion.eigenvalue) * h > 1 else None

    def _steepest(self) -> dict[str, float | str]:
        """Return the effect that bends over the smallest range of q or v, with its joint, if that range is small."""
        names, width, steepest = self.equation.plant.dynamics.joint_names, _STEEP, dict[str, float | str]()
        for effect in self.equation.plant.effects:
            for widths, unit in zip(effect.widths, ("rad or m", "rad/s or m/s"), strict=True):
                by_joint = np.broadcast_to(widths, (len(names),))
                i = int(np.argmin(by_joint))
                if by_joint[i] < width:
                    width = float(by_joint[i])
                    steepest = {"effect": effect.name, "effect_joint": names[i], "width": width, "unit": unit}
        return steepest

    def energy_grows(self, t: float, y: Array) -> bool:
        """Return True if the ledger's residual shows energy growth without a source."""
        q, v, _, W = self.equation.state(y)
        K, V = self.equation.energies(np.array([t]), q[None], v[None])
        return bool((K + V)[0] - self.energy - W.sum() > RUNAWAY * (self.scale + np.abs(W).sum()))

    def diverged(self, reason: Reason, t: float, y: Array, **facts: str) -> DivergedError:
        """Return the error for a run that diverged at time t and state y, with its fastest joint."""
        joint = self.equation.fastest_joint(y)
        return DivergedError(Outcome(reason, t, joint, facts | step_and_period(self.setup)))


def step_and_period(setup: Setup) -> dict[str, float | str]:
    """Return the step and, of a sampled loop, the control period: the facts about a run that diverged."""
    period_s = 0.0 if setup.controller is None else setup.controller.period_s
    facts: dict[str, float | str] = {"step_s": setup.taken_step_s}
    return facts | {"period_s": period_s} if period_s else facts
