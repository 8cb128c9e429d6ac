"""Model-based control: τ = M(q)(a_d + kd ė + kp e) + C(q, v) v + N(q) gives ë + kd ė + kp e = 0.

If the model differs from the arm, M, C and N do not cancel, and the difference drives the error.
[Murray, Li, Sastry 1994, sec. 4.5; Siciliano et al. 2009, sec. 8.5]
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import final

from numpy.typing import ArrayLike

from robot_dyn.control.controller import Stateless, check_model
from robot_dyn.control.independent_joint import DAMPING, STIFFNESS, gains_from, joint_count
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import CoefficientField, coefficient
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.threshold import smooth
from robot_dyn.queries.dynamics import Dynamics


@dataclass(frozen=True, eq=False)
class ModelBased(Stateless):
    """A controller that tracks a reference with a model of the arm.

    Attributes:
        model: The controller's model of the arm.
        reference: Desired positions q_d(t) of the n joints.
        kp: Position gain, a scalar or (n,), nonnegative: in [1/s²] for computed torque, else in [N m/rad] or [N/m].
        kd: Velocity gain, a scalar or (n,), nonnegative: in [1/s] for computed torque, else in [N m s/rad] or [N s/m].
        period_s: Sampling period, in [s]; 0 for continuous control.

    Raises:
        ControlError: If the numbers of joints of model and reference differ, or a gain is invalid.
    """

    model: Dynamics
    reference: PiecewisePolynomial
    _: KW_ONLY
    kp: CoefficientField = field(metadata=STIFFNESS)
    kd: CoefficientField = field(metadata=DAMPING)
    period_s: float = 0.0

    thresholds = smooth

    def __post_init__(self) -> None:
        check_model(self.model)
        n, count = self.model.n, joint_count(self.reference)
        if n != count:
            raise ControlError(
                f"the model has {n} joints, but the reference has {count}; use a reference of {n} joints"
            )
        super().__post_init__()

    @property
    def n(self) -> int:
        return self.model.n


@final
@dataclass(frozen=True, eq=False, init=False)
class ComputedTorque(ModelBased):
    """Inverse dynamics in the loop (feedback linearisation): τ = M (a_d + kd ė + kp e) + C v + N.

    With an exact model, each joint obeys ë + kd ė + kp e = 0. Give the gains kp and kd, or the natural frequency ω and
    the damping ratio ζ of this equation: kp = ω², kd = 2 ζ ω.

    Args:
        model: The controller's model of the arm.
        reference: Desired positions q_d(t) of the n joints.
        kp: Position gain, a scalar or (n,), in [1/s²], not negative.
        kd: Velocity gain, a scalar or (n,), in [1/s], not negative.
        bandwidth_rad_s: ω, a scalar or (n,), in [rad/s], positive; instead of kp and kd.
        damping_ratio: ζ, a scalar or (n,), not negative; 1, critical damping, by default. Only with bandwidth_rad_s.
        period_s: Sampling period, in [s]; 0 for continuous control.

    Raises:
        ControlError: If neither or both of gains and bandwidth are given, or a value is invalid.

    Example:
        >>> arm = rd.load("planar_2r")
        >>> rd.control.ComputedTorque(arm, rd.control.hold([0.1, 0.2]), bandwidth_rad_s=20.0, damping_ratio=0.7)

    Source: Murray, Li, Sastry 1994, sec. 4.5.2; Siciliano et al. 2009, sec. 8.5.2.
    """

    kp: CoefficientField = field(kw_only=True, metadata=coefficient("1/s²", symbol="kp", minimum=0))
    kd: CoefficientField = field(kw_only=True, metadata=coefficient("1/s", symbol="kd", minimum=0))

    term = "M̂ (a_d + kd ė + kp e) + Ĉ v + N̂"

    def __init__(
        self,
        model: Dynamics,
        reference: PiecewisePolynomial,
        *,
        kp: ArrayLike | None = None,
        kd: ArrayLike | None = None,
        bandwidth_rad_s: ArrayLike | None = None,
        damping_ratio: ArrayLike | None = None,
        period_s: float = 0.0,
    ) -> None:
        if len({kp is None, kd is None, bandwidth_rad_s is not None}) > 1:
            raise ControlError("give bandwidth_rad_s, or both kp and kd")
        if bandwidth_rad_s is not None:
            kp, kd = gains_from(1.0, bandwidth_rad_s, 1.0 if damping_ratio is None else damping_ratio)
        elif damping_ratio is not None:
            raise ControlError(
                "damping_ratio has no effect together with kp and kd; remove it, or give bandwidth_rad_s"
            )
        values = {"model": model, "reference": reference, "kp": kp, "kd": kd, "period_s": period_s}
        for name, value in values.items():
            object.__setattr__(self, name, value)
        self.__post_init__()

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        q_d, v_d, a_d = self.reference.at(t)
        return self.model.inverse_dynamics(q, v, a_d + self.kd * (v_d - v) + self.kp * (q_d - q))


@final
class PDGravity(ModelBased):
    """PD with gravity compensation: τ = kp e + kd ė + N(q); asymptotically stable at a rest position if N is exact.

    Source: Siciliano et al. 2009, sec. 8.5.1; Takegaki and Arimoto, 1981.
    """

    term = "kp e + kd ė + N̂(q)"

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        q_d, v_d, _ = self.reference.at(t)
        return self.kp * (q_d - q) + self.kd * (v_d - v) + self.model.N(q)


@final
class FeedForward(ModelBased):
    """Inverse dynamics along the reference plus PD feedback: τ = M(q_d) a_d + C(q_d, v_d) v_d + N(q_d) + kp e + kd ė.

    Source: Siciliano et al. 2009, sec. 8.4.
    """

    term = "M̂ a_d + Ĉ v_d + N̂ at the reference + kp e + kd ė"

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        q_d, v_d, a_d = self.reference.at(t)
        feedback = self.kp * (q_d - q) + self.kd * (v_d - v)
        return self.model.inverse_dynamics(q_d, v_d, a_d) + feedback
