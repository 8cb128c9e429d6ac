"""Independent joint control, with coupling as a disturbance: τ = kp e + kd ė + ki ∫ e dt, with e = q_d − q.

[Siciliano et al. 2009, sec. 8.3; Spong, Hutchinson, Vidyasagar 2006, ch. 6]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.control.controller import Controller, Stateless
from robot_dyn.control.reference import PiecewisePolynomial, numbers
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import (
    CoefficientField,
    OptionalCoefficientField,
    coefficient,
    default,
    with_values,
)
from robot_dyn.foundations.errors import ControlError, shown
from robot_dyn.foundations.saturation import initial_middle, limit_thresholds, piece, saturated
from robot_dyn.foundations.threshold import Threshold, smooth

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


STIFFNESS = coefficient("N m/rad", symbol="kp", minimum=0)
DAMPING = coefficient("N m s/rad", symbol="kd", minimum=0)


@final
@dataclass(frozen=True, eq=False)
class PD(Stateless):
    """Spring and damper toward the reference: τ = kp (q_d − q) + kd (v_d − v).

    Attributes:
        reference: q_d(t) of the n joints.
        kp: Stiffness, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        kd: Damping, a scalar or (n,), in [N m s/rad] or [N s/m], not negative.
        period_s: Sampling period, in [s]; 0 for continuous control.
    """

    reference: PiecewisePolynomial
    _: KW_ONLY
    kp: CoefficientField = field(metadata=STIFFNESS)
    kd: CoefficientField = field(metadata=DAMPING)
    period_s: float = 0.0

    term = "kp (q_d − q) + kd (v_d − v)"
    thresholds = smooth

    @property
    def n(self) -> int:
        return joint_count(self.reference)

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        q_d, v_d, _ = self.reference.at(t)
        return self.kp * (q_d - q) + self.kd * (v_d - v)


@final
@dataclass(frozen=True, eq=False)
class PID(Controller):
    """PD with an integral that does not wind up at an effort limit.

    The state z is the torque of the integral. If the desired torque u exceeds the limit, the excess is fed back:

        τ = sat(u),   u = kp e + kd ė + z,   ż = ki e + (sat(u) − u)/T_t

    so that at a constant error z settles at sat(u) + T_t ki e − kp e − kd ė instead of growing. Sampled, this is stable
    if the period is less than 2 T_t.

    Attributes:
        reference: q_d(t) of the n joints.
        kp: Proportional gain, a scalar or (n,), in [N m/rad] or [N/m], not negative.
        ki: Integral gain, a scalar or (n,), in [N m/(rad s)] or [N/(m s)], not negative.
        kd: Derivative gain, a scalar or (n,), in [N m s/rad] or [N s/m], not negative.
        effort_limit: Largest torque, a scalar or (n,), in [N m] or [N], positive; inf for no limit.
        tracking_time_s: T_t, in [s], positive; by default the largest √(kd/ki) of the joints.
        period_s: Sampling period, in [s]; 0 for continuous control.

    Source: Åström and Hägglund, PID Controllers, 1995, sec. 3.5 (back-calculation).
    """

    term = "sat(kp e + kd ė + z),  ż = ki e + (sat(u) − u)/T_t"

    reference: PiecewisePolynomial
    _: KW_ONLY
    kp: CoefficientField = field(metadata=STIFFNESS)
    ki: CoefficientField = field(metadata=coefficient("N m/(rad s)", symbol="ki", minimum=0))
    kd: CoefficientField = field(metadata=DAMPING)
    effort_limit: CoefficientField = field(
        default=default(np.inf), metadata=coefficient("N m", exclusive_minimum=0, infinite=True)
    )
    tracking_time_s: float | None = field(
        default=None, metadata=coefficient("s", shapes=((),), exclusive_minimum=0, can_vary=False)
    )
    period_s: float = 0.0
    _middle: OptionalCoefficientField = field(
        default=default(None), init=False, repr=False, metadata=coefficient("N m", can_vary=False)
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "_middle", initial_middle(self.effort_limit))
        if self.tracking_time_s is None:
            kd, ki = np.broadcast_arrays(self.kd, self.ki)
            acts = (kd > 0) & (ki > 0)
            time = np.sqrt((kd[acts] / ki[acts]).max()) if acts.any() else 1.0  # without ki nothing winds up
            object.__setattr__(self, "tracking_time_s", float(time))
        elif np.isinf(self.effort_limit).all():
            raise ControlError(
                "tracking_time_s has no effect without an effort_limit; give one, or remove tracking_time_s"
            )

    @property
    def n(self) -> int:
        return joint_count(self.reference)

    @property
    def state_size(self) -> int:
        return self.n

    @property
    def saturation(self) -> Array:
        return self.effort_limit

    def thresholds(self) -> tuple[Threshold, ...]:
        return limit_thresholds(self.effort_limit, self._middle, self.n)

    def on_side(self, sides: Mapping[Threshold, int]) -> PID:
        limit, middle = piece(self.effort_limit, self.n, sides)
        return with_values(self, {"effort_limit": limit, "_middle": middle})

    def demand(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return self._desired(t, q, v, z)[0]

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return self._saturated(self._desired(t, q, v, z)[0])

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        u, e = self._desired(t, q, v, z)
        return self.ki * e + (self._saturated(u) - u) / self.tracking_time_s

    def _desired(self, t: float, q: Array, v: Array, z: Array) -> tuple[Array, Array]:
        q_d, v_d, _ = self.reference.at(t)
        e = q_d - q
        return self.kp * e + self.kd * (v_d - v) + z, e

    def _saturated(self, u: Array) -> Array:
        return saturated(u, self.effort_limit, self._middle)


def gains_from(
    inertia_diagonal: ArrayLike, bandwidth_rad_s: ArrayLike, damping_ratio: ArrayLike = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Compute gains for the closed loop ë + 2 ζ ω ė + ω² e = 0 of a joint: kp = M_ii ω², kd = 2 ζ ω M_ii.

    For computed torque, which cancels the inertia, pass inertia 1.

    Args:
        inertia_diagonal: M_ii, a scalar or (n,), in [kg m²] or [kg], positive.
        bandwidth_rad_s: ω, the natural frequency, a scalar or (n,), in [rad/s], positive.
        damping_ratio: ζ, a scalar or (n,), 1 for critical damping, not negative.

    Raises:
        ControlError: If a value has the wrong sign or the shapes do not match.

    Source: Siciliano et al. 2009, sec. 8.3.1.
    """
    shapes = (), ("n",)
    inertia = numbers("inertia_diagonal", inertia_diagonal, *shapes, above=0)
    omega = numbers("bandwidth_rad_s", bandwidth_rad_s, *shapes, above=0)
    zeta = numbers("damping_ratio", damping_ratio, *shapes, least=0)
    if len({x.shape for x in (inertia, omega, zeta)} - {()}) > 1:
        shapes_text = f"{inertia.shape}, {omega.shape}, {zeta.shape}"
        raise ControlError(f"shapes of inertia_diagonal, bandwidth_rad_s, damping_ratio differ: {shapes_text}")
    with np.errstate(over="ignore"):
        kp, kd = inertia * omega**2, 2 * zeta * omega * inertia
    return numbers("kp = M_ii ω²", kp, (), ("n",)), numbers("kd = 2 ζ ω M_ii", kd, (), ("n",))


def joint_count(reference: object) -> int:
    """Return the number of joints of a joint reference; raise a ControlError for other values."""
    if not isinstance(reference, PiecewisePolynomial):
        raise ControlError(f"reference must be a PiecewisePolynomial, such as hold(q), got {shown(reference)}")
    return reference.n
