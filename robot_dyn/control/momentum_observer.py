"""The generalised momentum observer: external torque without accelerations, from q, v and the motor torque.

    r = K (p − p₀ − ∫ (τ + Cᵀ v − N + r) dt),  p = M v,   so that  ṙ = K (τ_ext − r)

Over an interval h, τ_ext has the mean (Δp − ∫ (τ + Cᵀ v − N) dt)/h, by the trapezoidal rule, and r follows it exactly:
r⁺ = e^(−K h) r + (1 − e^(−K h)) τ_ext. All gains K > 0 are stable.

[De Luca, Mattone, Sensorless robot collision detection and hybrid force/motion control, 2005; Haddadin, De Luca,
Albu-Schäffer, Robot collisions: a survey on detection, isolation, and identification, 2017]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.control.contact import ExternalTorque
from robot_dyn.control.controller import Controller, Enclosing, check_model, check_sampled
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import CoefficientField, coefficient, with_values
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.validate import function, instance, numbers, truth
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

Torque = Callable[[Array, Array], Array]
_EFFECTS = "(q, v), such as plant.torque"
_AT_REST = 0.01  # [rad] or [m]: largest motion of a joint at rest


@final
@dataclass(frozen=True, eq=False)
class MomentumObserver(Enclosing):
    """A sampled controller with an observer of the external torque, updated at each tick: ṙ = K (τ_ext − r).

    The inner controller computes the torque, which is constant between ticks, so its integral is exact. In a `Loop`,
    the observer receives the measured positions and velocities. `recorded` returns r of a run.

    Attributes:
        controller: A sampled controller.
        model: Model of the arm.
        bandwidth_rad_s: K, a scalar or (n,), in [rad/s], positive: r has the time constant 1/K.
        effects: Torque of the known effects as a function of (q, v), such as `plant.torque` with friction; None for
            gravity only.

    Raises:
        ControlError: If the controller is continuous or a loop, its joints are not those of the model, or a value is
            invalid.
    """

    controller: Controller
    model: Dynamics
    _: KW_ONLY
    bandwidth_rad_s: CoefficientField = field(
        metadata=coefficient("rad/s", symbol="K", exclusive_minimum=0, can_vary=False)
    )
    effects: Torque | None = None
    period_s: float = field(init=False, default=0.0)

    def __post_init__(self) -> None:
        check_sampled("controller", self.controller)
        check_model(self.model)
        if self.model.n != self.controller.n:
            raise ControlError(
                f"the model has {self.model.n} joints, but the controller has {self.controller.n}; use a model of the"
                " controlled arm"
            )
        function("effects", self.effects, _EFFECTS, error=ControlError)
        object.__setattr__(self, "period_s", self.controller.period_s)
        super().__post_init__()

    @property
    def n(self) -> int:
        return self.model.n

    @property
    def state_size(self) -> int:
        return self.controller.state_size + 4 * self.n + 1  # r, p, Cᵀ v − N, τ, and 1 after the first tick

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return self.controller.torque(t, q, v, z[: self.controller.state_size])

    def next_state(self, t: float, q: Array, v: Array, z: Array) -> Array:
        n, inside = self.n, z[: self.controller.state_size]
        r, p, rate, u, begun = (z[len(inside) + k * n : len(inside) + (k + 1) * n] for k in range(5))
        p_now, rate_now = _momentum(self.model, q, v), _rate(self.model, q, v)
        if self.effects is not None:
            rate_now = rate_now + self.effects(q, v)
        external = (p_now - p) / self.period_s - (rate + rate_now) / 2 - u
        decay = np.exp(-np.asarray(self.bandwidth_rad_s) * self.period_s)
        r = begun * (decay * r + (1 - decay) * external)
        u_now = self.controller.torque(t, q, v, inside)
        inside = self.controller.next_state(t, q, v, inside)
        return np.concatenate([inside, r, p_now, rate_now, u_now, np.ones(1)])

    def recorded(self, t: ArrayLike, z: ArrayLike | None) -> ExternalTorque:
        """Return the external torque of a run from `run.t` and `run.controller_states`, also if a loop encloses it.

        Raises:
            ControlError: If the states are not those of this observer.
        """
        t = numbers("t", t, ("m",), error=ControlError)
        z = numbers("z", z, (len(t), "k"), error=ControlError)
        first = self.controller.state_size
        if z.shape[1] < self.state_size:
            counts = f"z has {z.shape[1]} states, but the observer has {self.state_size}"
            raise ControlError(f"{counts}: pass run.controller_states of its run")
        return _result(self.model, t, z[:, first : first + self.n], np.zeros(self.n), self.bandwidth_rad_s)

    def at_period(self, period_s: float) -> Controller:
        inside = self.controller.at_period(period_s)
        return with_values(self, {"controller": inside, "period_s": period_s}) if period_s else inside

    def settled(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return np.concatenate([self.controller.settled(t, q, v, z), np.zeros(4 * self.n + 1)])


def external_torque(
    arm: Robot,
    t: ArrayLike,
    q: ArrayLike,
    v: ArrayLike,
    tau: ArrayLike,
    *,
    bandwidth_rad_s: ArrayLike,
    effects: Torque | None = None,
    rest_s: tuple[float, float] | None = None,
    zero_order_hold: bool = False,
) -> ExternalTorque:
    """Compute the external torque on the joints from a log, by the generalised momentum observer.

    Its sign is that of the joint torque: M a + C v + N = τ + τ_ext. Friction missing from `effects` appears in it.

    Args:
        arm: The robot.
        t: Times, (m,), in [s], increasing.
        q: Positions, (m, n), in [rad] or [m].
        v: Velocities, (m, n), in [rad/s] or [m/s].
        tau: Torques of the motors at the joints, (m, n), in [N m] or [N].
        bandwidth_rad_s: K, a scalar or (n,), in [rad/s], positive: r has the time constant 1/K.
        effects: Torque of the known effects as a function of (q, v), such as `plant.torque` with friction; None for
            gravity only.
        rest_s: Interval (from, to) without contact and motion, in [s]; the mean external torque in it is the offset,
            which is subtracted. None for no offset.
        zero_order_hold: True if each torque acts until the next sample, like commands of a controller; False if
            torques are samples of a sensor.

    Raises:
        ControlError: If an array has the wrong shape or unit, times do not increase, or the arm moves in `rest_s`.

    Source: De Luca, Mattone, Sensorless robot collision detection and hybrid force/motion control, 2005.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=ControlError)
    t = numbers("t", t, ("m",), error=ControlError)
    if len(t) < 2 or not (np.diff(t) > 0).all():
        raise ControlError("t must have at least two increasing times; sort the log and remove duplicates")
    shape = len(t), arm.n
    q, v, tau = (numbers(*x, shape, error=ControlError) for x in (("q", q), ("v", v), ("tau", tau)))
    K = numbers("bandwidth_rad_s", bandwidth_rad_s, (), (arm.n,), above=0, error=ControlError)
    function("effects", effects, _EFFECTS, error=ControlError)
    zero_order_hold = truth("zero_order_hold", zero_order_hold, error=ControlError)
    h, p, rate = np.diff(t)[:, None], _momentum(arm, q, v), _rate(arm, q, v)
    if effects is not None:
        rate = rate + numbers("effects(q, v)", effects(q, v), shape, error=ControlError)
    acting = tau[:-1] if zero_order_hold else (tau[:-1] + tau[1:]) / 2
    external = np.diff(p, axis=0) / h - (rate[:-1] + rate[1:]) / 2 - acting
    offset = np.zeros(arm.n) if rest_s is None else _offset(t, q, external, rest_s)
    decay = np.exp(-K * h)
    step, r = (1 - decay) * (external - offset), np.zeros((len(t), arm.n))
    for k in range(len(h)):
        r[k + 1] = decay[k] * r[k] + step[k]
    return _result(arm, t, r, offset, K)


def _momentum(model: Dynamics, q: Array, v: Array) -> Array:
    """Return p = M v, without the n × n matrices of a long log."""
    return model.inverse_dynamics(q, 0 * v, v) - model.N(q)


def _rate(model: Dynamics, q: Array, v: Array) -> Array:
    """Return the part of ṗ that follows from the model: Cᵀ v − N."""
    return model.coriolis_transpose(q, v) - model.N(q)


def _offset(t: np.ndarray, q: np.ndarray, external: np.ndarray, rest_s: tuple[float, float]) -> np.ndarray:
    """Return the mean external torque while the arm rests, (n,)."""
    start, end = numbers("rest_s", rest_s, (2,), error=ControlError)
    rests = (t >= start) & (t <= end)
    if rests.sum() < 2:
        raise ControlError(
            f"rest_s: only {rests.sum()} samples from {start:g} to {end:g} s, at least 2 are needed; the log is from"
            f" {t[0]:g} to {t[-1]:g} s"
        )
    moved = float(np.ptp(q[rests], axis=0).max())
    if moved > _AT_REST:
        raise ControlError(
            f"rest_s: a joint moves by {moved:.3g} from {start:g} to {end:g} s; give an interval in which the arm rests"
        )
    inside = rests[:-1] & rests[1:]
    return np.average(external[inside], axis=0, weights=np.diff(t)[inside])


def _result(model: Dynamics, t: np.ndarray, r: np.ndarray, offset: np.ndarray, K: Any) -> ExternalTorque:
    kinds = getattr(model, "joint_types", ("revolute",) * model.n)
    return ExternalTorque(model.joint_names, kinds, t, r, offset, np.broadcast_to(K, (model.n,)))
