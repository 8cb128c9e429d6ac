"""Runs that reach an implausible speed, over 100 times a velocity limit, and steps that are too long as the cause.

No arm moves like that: an error estimate would be meaningless, and companion runs would take most of the time.
"""

from __future__ import annotations

from math import log

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.sentences import stated
from robot_dyn.foundations.values import cached
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import joint_types_of, unit
from robot_dyn.simulation.dynamics.fastest_motion import fastest, jacobian
from robot_dyn.simulation.dynamics.stability import below, excess_rate, longest_step
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind, line_parts
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.outcome import Ending, Outcome, Reason
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup

EXPLAINS = 1e3  # growth of deviations over a run
_TIMES = 100.0  # a velocity limit
_LIMIT = 100.0  # [rad/s] or [m/s] of a joint whose file states none


def speed_limits(setup: Setup) -> np.ndarray:
    """Return the largest plausible speed of each joint, (n,), in [rad/s] or [m/s]."""
    dynamics = setup.plant.dynamics
    limits = dynamics.velocity_limit if isinstance(dynamics, Robot) else np.full(dynamics.n, np.inf)
    return _TIMES * np.where((limits > 0) & np.isfinite(limits), limits, _LIMIT)


def runaway(setup: Setup, speeds: np.ndarray) -> dict[str, float | str]:
    """Return the joint that has passed its speed limit most, its speed and the limit; empty if none has.

    Args:
        setup: The setup of the run.
        speeds: Largest speed of each joint, (n,).
    """
    limits = cached(setup, speed_limits)
    if (speeds <= limits).all():
        return {}
    dynamics, joint = setup.plant.dynamics, int(np.argmax(np.nan_to_num(speeds / limits, nan=np.inf)))
    limit, unit_of_v = float(limits[joint]) / _TIMES, unit("v", joint_types_of(dynamics)[joint])
    return {"joint": dynamics.joint_names[joint], "value": float(speeds[joint]), "limit": limit, "unit": unit_of_v}


def step_too_long(setup: Setup, t: float, step_s: float | None = None) -> tuple[Remark, ...]:
    """Return a remark if a fixed step is too long to be stable at the start, and deviations grow by 1e3 until t.

    Args:
        setup: The setup of the run.
        t: Time reached, in [s].
        step_s: Longest step of the run, in [s]; None to find it from the setup.
    """
    method = setup.method
    if isinstance(method, Adaptive) or method.nonsmooth or setup.equation.canonical:
        return ()
    equation, step = setup.equation, setup.taken_step_s if step_s is None else step_s
    y, u_hold = equation.start(setup.q0, setup.v0), np.zeros(len(setup.q0)) if equation.sampled else None
    try:
        linear = method, jacobian(equation, 0.0, y, u_hold), len(setup.q0)
        if not excess_rate(*linear)(step) * t > log(EXPLAINS):
            return ()
        limit, motion = longest_step(*linear), fastest(equation, 0.0, y, u_hold)
    except (RobotDynError, np.linalg.LinAlgError):
        return ()
    facts = motion.facts | {"method": method.name, "step_s": below(limit)}
    return (Remark(RemarkKind.TOO_LONG, motion.joint, "v", 0.0, setup.duration_s, 0.0, step, limit, facts=facts),)


def runaway_outcome(setup: Setup, record: Recording, fast: dict[str, float | str]) -> Outcome:
    """Return the outcome of an implausibly fast run by fixed steps: diverged if its ledger does not close.

    Args:
        setup: The setup of the run.
        record: Recording of the run.
        fast: The joint that reached an implausible speed, see `runaway`.
    """
    outcome = record.outcome
    if outcome.ending is not Ending.FINISHED or setup.method.controls_error:
        return outcome
    if remarks := step_too_long(setup, outcome.t):
        facts = stated(line_parts(remarks[0].kind), remarks[0].fields)
        return Outcome(Reason.STEP_TOO_LONG, outcome.t, remarks[0].joint, facts)
    with np.errstate(all="ignore"):
        if ledger(setup.equation, record).closes:
            return outcome
    return Outcome(Reason.IMPLAUSIBLE_SPEED, outcome.t, str(fast["joint"]), fast | {"step_s": setup.taken_step_s})
