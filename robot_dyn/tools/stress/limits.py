"""Limits of step, gain of a sampled PD, speed and payload, checked at 0.98 and 1.02 of their values.

A PD with gravity compensation holds the arm at a configuration, an equilibrium, with the viscous friction of its file.
Runs from near the equilibrium check steps and gain: at 0.98 of a limit a perturbation stays small, at 1.02 it grows.

    growth = max ‖√M_ii δq_i‖ in the second half of the run / ‖√M_ii δq_i‖ at its start
    kp = ω² m,   kd = 2 ω m,   m the median of M_ii:   the largest ω at which ticks of the given period are stable
    s² |C(q, u) u|_i = τ_max,i,   |N_i(q) + m n_i(q)| = τ_max,i

u is a velocity with at least one entry at the velocity limit of its joint, and n the gravity torque of 1 kg at the tip.
Speed and payload are minimised over all configurations, and checked by the library's own Lagrangian, a payload also by
a run under a PD.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from math import inf, isfinite, sqrt
from typing import final

import numpy as np

from robot_dyn import Lagrangian, Payload, Plant, Robot, RobotDynError, Setup, Trajectory, simulate
from robot_dyn.accuracy import Advice, Batch, advice_about, at_rest, evaluate
from robot_dyn.control import PDGravity, hold
from robot_dyn.effects import EffortLimit, ViscousFriction
from robot_dyn.integrate import FIXED_STEP, GaussLegendre, method
from robot_dyn.queries import CORIOLIS_TORQUE, N
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending, RemarkKind, Stability, StateEquation, jacobian, linearised, step_map
from robot_dyn.tools.stress.result import Limit, WorstCase
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import NEGLIGIBLE, Gains, worst

_WITHIN, _BEYOND = 0.98, 1.02  # fractions of a limit
LEAST = 0.3  # fraction of the true error below which an estimate misleads
_MOST = 1e3  # largest growth of a perturbation within a limit, same as for the advisor
_LEFT = 10.0  # growth, absolute and relative to a run within the limit, from which a run has left the equilibrium
_PUSH = 1e-6  # perturbation of the start, in [rad] or [m] of the joint of median inertia
_RATE = 1e3  # [1/s]: largest ratio of the perturbation of velocities to it, because faster motions move less
_TIMES = 400.0  # duration of the run, in units of 1/|λ| of the fastest motion
_STEPS = 10  # number of steps of a method with iterated stages
_PARTS = 20  # the longest step is this part of the run
_PERIOD_S, _TICKS = 1e-3, 200  # period of the sampled PD, and ticks of its run
_RANGE, _SHARP = (1.0, 1e5), 1e-3  # range of ω, in [rad/s], and its relative tolerance
_LOOKS = 50  # number of states in the search for the tip
_HOLD_S = 0.05  # duration of a run that holds a payload
_SPEED = 1.0  # [rad/s] or [m/s], for joints without a velocity limit
_NO_TORQUE = "it exerts no torque on a joint with a limit"


def speed_limit(robot: Robot, states: Batch, rng: np.random.Generator, budget: Budget) -> Limit:
    """Return the smallest multiple of the velocity limits at which Coriolis torque alone exceeds an effort limit."""
    effort, own = _efforts(robot), Lagrangian(robot)
    most = np.where((robot.velocity_limit > 0) & np.isfinite(robot.velocity_limit), robot.velocity_limit, _SPEED)
    states = states | {"v": states["v"] / np.abs(states["v"]).max() * most}

    def direction(v: np.ndarray) -> np.ndarray:
        largest = np.abs(v / most).max(axis=-1, keepdims=True)
        return np.divide(v, largest, out=np.zeros_like(v), where=largest > 0)

    def measure(batch: Batch) -> np.ndarray:
        at = {"q": batch["q"], "v": direction(batch["v"])}
        return (np.abs(evaluate(robot, CORIOLIS_TORQUE, at)) / effort).max(axis=1)

    def holds(part: float) -> tuple[bool, str]:
        return _load(own.coriolis_torque(q, part * limit.value * v), effort)

    limit = Limit(
        "speed", "Coriolis torque exceeds an effort limit, at a multiple of the velocity limits", "", inf, "times"
    )
    case = worst(WorstCase("speed"), states, rng, ("q", "v"), measure, budget)
    if not case.minimal > NEGLIGIBLE:
        return replace(limit, within=_NO_TORQUE)
    q, v = np.array(case.state["q"]), direction(np.array(case.state["v"]))
    joint = robot.joint_names[int(np.argmax(np.abs(robot.coriolis_torque(q, v)) / effort))]
    limit = replace(limit, joint=joint, value=case.minimal**-0.5, state={"q": q.tolist(), "v": v.tolist()})
    return _judged(limit, holds)


def payload_limit(robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, budget: Budget) -> Limit:
    """Return the smallest mass at the tip at which gravity torque exceeds an effort limit.

    Args:
        robot: The robot.
        states: Random states.
        rng: Random generator of the search.
        gains: Gains of the PD that holds the payload; None if M is singular, so that runs are impossible.
        budget: Time budget of search and runs.
    """
    effort, frame, setups = _efforts(robot), _tip(robot, states), list[Setup]()
    kilogram = robot.with_(payload=Payload(frame, 1.0))

    def inverse_masses(batch: Batch) -> np.ndarray:
        """Return 1/m of each joint, (S, n)."""
        own = evaluate(robot, N, batch)
        per_kg = evaluate(kilogram, N, batch) - own
        spare = effort - np.sign(per_kg) * own
        return np.where(np.isfinite(effort), np.abs(per_kg) / np.where(spare > 0, spare, 1e-300), 0.0)

    def holds(part: float) -> tuple[bool, str]:
        """Check a part of the limit by the library's Lagrangian and, with gains, by a run."""
        loaded = robot.with_(payload=Payload(frame, part * limit.value))
        by_torque, load = _load(Lagrangian(loaded).N(q), effort)
        if gains is None:
            return by_torque, load
        plant, law = Plant(loaded, [EffortLimit(effort)]), PDGravity(loaded, hold(q), kp=gains[0], kd=gains[1])
        setup = Setup(plant, q, duration_s=_HOLD_S, controller=law, estimate_error=False, engine="interpreted")
        setups.append(setup)
        try:
            run = simulate(setup, on_progress=budget.check)
        except RobotDynError as error:
            return by_torque, f"{load}; not run: {error}"
        is_reached = any(remark.kind is RemarkKind.EFFORT_REACHED for remark in run.remarks)
        return not is_reached, f"{load}; a PD sags by {float(np.abs(run.q[-1] - q).max()):.1e} in {_HOLD_S:g} s"

    limit = Limit("payload", f"gravity torque of a payload at {frame}", "", inf, "kg")
    case = worst(WorstCase("payload"), states, rng, ("q",), lambda x: inverse_masses(x).max(axis=1), budget)
    if not case.minimal > NEGLIGIBLE:
        return replace(limit, within=_NO_TORQUE)
    q = np.array(case.state["q"])
    joint = robot.joint_names[int(np.argmax(inverse_masses({"q": q[None]})[0]))]
    limit = replace(limit, joint=joint, value=1 / case.minimal, state=case.state)
    if case.minimal > 1e250:
        return replace(limit, value=0.0, within="gravity alone exceeds the effort limit")
    return replace(_judged(limit, holds), setups=tuple(setups))


def _efforts(robot: Robot) -> np.ndarray:
    """Return the effort limits, (n,); inf where the file states none or 0."""
    return np.where(robot.effort_limit > 0, robot.effort_limit, np.inf)


def _load(torque: np.ndarray, effort: np.ndarray) -> tuple[bool, str]:
    """Return True if a torque is within the effort limits, and its largest fraction of them, in words."""
    part = float((np.abs(torque) / effort).max())
    return part < 1, f"{part:.3f} of the effort limit"


def _judged(limit: Limit, holds: Callable[[float], tuple[bool, str]]) -> Limit:
    """Check a limit at 0.98 and 1.02 of its value."""
    (is_held, within), (is_held_beyond, beyond) = holds(_WITHIN), holds(_BEYOND)
    return replace(limit, within=within, beyond=beyond, confirmed=is_held and not is_held_beyond)


def _tip(robot: Robot, states: Batch) -> str:
    """Return the frame at which a mass has the largest gravity torques, −Jᵀ g for 1 kg."""
    q, effort = states["q"][:_LOOKS], _efforts(robot)
    effort = np.where(np.isfinite(effort), effort, np.nanmin(effort[np.isfinite(effort)], initial=1.0))

    def torque(frame: str) -> float:
        per_kg = np.abs(np.einsum("skj,k->sj", robot.nan_rows.jacobian(q, frame)[:, :3], robot.gravity))
        return float((per_kg / effort).max(axis=1).mean())

    return max(robot.frame_names, key=torque)


def holding_setup(robot: Robot, q: np.ndarray, gains: Gains, rate: float) -> Setup:
    """Return a setup that holds the arm at rest at q, for 400 times 1/rate, with the rate of its fastest motion."""
    effects = [ViscousFriction(robot.damping)] if np.any(robot.damping) else []
    law = PDGravity(robot, hold(q), kp=gains[0], kd=gains[1])
    return Setup(Plant(robot, effects), q, duration_s=_TIMES / rate, controller=law, engine="interpreted")


def step_limits(setup: Setup, seed: int, work: Work) -> Iterator[Limit | None]:
    """Yield the limit of each method with a fixed step, with runs at 0.98 and 1.02 of it.

    Args:
        setup: Setup from `held`.
        seed: Seed of the perturbation.
        work: Execution within a time limit.
    """
    names = {name: f"step of {name}" for name in FIXED_STEP}
    linearisation = work.do("linearisation", lambda _: _linearised(setup), tuple(names.values()))
    if linearisation is not None:
        advice, J = linearisation
        setup = replace(setup, duration_s=min(setup.duration_s, _TIMES / abs(advice.fastest.eigenvalue)))
        for name, piece in names.items():
            yield work.do(piece, partial(_judged_step, setup, name, advice, J, seed))


def _linearised(setup: Setup) -> tuple[Advice, np.ndarray]:
    """Return the advice at rest, and J there."""
    loop = StateEquation(setup.plant, setup.controller).in_a_mode
    ((t, y),) = at_rest(setup, loop)
    return advice_about(setup, at_rest), jacobian(loop, t, y, None)


def _judged_step(setup: Setup, name: str, advice: Advice, J: np.ndarray, seed: int, budget: Budget) -> Limit:
    """Return the limit of a method, with runs on both sides of it; without a limit, with a run of the longest step.

    A method with iterated stages is stable for all steps; a run ends with a message if the iteration fails. Such a
    limit is not sharp, and is therefore neither confirmed nor refuted by its value.
    """
    limit = Limit("step", name, advice.fastest.joint, advice.limits[name], "s", state={"q": setup.q0.tolist()})
    at, iterates = setup.q0, isinstance(method(name), GaussLegendre)
    try:
        unstable = isfinite(limit.value) and not iterates
        matrix = step_map(method(name), J, len(at))(_BEYOND * limit.value) if unstable else J
        setup = _pushed(replace(setup, method=name), matrix, seed)
        if not isfinite(limit.value):
            setup = replace(setup, step_s=setup.duration_s / _PARTS)
            run = run_from_near(setup, at, budget, True)
            holds = not run.misleads and (run.stays or (iterates and not isfinite(run.growth)))
            within = f"step {setup.step_s:.3g} s: {run.description}"
            return replace(limit, joint="", within=within, confirmed=holds, setups=(setup,))
        if iterates:
            setup = replace(setup, duration_s=_STEPS * limit.value)
            limit = replace(limit, description=f"{name}, where the iteration of its stages begins to fail")
        setups = tuple(replace(setup, step_s=part * limit.value) for part in (_WITHIN, _BEYOND))
        within, beyond = run_from_near(setups[0], at, budget), run_from_near(setups[1], at, budget, not iterates)
    except RobotDynError as error:
        return replace(limit, within=f"not run: {error}")
    confirmed = within.stays and beyond.leaves(within) and not beyond.misleads
    if iterates:
        confirmed = False if any(not run.stays and isfinite(run.growth) for run in (within, beyond)) else None
    text = beyond.description + " AND DOES NOT REPORT IT" * beyond.misleads
    return replace(limit, within=within.description, beyond=text, confirmed=confirmed, setups=setups)


def gain_limit(setup: Setup, seed: int, budget: Budget) -> Limit:
    """Return the largest frequency of a PD with ticks of 1 ms, with reports of advisor and runs on both sides of it.

    Args:
        setup: Setup from `held`.
        seed: Seed of the perturbation.
        budget: Time budget of search and runs.
    """
    setup = replace(setup, duration_s=_TICKS * _PERIOD_S, engine="auto")
    at, y = setup.q0, np.concatenate([setup.q0, setup.v0])
    limit = Limit(
        "gain", f"PD of ζ = 1 sampled at {_PERIOD_S:g} s, ω", "", _largest_frequency(setup, y, budget), "rad/s"
    )
    if not 0 < limit.value < inf:
        within = f"stable up to ω = {_RANGE[1]:g} rad/s" if limit.value else f"unstable from ω = {_RANGE[0]:g} rad/s on"
        return replace(limit, within=within)
    both = [_sampled(setup, part * limit.value) for part in (_WITHIN, _BEYOND)]
    loop = linearised(both[1].plant, _law(both[1]), 0.0, y)
    start = _pushed(both[0], loop.matrix(_PERIOD_S), seed)
    setups = tuple(replace(sampled, q0=start.q0, v0=start.v0) for sampled in both)
    limit = replace(limit, state={"q": at.tolist()}, setups=setups)
    try:
        periods = [advice_about(sampled, at_rest).longest_period_s for sampled in both]
        within, beyond = (run_from_near(pushed, at, budget) for pushed in setups)
    except RobotDynError as error:
        return replace(limit, within=f"not run: {error}")
    agrees = periods[0] >= _PERIOD_S > periods[1]
    text = beyond.description + f"; THE ADVISOR REPORTS IT AS STABLE UP TO {periods[1]:.3g} s" * (not agrees)
    confirmed = agrees and within.stays and beyond.leaves(within)
    return replace(limit, within=within.description, beyond=text, confirmed=confirmed)


def _sampled(setup: Setup, omega: float) -> Setup:
    """Return the setup under a sampled PD of another frequency."""
    law = _law(setup)
    inertia = law.kd**2 / (4 * law.kp)
    sampled = PDGravity(law.model, law.reference, kp=inertia * omega**2, kd=2 * inertia * omega, period_s=_PERIOD_S)
    return replace(setup, controller=sampled)


def _law(setup: Setup) -> PDGravity:
    """Return the controller that `held` gave a setup."""
    assert isinstance(setup.controller, PDGravity)
    return setup.controller


def _largest_frequency(setup: Setup, y: np.ndarray, budget: Budget) -> float:
    """Return the largest stable ω, by bisection; inf if all are stable, 0 if none."""

    def stable(omega: float) -> bool:
        budget.check()
        try:
            loop = linearised(setup.plant, _law(_sampled(setup, omega)), 0.0, y)
            return loop.growth(_PERIOD_S).verdict is not Stability.UNSTABLE
        except np.linalg.LinAlgError:  # the matrix is not finite
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


def _pushed(setup: Setup, matrix: np.ndarray, seed: int) -> Setup:
    """Move the start off the equilibrium: along the fastest growing mode, and slightly along all positions.

    Args:
        setup: Setup at an equilibrium.
        matrix: Map of (q, v, ...) from a step or tick to the next; the mode belongs to its largest eigenvalue.
        seed: Seed of the other positions.
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
    """The outcome of a run from near an equilibrium, and its own report.

    Attributes:
        growth: Growth of the perturbation, see above; inf if the run ended early.
        misleads: True if the run left an equilibrium that the motion does not leave, without reporting it.
        description: Outcome and report as text.
    """

    growth: float
    misleads: bool
    description: str

    @property
    def stays(self) -> bool:
        """True if the run stays near the equilibrium."""
        return self.growth < _MOST

    def leaves(self, within: PushedRun) -> bool:
        """Return True if the run leaves the equilibrium, and a run within the limit does not."""
        return self.growth > _LEFT * max(within.growth, 1.0)


def run_from_near(setup: Setup, at: np.ndarray, budget: Budget, numerical: bool = False) -> PushedRun:
    """Run a setup and measure its distance from an equilibrium.

    Args:
        setup: Setup that starts near the equilibrium.
        at: The equilibrium, (n,).
        budget: Time budget of the run.
        numerical: True if only errors of the method can move it away, so that its error estimate is checked.

    Raises:
        OvertimeError: If the budget is exceeded.
    """
    run, units = simulate(replace(setup, estimate_error=numerical), on_progress=budget.check), _units(setup, at)
    with np.errstate(over="ignore"):  # a run that diverged may be off by inf
        off = np.linalg.norm((run.q - at) * units, axis=1)
    late = off[run.t >= run.t[-1] / 2]
    finished = run.outcome.ending is Ending.FINISHED and bool(np.isfinite(late).all())
    growth = float(late.max() / np.linalg.norm((setup.q0 - at) * units)) if finished else inf
    how = (
        f"a perturbation grew by a factor of {growth:.2g}"
        if finished
        else f"{run.outcome.ending} at {run.outcome.t:.3g} s"
    )
    report = says(run)
    estimated = 0.0 if run.error is None else run.error.largest
    silent = not report and estimated < LEAST * float(np.abs(run.q - at).max())
    misleads = numerical and finished and growth > _LEFT and silent
    return PushedRun(growth, misleads, f"{how}{f' ({report})' if report else ''}")


def says(run: Trajectory) -> str:
    """Return the remarks and warnings of a run; empty if its summary is clean."""
    description = [str(kind).replace("_", " ") for kind in dict.fromkeys(remark.kind for remark in run.remarks)]
    if run.error is not None and run.error.note:
        until = run.error.until_s
        description.append(f"error estimated up to {until:.3g} s only" if until else "no error estimate")
    if "does not close" in run.summary:
        description.append("the ledger does not close")
    return ", ".join(description)
