"""The speed at which Coriolis torque, and the payload at which gravity torque, passes an effort limit.

    s² |C(q, u) u|_i = τ_max,i,   |N_i(q) + m n_i(q)| = τ_max,i

u is a velocity whose largest entry is the velocity limit of its joint, and n the gravity torque of 1 kg at the tip.
Both are searched for over all configurations, and judged at 0.98 and 1.02 of the limit by the library's own
implementation, and by runs under a PD.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from robot_dyn import Lagrangian, Payload, Plant, Robot, RobotDynError, Setup, simulate
from robot_dyn.accuracy import Batch, evaluate
from robot_dyn.control import PDGravity, hold
from robot_dyn.effects import EffortLimit
from robot_dyn.queries import CORIOLIS_TORQUE, N
from robot_dyn.report import Budget
from robot_dyn.simulation import RemarkKind
from robot_dyn.tools.stress.result import Limit
from robot_dyn.tools.stress.stability import BEYOND, WITHIN
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import Gains, State, listed, worst

_LOOKS = 50  # states at which the tip is looked for
_HOLD_S = 0.05  # of a run that holds a payload
_SPEED = 1.0  # [rad/s] or [m/s], of joints without a velocity limit
_NOTHING = 1e-12  # of an effort limit
_NO_TORQUE = "it has no torque on any joint with a limit"


def efforts(robot: Robot) -> np.ndarray:
    """Effort limits, inf where none is stated or it is 0, (n,)."""
    return np.where(robot.effort_limit > 0, robot.effort_limit, np.inf)


def speed_limit(robot: Robot, states: Batch, rng: np.random.Generator, work: Work) -> Iterator[Limit]:
    """The least multiple of the velocity limits at which Coriolis torque alone passes an effort limit.

    Nothing for lack of time.
    """
    most = np.where((robot.velocity_limit > 0) & np.isfinite(robot.velocity_limit), robot.velocity_limit, _SPEED)
    states = states | {"v": states["v"] / np.abs(states["v"]).max() * most}

    def direction(v: np.ndarray) -> np.ndarray:
        largest = np.abs(v / most).max(axis=-1, keepdims=True)
        return np.divide(v, largest, out=np.zeros_like(v), where=largest > 0)

    def measure(batch: Batch) -> np.ndarray:
        at = {"q": batch["q"], "v": direction(batch["v"])}
        return (np.abs(evaluate(robot, CORIOLIS_TORQUE, at)) / efforts(robot)).max(axis=1)

    found = worst(states, rng, ("q", "v"), measure, work, "speed")
    if found is None:
        return
    what = "Coriolis torque passes an effort limit, at a multiple of the velocity limits"
    largest, state = found[0]["minimal"], {"q": found[1]["q"], "v": direction(found[1]["v"])}
    if not largest > _NOTHING:
        yield Limit("speed", what, "", np.inf, "times", _NO_TORQUE)
        return
    limit = Limit("speed", what, "", largest**-0.5, "times")
    judged = work.do("speed, judged", lambda _: _judged_speed(robot, state, limit))
    if judged is not None:
        yield judged


def _judged_speed(robot: Robot, state: State, limit: Limit) -> Limit:
    """The torques at both sides of the limit by the library's own implementation."""
    q, v, own, effort = state["q"], state["v"], Lagrangian(robot), efforts(robot)
    joint = int(np.argmax(np.abs(robot.coriolis_torque(q, v)) / effort))
    parts = (float((np.abs(own.coriolis_torque(q, x * limit.value * v)) / effort).max()) for x in (WITHIN, BEYOND))
    within, beyond = parts
    return replace(
        limit, joint=robot.joint_names[joint], within=f"{within:.3f} of the effort limit",
        beyond=f"{beyond:.3f} of the effort limit", confirmed=within < 1 < beyond, state=listed(state),
    )  # fmt: skip


def payload_limit(
    robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, work: Work
) -> Iterator[Limit]:
    """The least mass at the tip at which gravity torque passes an effort limit; nothing for lack of time.

    Args:
        robot: The robot.
        states: Random ones.
        rng: Of the search.
        gains: Of the PD that holds it; None where M is singular, so that nothing can be run.
        work: Does it.
    """
    effort = efforts(robot)
    frame = work.do("tip, where a payload is heaviest", lambda _: _tip(robot, states), ("payload",))
    if frame is None:
        return
    loaded = robot.with_(payload=Payload(frame, 1.0))

    def inverse_masses(batch: Batch) -> np.ndarray:
        """1/m of each joint, (S, n)."""
        own = evaluate(robot, N, batch)
        per_kg = evaluate(loaded, N, batch) - own
        spare = effort - np.sign(per_kg) * own
        return np.where(np.isfinite(effort), np.abs(per_kg) / np.where(spare > 0, spare, 1e-300), 0.0)

    found = worst(states, rng, ("q",), lambda batch: inverse_masses(batch).max(axis=1), work, "payload")
    if found is None:
        return
    largest, state, what = found[0]["minimal"], found[1], f"gravity torque of a payload at {frame}"
    if not largest > _NOTHING:
        yield Limit("payload", what, "", np.inf, "kg", _NO_TORQUE)
        return
    joint = robot.joint_names[int(np.argmax(inverse_masses({"q": state["q"][None]})[0]))]
    limit = Limit("payload", what, joint, 1 / largest, "kg", state=listed(state))
    if largest > 1e250:
        yield replace(limit, value=0.0, within="gravity alone passes its effort limit")
        return
    judged = work.do("payload, judged", lambda until: _judged_payload(robot, frame, limit, gains, until))
    if judged is not None:
        yield judged


def _judged_payload(robot: Robot, frame: str, limit: Limit, gains: Gains | None, budget: Budget) -> Limit:
    """Whether the arm holds the payload on both sides of the limit, by a PD within its effort limits among others."""
    q, setups, judged = np.array(limit.state["q"]), list[Setup](), list[tuple[bool, str]]()
    for part in (WITHIN, BEYOND):
        loaded, setup = robot.with_(payload=Payload(frame, part * limit.value)), None
        if gains is not None:
            plant, law = Plant(loaded, [EffortLimit(efforts(loaded))]), PDGravity(loaded, hold(q), *gains)
            setup = Setup(plant, q, duration_s=_HOLD_S, controller=law, estimate_error=False, engine="interpreted")
            setups.append(setup)
        judged.append(_holds(loaded, q, setup, budget))
    (holds, within), (too_heavy, beyond) = judged
    return replace(limit, within=within, beyond=beyond, confirmed=holds and not too_heavy, setups=tuple(setups))


def _tip(robot: Robot, states: Batch) -> str:
    """The frame at which a mass has the largest gravity torques, −Jᵀ g of 1 kg."""
    q, effort = states["q"][:_LOOKS], efforts(robot)
    effort = np.where(np.isfinite(effort), effort, np.nanmin(effort[np.isfinite(effort)], initial=1.0))

    def torque(frame: str) -> float:
        per_kg = np.abs(np.einsum("skj,k->sj", robot.jacobian(q, frame, errors="nan")[:, :3], robot.gravity))
        return float((per_kg / effort).max(axis=1).mean())

    return max(robot.frame_names, key=torque)


def _holds(loaded: Robot, q: np.ndarray, setup: Setup | None, budget: Budget) -> tuple[bool, str]:
    """Whether an arm holds what it is loaded with, by our Lagrangian and by a run; with a description."""
    part = float((np.abs(Lagrangian(loaded).N(q)) / efforts(loaded)).max())
    said = f"{part:.3f} of the effort limit"
    if setup is None:
        return part < 1, said
    try:
        run = simulate(setup, on_progress=budget.check)
    except RobotDynError as error:
        return part < 1, f"{said}; not run: {error}"
    reached = any(each.kind is RemarkKind.EFFORT_REACHED for each in run.remarks)
    off = float(np.abs(run.q[-1] - q).max())
    holds = not reached if part < 1 else not (part > 1 and reached)
    return holds, f"{said}; a PD sags by {off:.1e} in {_HOLD_S:g} s"
