"""Monitor a run: detect divergence and stalled steps, and compose the advice for the user."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import PortableError, RobotDynError, is_mistake
from robot_dyn.foundations.values import cached
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System
from robot_dyn.simulation.dynamics.fastest_motion import fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.setup.setup import Setup

LARGEST = 1e100  # limit on Σ |y|; products of larger numbers overflow
_PACED = 2000  # steps between checks of the pace of an adaptive method
_MOST_AHEAD = 1e7  # steps that may remain at the current pace: about an hour
_STEEP = 1e-3  # in q or v: an effect that bends over a smaller range makes the system stiff

T = TypeVar("T")


class DivergedError(PortableError):
    """Internal: the run cannot continue past `t`; the message is advice to the user."""

    def __init__(self, t: float, advice: str) -> None:
        super().__init__(advice)
        self.t = t


def one_step(method: Integrator, system: System, t: float, y: Array, h: float, watch: Watch) -> Array:
    """Return the state after a step; raises DivergedError if the step fails or a number overflows."""
    after = watch.answer(t, y, lambda: method.step(system, t, y, h))
    if overflowed(after):
        raise watch.diverged(t, y, "a number overflowed")
    return after


def overflowed(y: Array) -> bool:
    """Whether Σ |y| has reached LARGEST or is nan; the time loop applies the same test to runs in lock step."""
    with np.errstate(over="ignore"):
        return not np.abs(y).sum() < LARGEST


def _start(setup: Setup) -> tuple[float, float]:
    """Kinetic and potential energy at the start."""
    energies = PayloadEvents(setup.equation).equation.energies
    K, V = (float(x[0]) for x in energies(np.zeros(1), setup.q0[None], setup.v0[None]))
    return K, V


@final
class Watch:
    """Detects energy growth without a source: the ledger's residual exceeds 1000 times the initial energy plus work."""

    def __init__(self, setup: Setup, equation: StateEquation) -> None:
        self.setup, self.equation = setup, equation
        K, V = cached(setup, _start)
        self.energy, self.scale = K + V, 1.0 + abs(K) + abs(V)
        self.paced, self.looked = 0.0, 0  # time and steps at the last check of the pace

    def tick(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """Run one controller tick; raises DivergedError if the tick fails or the torque is not finite."""
        y, held = self.answer(t, y, lambda: self.equation.tick(t, y))
        if held is not None and not np.isfinite(held).all():
            raise self.diverged(t, y, "the controller asks for a torque that is not finite")
        return y, held

    def look(self, t: float, y: Array) -> None:
        """Raise DivergedError if energy grows without a source."""
        if self.answer(t, y, lambda: self.gains(t, y)):
            raise self.diverged(t, y, "energy grows without a source")

    def answer(self, t: float, y: Array, ask: Callable[[], T]) -> T:
        """Return the result of `ask`; raises DivergedError if the equations cannot be evaluated."""
        try:
            return ask()
        except IntegrationError as error:  # the message already suggests a remedy
            raise DivergedError(t, str(error) + self._steepest()) from None
        except RobotDynError as error:
            if is_mistake(error):
                raise
            raise self.diverged(t, y, str(error)) from None

    def pace(self, t: float, y: Array, steps: int) -> None:
        """Raise DivergedError if the steps of an adaptive method are too short for the run to finish."""
        since = steps - self.looked
        if since < _PACED:
            return
        made, self.paced, self.looked = t - self.paced, t, steps
        ahead = (self.setup.duration_s - t) / max(made, 1e-300) * since
        if ahead > _MOST_AHEAD:
            why = self._fastest(t, y, made / since)
            implicit = "" if self.setup.integrator.name == "Rosenbrock" else "Rosenbrock, "
            raise DivergedError(
                t, f"the last {since} steps led {made:.1e} s on, at which pace {ahead:.0e} more are left: the system "
                f"is stiff; {why}take {implicit}softer effects or a larger tolerance{self._steepest()}"
            )  # fmt: skip

    def _fastest(self, t: float, y: Array, h: float) -> str:
        """Describe the fastest motion, if it is found at this state and fast enough for stability to limit h."""
        held = np.zeros(self.equation.plant.dynamics.n) if self.equation.sampled else None
        try:
            motion = fastest(self.equation, t, y, held)
        except (RobotDynError, np.linalg.LinAlgError):
            return ""
        return f"{motion}: " if abs(motion.eigenvalue) * h > 1 else ""

    def _steepest(self) -> str:
        """Describe the effect that bends over the smallest range of q or v, if that range is small."""
        names, found = self.equation.plant.dynamics.joint_names, (_STEEP, "")
        for effect in self.equation.plant.effects:
            for width, unit in zip(effect.widths, ("rad or m", "rad/s or m/s"), strict=True):
                at = np.broadcast_to(width, (len(names),))
                i = int(np.argmin(at))
                found = min(
                    found, (float(at[i]), f"{effect.name} of joint {names[i]!r} bends within {at[i]:.1e} {unit}")
                )
        return found[1] and f" ({found[1]})"

    def gains(self, t: float, y: Array) -> bool:
        """Whether the ledger's residual shows energy growth without a source."""
        q, v, _, W = self.equation.state(y)
        K, V = self.equation.energies(np.array([t]), q[None], v[None])
        return bool((K + V)[0] - self.energy - W.sum() > 1e3 * (self.scale + np.abs(W).sum()))

    def diverged(self, t: float, y: Array, why: str) -> DivergedError:
        """Return the error for a run that diverged at time t and state y; it names the fastest joint and a remedy."""
        return DivergedError(t, diverged_advice(why, self.equation.fastest_joint(y), self.setup))


def diverged_advice(why: str, joint: str, setup: Setup) -> str:
    """Describe why a run diverged, which joint moved fastest, and what to do, unless the loop explains it."""
    advice = f"take a smaller step than {setup.taken_step_s:g} s, or an implicit method"
    if setup.controller is not None and setup.controller.period_s:
        advice += f"; or, if the sampled loop is unstable, a shorter period than {setup.controller.period_s:g} s"
    return f"{why}; the fastest joint is {joint!r}: {advice}"
