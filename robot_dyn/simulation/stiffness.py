"""What makes a system stiff: the fastest eigenvalue of its Jacobian, the joint that takes part most, and the effect.

    J x = λ x,   wᴴ J = λ wᴴ,   λ = Σ_k λ_k with λ_k = wᴴ (∂f_k/∂y) x / wᴴ x

f_k is what a force or the control adds to the state equation; the rest is that of the rigid bodies. |w_i x_i| / |wᴴ x|
is the participation of entry i. [Hairer, Wanner 1996, IV.1; Pérez-Arriaga, Verghese, Schweppe 1982]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import EXPLICIT, STIFF
from robot_dyn.integrate.differences import by_state
from robot_dyn.simulation.record import Record
from robot_dyn.simulation.remarks import Kind, Remark
from robot_dyn.simulation.samples import ledger
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.state_equation import CONTROL, StateEquation, numbered

BODIES = "the motion of the bodies"
_LEAST_STEPS = 1000  # of a run that is looked at
_LOOKS = 9  # at steps of it
_BOUND = (4.0, 9.0)  # h |λ| of explicit steps that stability bounds: by 6.1 for DOP853, about which they go up and down
_WORTH = 1000  # steps yet to be made for which to begin again pays
FIRST_LOOK = 500  # steps of a run whose method is to be chosen, then after as many again as there were
_MEAN = 20  # steps whose mean length is looked at


@final
@dataclass(frozen=True)
class Fastest:
    """The fastest motion near a state.

    Attributes:
        eigenvalue: λ, in [1/s].
        joint: Name of the joint that takes part most.
        source: Name of the effect or of the control whose λ_k is the largest; BODIES if none is.
    """

    eigenvalue: complex
    joint: str
    source: str

    @property
    def decays(self) -> bool:
        """Whether it decays more than it oscillates."""
        return -self.eigenvalue.real > abs(self.eigenvalue.imag)

    def __str__(self) -> str:
        if self.eigenvalue == 0:
            return "nothing acts back on the motion"
        how = "decays" if self.decays else "changes"
        by = self.source if self.source == BODIES else repr(self.source)
        return f"the fastest motion {how} with {abs(self.eigenvalue):.1e} per second, of joint {self.joint!r}, by {by}"


class StiffError(Exception):
    """A run by an explicit method that another one is to make.

    Attributes:
        remark: Why.
    """

    def __init__(self, remark: Remark):
        super().__init__(remark.text)
        self.remark = remark


def changes_over(setup: Setup, equation: StateEquation, ends: Array, y: Array, held: Array | None) -> None:
    """StiffError if stability bounds the latest steps of an explicit method, and many more would follow.

    Args:
        setup: What is run.
        equation: The state equation where the run is.
        ends: Ends of its steps so far, in [s].
        y: The state at the last of them.
        held: The actuation in zero-order hold, or None.
    """
    t, h = float(ends[-1]), float(ends[-1] - ends[-1 - _MEAN]) / _MEAN
    if h * _WORTH > setup.duration_s - t:
        return
    try:
        motion = fastest(equation, t, y, held)
    except (RobotDynError, np.linalg.LinAlgError):
        return
    if _bounds(motion, h):
        remedy = f"made by {STIFF} in place of {EXPLICIT}"
        raise StiffError(_remark(motion, 0.0, t, t, remedy))


def _bounds(motion: Fastest, h: float) -> bool:
    """Whether stability bounds explicit steps of length h."""
    return motion.decays and _BOUND[0] < abs(motion.eigenvalue) * h < _BOUND[1]


def _remark(motion: Fastest, start: float, end: float, at: float, remedy: str) -> Remark:
    size = abs(motion.eigenvalue)
    return Remark(Kind.STIFF, motion.joint, "v", start, end - start, at, size, None, str(motion), remedy)


def bounded_by_stability(setup: Setup, equation: StateEquation, record: Record) -> tuple[Remark, ...]:
    """A remark if stability, and not the tolerance, bounds the steps of an explicit method that chooses them.

    That is where h |λ| is about the end of the stability domain in most of some steps, λ the fastest decay.
    [Hairer, Wanner 1996, IV.2, p. 21]
    """
    method, t, y = setup.integrator, record.walked.t, record.walked.y
    explicit = method.controls_error and method.plain and not method.needs_jacobian
    if not explicit or record.steps < _LEAST_STEPS or len(t) < _LEAST_STEPS:
        return ()
    held, found = np.zeros(equation.plant.dynamics.n) if equation.sampled else None, []
    for k in np.linspace(1, len(t) - 2, _LOOKS).astype(int):
        try:
            motion = fastest(equation, float(t[k]), y[k], held)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if _bounds(motion, float(t[k + 1] - t[k])):
            found.append((abs(motion.eigenvalue), k, motion))
    if len(found) <= _LOOKS // 2:
        return ()
    _, k, motion = max(found, key=lambda each: each[0])
    return (_remark(motion, 0.0, float(t[-1]), float(t[k]), f"take integrator={STIFF!r}"),)


def damped_oscillation(setup: Setup, equation: StateEquation, record: Record) -> Fastest | None:
    """What a stiff method damps with steps of any length near its own: an oscillation of more than a radian a step.

    None if the energy ledger closes, or nothing of the kind is found at some states of the run.
    """
    if not setup.integrator.stiff or ledger(equation, record).closes:
        return None
    t, y, held = record.walked.t, record.walked.y, np.zeros(equation.plant.dynamics.n) if equation.sampled else None
    for k in np.unique(np.linspace(0, len(t) - 2, _LOOKS).astype(int)):
        try:
            motion = fastest(equation, float(t[k]), y[k], held, oscillation=True)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if abs(motion.eigenvalue) * setup.taken_step_s > 1:
            return motion
    return None


def jacobian(equation: StateEquation, t: float, y: Array, held: Array | None) -> Array:
    """∂y'/∂y without the works, which do not act back, by differences.

    Args:
        equation: The state equation.
        t: Time, in [s].
        y: State, (m,).
        held: The actuation in zero-order hold, or None.
    """
    size = len(y) - len(equation.sources)

    def f(at: Any, states: Array) -> Array:
        rows = [equation.rate(t, row, held)[0] for row in states.reshape(-1, len(y))]
        return np.array(rows).reshape(states.shape)

    return np.moveaxis(by_state(f, t, y, equation.widths), 0, -1)[:size, :size]


def fastest(equation: StateEquation, t: float, y: Array, held: Array | None, *, oscillation: bool = False) -> Fastest:
    """The fastest motion near a state, by differences of the interpreted equation.

    Args:
        equation: The state equation, in (q, v).
        t: Time, in [s].
        y: State, (m,).
        held: The actuation in zero-order hold, or None.
        oscillation: Whether to pass over what decays more than it oscillates.

    Raises:
        RobotDynError: If the equation has no answer near the state.
        numpy.linalg.LinAlgError: If its eigenvalues are not found, or nothing oscillates.
    """
    n, J = equation.plant.dynamics.n, jacobian(equation, t, y, held)
    values, right = np.linalg.eig(J)
    among = np.abs(np.imag(values)) > np.abs(np.real(values)) if oscillation else np.full(len(values), True)
    if not among.any():
        raise np.linalg.LinAlgError("nothing oscillates")
    k = int(np.argmax(np.where(among, np.abs(values), -1.0)))
    x = right[:, k]
    others, left = np.linalg.eig(J.T)
    w = left[:, np.argmin(np.abs(others - values[k]))]
    if values[k] == 0:  # as of a joint in free flight
        return Fastest(0j, equation.plant.dynamics.joint_names[int(np.argmax(np.abs(x[:n])))], BODIES)
    part = np.abs(w * x)
    joint = int(np.argmax(part[:n] + part[n : 2 * n]))
    with np.errstate(all="ignore"):  # times wᴴ x, which is 0 where λ is defective, as of critical damping
        parts = {name: w[n : 2 * n] @ (A @ x) for name, A in _accelerations(equation, t, y, held).items()}
        kinematic = w[:n] @ (J[:n] @ x)  # q' = v, half of every oscillation
        parts[BODIES] = values[k] * (w @ x) - kinematic - sum(parts.values())
        source = max(reversed(parts), key=lambda name: np.nan_to_num(abs(parts[name]), nan=0.0))
    return Fastest(complex(values[k]), equation.plant.dynamics.joint_names[joint], source)


def _accelerations(equation: StateEquation, t: float, y: Array, held: Array | None) -> dict[str, Array]:
    """M⁻¹ ∂τ_k/∂(q, v, z) of the control and of each force, (n, 2 n + z), by name."""
    n, M = equation.plant.dynamics.n, equation.plant.M(y[: equation.plant.dynamics.n])
    size = 2 * n + equation.states
    made = {}
    for k, name in enumerate(numbered(CONTROL, *(force.name for force in equation.plant.forces))):

        def torque(at: Any, states: Array, k: int = k) -> Array:
            rows = states.reshape(-1, size)
            return np.array([_torque(equation, k, t, row, held) for row in rows]).reshape(*states.shape[:-1], n)

        made[name] = np.linalg.solve(M, by_state(torque, t, y[:size], equation.widths[:size]).T)
    return made


def _torque(equation: StateEquation, k: int, t: float, x: Array, held: Array | None) -> Array:
    n = equation.plant.dynamics.n
    q, v, z = x[:n], x[n : 2 * n], x[2 * n :]
    if k == 0:
        return equation.equation_of_motion.on_joints(equation.actuation(t, q, v, z, held))
    return equation.equation_of_motion.torques(t, q, v, (n,), z[equation.state_size :])[k - 1]
