"""The longest stable step of each method and the largest stable gain of a sampled PD, confirmed by runs.

The arm is held at a configuration by a PD with its gravity balanced, an equilibrium, and the viscous friction of its
file. Runs from near it judge: at 0.98 of a limit a push stays, at 1.02 it grows.

    growth = max ‖√M_ii δq_i‖ in the second half of the run / ‖√M_ii δq_i‖ at its start
    kp = ω² m,   kd = 2 ω m,   m the median of M_ii:   the largest ω at which ticks of the given period are stable
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import inf, isfinite, sqrt
from typing import final

import numpy as np

from robot_dyn import Plant, Robot, RobotDynError, Setup, Trajectory, simulate
from robot_dyn.accuracy import Advice, advice_about, at_rest
from robot_dyn.control import PDGravity, hold
from robot_dyn.effects import ViscousFriction
from robot_dyn.integrate import FIXED_STEP, Gauss, method
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending, Stability, StateEquation, jacobian, linearised, step_map
from robot_dyn.tools.stress.result import Limit
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import Gains

WITHIN, BEYOND = 0.98, 1.02  # of a limit
LEAST = 0.3  # of the true error: an estimate below misleads
_MOST = 1e3  # by which a push may grow within a limit, as the advisor counts it
_LEFT = 10.0  # a run whose push grows by more, of itself and of what it does within the limit, has left
_PUSH = 1e-6  # of the start, in [rad] or [m] of the joint of median inertia
_RATE = 1e3  # [1/s]: that times as much in [rad/s] or [m/s] at most, as motions that are faster move less
_TIMES = 400.0  # of the run, 1/|λ| of the fastest motion
_STEPS = 10  # of a method whose stages are iterated
_PARTS = 20  # of the run: the longest step that is judged
_PERIOD_S, _TICKS = 1e-3, 200  # of the sampled PD, and of its run
_WHAT = f"PD of ζ = 1 sampled at {_PERIOD_S:g} s, ω"
_RANGE, _SHARP = (1.0, 1e5), 1e-3  # of ω, in [rad/s]; relative


def held(robot: Robot, q: np.ndarray, gains: Gains, rate: float) -> Setup:
    """The arm at rest at q, held there; the run lasts so many times its fastest motion."""
    effects = [ViscousFriction(robot.damping)] if np.any(robot.damping) else []
    return Setup(
        Plant(robot, effects), q, duration_s=_TIMES / rate, controller=PDGravity(robot, hold(q), *gains),
        engine="interpreted",
    )  # fmt: skip


def step_limits(setup: Setup, seed: int, work: Work) -> Iterator[Limit]:
    """Each method of fixed step: its limit, and runs at 0.98 and 1.02 of it.

    Args:
        setup: As of `held`.
        seed: Of the push.
        work: Does it.
    """
    names = {name: f"step of {name}" for name in FIXED_STEP}
    known = work.do("linearisation", lambda _: _linearised(setup), tuple(names.values()))
    if known is None:
        return
    advice, J = known
    setup = replace(setup, duration_s=min(setup.duration_s, _TIMES / abs(advice.fastest.eigenvalue)))
    for name, piece in names.items():
        limit = work.do(piece, lambda budget, name=name: _judged_step(setup, name, advice, J, seed, budget))
        if limit is not None:
            yield limit


def _linearised(setup: Setup) -> tuple[Advice, np.ndarray]:
    """The advice at rest, and J there."""
    loop = StateEquation(setup.plant, setup.controller).in_a_mode
    ((t, y),) = at_rest(setup, loop)
    return advice_about(setup, at_rest), jacobian(loop, t, y, None)


def _judged_step(setup: Setup, name: str, advice: Advice, J: np.ndarray, seed: int, budget: Budget) -> Limit:
    """The limit of a method, with runs at both sides of it; without one, with steps as long as are judged.

    Where the stages of a method are iterated, every step is stable, and a run ends, and says so, where they are not
    found: a limit that is not sharp is neither reached nor kept.
    """
    limit = Limit("step", name, advice.fastest.joint, advice.limits[name], "s", state={"q": setup.q0.tolist()})
    at, iterates = setup.q0, isinstance(method(name), Gauss)
    try:
        unstable = isfinite(limit.value) and not iterates
        matrix = step_map(method(name), J, len(at))(BEYOND * limit.value) if unstable else J
        setup = _pushed(replace(setup, integrator=name), matrix, seed)
        if not isfinite(limit.value):
            setup = replace(setup, step_s=setup.duration_s / _PARTS)
            run = run_from_near(setup, at, budget, True)
            holds = not run.misleads and (run.stays or (iterates and not isfinite(run.growth)))
            within = f"step {setup.step_s:.3g} s: {run.description}"
            return replace(limit, joint="", within=within, confirmed=holds, setups=(setup,))
        if iterates:
            setup = replace(setup, duration_s=_STEPS * limit.value)
            limit = replace(limit, what=f"{name}, about where its stages are not found")
        setups = tuple(replace(setup, step_s=part * limit.value) for part in (WITHIN, BEYOND))
        within, beyond = run_from_near(setups[0], at, budget), run_from_near(setups[1], at, budget, not iterates)
    except RobotDynError as error:
        return replace(limit, within=f"not run: {error}")
    confirmed = within.stays and beyond.leaves(within) and not beyond.misleads
    if iterates:
        confirmed = False if any(not each.stays and isfinite(each.growth) for each in (within, beyond)) else None
    said = beyond.description + " AND DOES NOT SAY SO" * beyond.misleads
    return replace(limit, within=within.description, beyond=said, confirmed=confirmed, setups=setups)


def gain_limit(setup: Setup, seed: int, work: Work) -> Iterator[Limit]:
    """The largest frequency of a PD with ticks of 1 ms; nothing for lack of time.

    Args:
        setup: As of `held`.
        seed: Of the push.
        work: Does it.
    """
    setup = replace(setup, duration_s=_TICKS * _PERIOD_S, engine="auto")
    omega = work.do("largest gain", lambda budget: _largest(setup, budget))
    if omega is None:
        return
    limit = Limit("gain", _WHAT, "", omega, "rad/s")
    if not omega:
        yield replace(limit, within=f"unstable from ω = {_RANGE[0]:g} rad/s on")
    elif omega == inf:
        yield replace(limit, within=f"stable up to ω = {_RANGE[1]:g} rad/s")
    else:
        judged = work.do("largest gain, judged", lambda budget: _judged_gain(setup, limit, seed, budget))
        if judged is not None:
            yield judged


def _sampled(setup: Setup, omega: float) -> Setup:
    """The setup under a sampled PD of another frequency."""
    law = setup.controller
    inertia = law.kd**2 / (4 * law.kp)
    sampled = PDGravity(law.model, law.reference, inertia * omega**2, 2 * inertia * omega, _PERIOD_S)
    return replace(setup, controller=sampled)


def _largest(setup: Setup, budget: Budget) -> float:
    """The limit, by bisection; inf or 0 if there is none."""
    y = np.concatenate([setup.q0, np.zeros(len(setup.q0))])

    def stable(omega: float) -> bool:
        budget.check()
        try:
            loop = linearised(setup.plant, _sampled(setup, omega).controller, 0.0, y)
            return loop.growth(_PERIOD_S).verdict is not Stability.UNSTABLE
        except np.linalg.LinAlgError:  # it is not finite
            return False

    low, high = _RANGE
    if not stable(low):
        return 0.0
    if stable(high):
        return inf
    while high / low > 1 + _SHARP:
        middle = sqrt(low * high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return low


def _judged_gain(setup: Setup, limit: Limit, seed: int, budget: Budget) -> Limit:
    """What advisor and runs say on both sides of the limit."""
    both = [_sampled(setup, part * limit.value) for part in (WITHIN, BEYOND)]
    at, y = setup.q0, np.concatenate([setup.q0, setup.v0])
    loop = linearised(both[1].plant, both[1].controller, 0.0, y)
    start = _pushed(both[0], loop.matrix(_PERIOD_S), seed)
    setups = tuple(replace(each, q0=start.q0, v0=start.v0) for each in both)
    limit = replace(limit, state={"q": at.tolist()}, setups=setups)
    try:
        periods = [advice_about(each, at_rest).longest_period_s for each in both]
        within, beyond = (run_from_near(each, at, budget) for each in setups)
    except RobotDynError as error:
        return replace(limit, within=f"not run: {error}")
    agrees = periods[0] >= _PERIOD_S > periods[1]
    said = beyond.description + f"; THE ADVISOR TAKES IT FOR STABLE UP TO {periods[1]:.3g} s" * (not agrees)
    confirmed = agrees and within.stays and beyond.leaves(within)
    return replace(limit, within=within.description, beyond=said, confirmed=confirmed)


def _pushed(setup: Setup, matrix: np.ndarray, seed: int) -> Setup:
    """The setup with its start moved off the equilibrium: along what grows fastest, and a little along all positions.

    Args:
        setup: At an equilibrium.
        matrix: Of (q, v, ...) from a step or tick to the next: its largest eigenvalue is of what grows fastest.
        seed: Of the other positions.
    """
    n, units = len(setup.q0), _units(setup, setup.q0)
    values, modes = np.linalg.eig(matrix)
    mode = np.real(modes[:, np.argmax(np.abs(values))])
    q, v = mode[:n] * units, mode[n : 2 * n] * units
    size = _PUSH * np.median(units) / max(np.linalg.norm(q), np.linalg.norm(v) / _RATE)
    others = np.random.default_rng(seed).normal(size=n)
    q = size * (q + 0.1 * np.linalg.norm(q) * others / np.linalg.norm(others))
    return replace(setup, q0=setup.q0 + q / units, v0=setup.v0 + size * v / units)


def _units(setup: Setup, q: np.ndarray) -> np.ndarray:
    return np.sqrt(np.diagonal(setup.plant.dynamics.M(q)))


@final
@dataclass(frozen=True)
class PushedRun:
    """What a run from near an equilibrium did, and what it reports about itself.

    Attributes:
        growth: As above; inf if the run ended before its time.
        misleads: Whether it has left an equilibrium that the motion does not leave, and reports nothing of it.
        description: Both as text.
    """

    growth: float
    misleads: bool
    description: str

    @property
    def stays(self) -> bool:
        """Whether it stays near the equilibrium."""
        return self.growth < _MOST

    def leaves(self, within: PushedRun) -> bool:
        """Whether it leaves the equilibrium, and a run within the limit does not."""
        return self.growth > _LEFT * max(within.growth, 1.0)


def run_from_near(setup: Setup, at: np.ndarray, budget: Budget, numerical: bool = False) -> PushedRun:
    """Run a setup and look how far it goes from an equilibrium.

    Args:
        setup: From near the equilibrium.
        at: The equilibrium, (n,).
        budget: Of the run.
        numerical: Whether only errors of the method can make it go, so that its error estimate is looked at.

    Raises:
        OvertimeError: If the budget ends.
    """
    run, units = simulate(replace(setup, estimate_error=numerical), on_progress=budget.check), _units(setup, at)
    with np.errstate(over="ignore"):  # a run that diverged may be off by inf
        off = np.linalg.norm((run.q - at) * units, axis=1)
    late = off[run.t >= run.t[-1] / 2]
    finished = run.outcome.ending is Ending.FINISHED and bool(np.isfinite(late).all())
    growth = float(late.max() / np.linalg.norm((setup.q0 - at) * units)) if finished else inf
    how = f"the push grew {growth:.2g}-fold" if finished else f"{run.outcome.ending} at {run.outcome.t:.3g} s"
    said = says(run)
    estimated = 0.0 if run.error is None else run.error.largest
    silent = not said and estimated < LEAST * float(np.abs(run.q - at).max())
    misleads = numerical and finished and growth > _LEFT and silent
    return PushedRun(growth, misleads, f"{how}{f' ({said})' if said else ''}")


def says(run: Trajectory) -> str:
    """What a run says against itself, or of what it met; empty if its summary is clean."""
    description = [str(kind).replace("_", " ") for kind in dict.fromkeys(each.kind for each in run.remarks)]
    if run.error is not None and run.error.note:
        until = run.error.until_s
        description.append(f"error told up to {until:.3g} s only" if until else "no error told")
    if "does not close" in run.summary:
        description.append("the ledger does not close")
    return ", ".join(description)
