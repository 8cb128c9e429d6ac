"""The speed at which Coriolis torque, and the payload at which gravity torque, passes an effort limit.

    s² |C(q, u) u|_i = τ_max,i,   |N_i(q) + m n_i(q)| = τ_max,i

u is a velocity whose largest entry is the velocity limit of its joint, and n the gravity torque of 1 kg at the tip.
Both are searched for over all configurations, and judged at 0.98 and 1.02 of the limit by the library's own
implementation, and by runs under a PD.
"""

from __future__ import annotations

import numpy as np

from robot_dyn import Lagrangian, Payload, Plant, Robot, RobotDynError, Setup, simulate
from robot_dyn.accuracy import Batch, evaluate
from robot_dyn.control import PDGravity, hold
from robot_dyn.effects import EffortLimit
from robot_dyn.queries import CORIOLIS_TORQUE, N
from robot_dyn.report import Budget
from robot_dyn.simulation import RemarkKind
from robot_dyn.tools.stress.confirm import BEYOND, WITHIN
from robot_dyn.tools.stress.finding import Limit
from robot_dyn.tools.stress.work import Work
from robot_dyn.tools.stress.worst import Gains, State, listed, worst

_LOOKS = 50  # states at which the tip is looked for
_HOLD_S = 0.05  # of a run that holds a payload
_SPEED = 1.0  # [rad/s] or [m/s], of joints without a velocity limit


def efforts(robot: Robot) -> np.ndarray:
    """Effort limits, inf where none is stated or it is 0, (n,)."""
    return np.where(robot.effort_limit > 0, robot.effort_limit, np.inf)


def speed_limit(robot: Robot, states: Batch, rng: np.random.Generator, work: Work) -> Limit | None:
    """The least multiple of the velocity limits at which Coriolis torque alone passes an effort limit.

    None for lack of time.
    """
    effort, most = efforts(robot), robot.velocity_limit
    most = np.where((most > 0) & np.isfinite(most), most, _SPEED)
    what = "Coriolis torque passes an effort limit, at a multiple of the velocity limits"
    of_joints = np.abs(states["v"]).max()
    states = states | {"v": states["v"] / of_joints * most}

    def direction(v: np.ndarray) -> np.ndarray:
        largest = np.abs(v / most).max(axis=-1, keepdims=True)
        return np.divide(v, largest, out=np.zeros_like(v), where=largest > 0)

    def measure(batch: Batch) -> np.ndarray:
        at = {"q": batch["q"], "v": direction(batch["v"])}
        return (np.abs(evaluate(robot, CORIOLIS_TORQUE, at)) / effort).max(axis=1)

    found = worst(states, rng, ("q", "v"), measure, work, "speed")
    if found is None:
        return None
    (sizes, state), none = found, "it has no torque on any joint with a limit"
    if not sizes["minimal"] > 1e-12:
        return Limit("speed", what, "", np.inf, "times", none, "", None)
    q, v, limit = state["q"], direction(state["v"]), float(sizes["minimal"]) ** -0.5
    return work.do("speed, judged", lambda _: _judged_speed(robot, q, v, limit, what))


def _judged_speed(robot: Robot, q: np.ndarray, v: np.ndarray, limit: float, what: str) -> Limit:
    """The torques at both sides of the limit by the library's own implementation."""
    own, effort = Lagrangian(robot), efforts(robot)
    joint = int(np.argmax(np.abs(robot.coriolis_torque(q, v)) / effort))
    parts = [float((np.abs(own.coriolis_torque(q, part * limit * v)) / effort).max()) for part in (WITHIN, BEYOND)]
    within, beyond = (f"{part:.3f} of the effort limit" for part in parts)
    confirmed = bool(parts[0] < 1 < parts[1])
    return Limit(
        "speed", what, robot.joint_names[joint], limit, "times", within, beyond, confirmed, listed({"q": q, "v": v})
    )


def payload_limit(
    robot: Robot, states: Batch, rng: np.random.Generator, gains: Gains | None, work: Work
) -> Limit | None:
    """The least mass at the tip at which gravity torque passes an effort limit; None for lack of time.

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
        return None
    what, loaded = f"gravity torque of a payload at {frame}", robot.with_(payload=Payload(frame, 1.0))

    def inverse_masses(batch: Batch) -> np.ndarray:
        """1/m of each joint, (S, n)."""
        own = evaluate(robot, N, batch)
        per_kg = evaluate(loaded, N, batch) - own
        spare = effort - np.sign(per_kg) * own
        made = np.abs(per_kg) / np.where(spare > 0, spare, 1e-300)
        return np.where(np.isfinite(effort), made, 0.0)

    found = worst(states, rng, ("q",), lambda batch: inverse_masses(batch).max(axis=1), work, "payload")
    if found is None:
        return None
    sizes, state = found
    q, largest = state["q"], float(sizes["minimal"])
    if not largest > 1e-12:
        return Limit("payload", what, "", np.inf, "kg", "it has no torque on any joint with a limit", "", None)
    joint = robot.joint_names[int(np.argmax(inverse_masses({"q": q[None]})[0]))]
    if largest > 1e250:
        alone = "gravity alone passes its effort limit"
        return Limit("payload", what, joint, 0.0, "kg", alone, "", None, listed(state))
    return work.do(
        "payload, judged", lambda until: _judged_payload(robot, state, Payload(frame, 1 / largest), joint, gains, until)
    )


def _judged_payload(
    robot: Robot, state: State, payload: Payload, joint: str, gains: Gains | None, budget: Budget
) -> Limit:
    """Whether the arm holds the payload on both sides of the limit."""
    q, frame, most = state["q"], payload.frame, payload.mass
    loads = [robot.with_(payload=Payload(frame, part * most)) for part in (WITHIN, BEYOND)]
    setups = () if gains is None else tuple(_held_by_pd(each, q, gains) for each in loads)
    (holds, within), (too_heavy, beyond) = (
        _holds(loaded, q, setup, budget) for loaded, setup in zip(loads, setups or (None, None), strict=True)
    )
    what, confirmed = f"gravity torque of a payload at {frame}", holds and not too_heavy
    return Limit("payload", what, joint, most, "kg", within, beyond, confirmed, listed(state), setups)


def _held_by_pd(loaded: Robot, q: np.ndarray, gains: Gains) -> Setup:
    """The arm held at q by a PD within its effort limits, its gravity balanced."""
    plant, law = Plant(loaded, [EffortLimit(efforts(loaded))]), PDGravity(loaded, hold(q), *gains)
    return Setup(plant, q, duration_s=_HOLD_S, controller=law, estimate_error=False, engine="interpreted")


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
    holds = part < 1 and not reached
    sags = part > 1 and reached
    return holds if holds or sags else not part < 1, f"{said}; a PD sags by {off:.1e} in {_HOLD_S:g} s"
