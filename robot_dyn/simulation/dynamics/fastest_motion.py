"""The fastest motion of a system: the largest eigenvalue of its Jacobian, with the joint and the effect that cause it.

    J x = λ x,   wᴴ J = λ wᴴ,   λ = Σ_k λ_k with λ_k = wᴴ (∂f_k/∂y) x / wᴴ x

f_k is the part of the state equation due to a force or the control; the rest is due to the rigid bodies. The
participation of entry i is |w_i x_i| / |wᴴ x|. [Hairer, Wanner 1996, IV.1; Pérez-Arriaga, Verghese, Schweppe 1982]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.effects.effect import numbered
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.sentences import Part, sentence
from robot_dyn.integrate.differences import by_state, rowwise
from robot_dyn.simulation.dynamics.state_equation import CONTROL, StateEquation

BODIES = "the motion of the bodies"
_FASTEST = "the fastest motion, at joint {moving_joint!r}, {motion} at a rate of {rate_per_s:.3g} 1/s due to "
MOTION: Part = _FASTEST + "{source!r}", _FASTEST + BODIES, "no force depends on the motion of {moving_joint!r}"
"""The sentence about the fastest motion, from `Fastest.facts`."""


@final
@dataclass(frozen=True)
class Fastest:
    """The fastest motion near a state.

    Attributes:
        eigenvalue: λ, in [1/s].
        joint: Name of the joint with the largest part in the motion.
        source: Name of the effect or control with the largest |λ_k|; "the motion of the bodies" if they
            contribute most.
    """

    eigenvalue: complex
    joint: str
    source: str

    @property
    def decays(self) -> bool:
        """True if the motion decays faster than it oscillates."""
        return -self.eigenvalue.real > abs(self.eigenvalue.imag)

    @property
    def facts(self) -> dict[str, float | str]:
        """The facts of `MOTION`: "decays" or "changes", |λ| in [1/s], joint and, unless it is the bodies, source."""
        if self.eigenvalue == 0:
            return {"moving_joint": self.joint}
        facts: dict[str, float | str] = {"motion": "decays" if self.decays else "changes", "moving_joint": self.joint}
        facts["rate_per_s"] = abs(self.eigenvalue)
        return facts if self.source == BODIES else facts | {"source": self.source}

    def __str__(self) -> str:
        return sentence((MOTION,), self.facts)


def jacobian(equation: StateEquation, t: float, y: Array, u_hold: Array | None) -> Array:
    """Return ∂y'/∂y by differences, without the work integrals, on which y' does not depend.

    Args:
        equation: The state equation.
        t: Time, in [s].
        y: State, (m,).
        u_hold: The actuation in zero-order hold, or None.
    """
    size, rate = len(y) - len(equation.sources), rowwise(lambda row: equation.rate(t, row, u_hold)[0])
    return by_state(rate, t, y, equation.widths).T[:size, :size]


def fastest(equation: StateEquation, t: float, y: Array, held: Array | None, *, oscillation: bool = False) -> Fastest:
    """Return the fastest motion near a state, by differences of the interpreted equation.

    Args:
        equation: The state equation, in (q, v).
        t: Time, in [s].
        y: State, (m,).
        held: The actuation in zero-order hold, or None.
        oscillation: True to leave out motions that decay faster than they oscillate.

    Raises:
        RobotDynError: If the equation cannot be evaluated near the state.
        numpy.linalg.LinAlgError: If the eigenvalues do not converge, or no motion oscillates.
    """
    n, J = equation.plant.dynamics.n, jacobian(equation, t, y, held)
    values, right = np.linalg.eig(J)
    candidates = np.abs(np.imag(values)) > np.abs(np.real(values)) if oscillation else np.full(len(values), True)
    if not candidates.any():
        raise np.linalg.LinAlgError("no motion oscillates")
    k = int(np.argmax(np.where(candidates, np.abs(values), -1.0)))
    x = right[:, k]
    left_values, left = np.linalg.eig(J.T)
    w = left[:, np.argmin(np.abs(left_values - values[k]))]
    if values[k] == 0:  # for example of a joint that moves freely
        return Fastest(0j, equation.plant.dynamics.joint_names[int(np.argmax(np.abs(x[:n])))], BODIES)
    part = np.abs(w * x)
    joint = int(np.argmax(part[:n] + part[n : 2 * n]))
    with np.errstate(all="ignore"):  # λ_k wᴴ x: wᴴ x is 0 for a defective λ, for example at critical damping
        parts = {name: w[n : 2 * n] @ (A @ x) for name, A in _accelerations(equation, t, y, held).items()}
        kinematic = w[:n] @ (J[:n] @ x)  # contribution of q' = v, which has no source
        parts[BODIES] = values[k] * (w @ x) - kinematic - sum(parts.values())
        source = max(reversed(parts), key=lambda name: np.nan_to_num(abs(parts[name]), nan=0.0))
    return Fastest(complex(values[k]), equation.plant.dynamics.joint_names[joint], source)


def _accelerations(equation: StateEquation, t: float, y: Array, held: Array | None) -> dict[str, Array]:
    """Return M⁻¹ ∂τ_k/∂(q, v, z) of the control and of each force, (n, 2 n + z), by name."""
    n, M = equation.plant.dynamics.n, equation.plant.M(y[: equation.plant.dynamics.n])
    size = 2 * n + equation.states
    accelerations = {}
    for k, name in enumerate(numbered(CONTROL, *(force.name for force in equation.plant.forces))):
        torque = rowwise(lambda x, k=k: _torque(equation, k, t, x, held))
        accelerations[name] = np.linalg.solve(M, by_state(torque, t, y[:size], equation.widths[:size]).T)
    return accelerations


def _torque(equation: StateEquation, k: int, t: float, x: Array, held: Array | None) -> Array:
    """Return the torque of the control, k = 0, or of force k − 1 at x = (q, v, z), (n,)."""
    n = equation.plant.dynamics.n
    q, v, z = x[:n], x[n : 2 * n], x[2 * n :]
    if k == 0:
        return equation.equation_of_motion.on_joints(equation.actuation(t, q, v, z, held))
    return equation.equation_of_motion.torques(t, q, v, (n,), z[equation.state_size :])[k - 1]
