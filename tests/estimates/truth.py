"""The truth of a scene: SciPy's DOP853 near rounding over `pin.aba` and torques written out here, cut at every switch.

It shares the numbers of a scene with the library, and the reference polynomial; no step, loop, effect or controller.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import robot_dyn as rd


def truth(setup: rd.Setup, times: np.ndarray, tolerance: float = 3e-14, longest: float = 1e-3) -> np.ndarray:
    """Positions at ascending times, (k, n)."""
    n, none, model = len(setup.q0), np.zeros(len(setup.q0)), setup.plant.dynamics.model
    data, law = model.createData(), setup.controller
    forces = [_force(model, data, effect) for effect in setup.plant.effects]
    period = law.period_s if law else 0.0
    ends = {0.0, setup.duration_s} | {t for effect in setup.plant.effects for t in effect.switches}
    ends |= set(law.knots if law else ())
    if period:
        ends |= {k * period for k in range(int(setup.duration_s / period + 2))}
    ends = sorted(t for t in ends if 0 <= t <= setup.duration_s)
    ends = [t for t, after in zip(ends, [*ends[1:], np.inf], strict=True) if after - t > 1e-12]
    stops = [effect for effect in setup.plant.effects if isinstance(effect, rd.JointStopSpring)]
    least = np.full(2 * n, tolerance / 10)
    for each in stops:
        least[n:] = np.maximum(least[n:], _rounding(model, setup.q0, each.stiffness))
    y, held, result = np.concatenate([setup.q0, setup.v0]), None, np.empty((len(times), n))
    result[times <= 0.0] = setup.q0
    for start, end in pairwise(ends):
        middle = (start + end) / 2
        acting = [force(middle) for force in forces]
        if period and abs(start / period - round(start / period)) < 1e-6:
            held = _control(law, model, data, start, y[:n], y[n:], start)

        def rate(t, y, acting=acting, held=held, middle=middle):
            q, v = y[:n], y[n:]
            u = none if law is None else held if period else _control(law, model, data, t, q, v, middle)
            for force in acting:
                u = u + force(q, v)
            return np.concatenate([v, pin.aba(model, data, q, v, u)])

        inside = (times > start) & (times <= end)
        at = np.union1d(times[inside], [end])
        solved = solve_ivp(
            rate, (start, end), y, "DOP853", at, rtol=tolerance, atol=least,
            max_step=longest if stops else np.inf,
        )  # fmt: skip
        assert solved.success, solved.message
        result[inside] = solved.y[:n, np.isin(at, times[inside])].T
        y = solved.y[:, -1]
    return result


def _rounding(model, q, stiffness) -> float:
    """What rounding of q by 4 u leaves of a velocity, 4 u ω: q enters the load with the stiffness.

    Pressed on a stop of ω = 1e4 rad/s, steps that ask for less of v shrink to 1e-6 s, since shorter ones alone make
    h ω² u small; they gain nothing.
    """
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    return (
        2 * np.finfo(float).eps * float(np.sqrt(np.linalg.eigvals(np.linalg.solve(M, np.diag(stiffness))).real.max()))
    )


def _force(model, data, effect) -> Callable[[float], Callable]:
    """Torque of an effect on (q, v), for the time at which it is asked."""
    if isinstance(effect, rd.ViscousFriction):
        return lambda t: lambda q, v: -effect.damping * v
    if isinstance(effect, rd.Spring):
        return lambda t: lambda q, v: -effect.stiffness * (q - effect.rest)
    if isinstance(effect, rd.RegularisedCoulombFriction):
        return lambda t: lambda q, v: -effect.friction * np.tanh(v / effect.velocity_scale)
    if isinstance(effect, rd.JointStopSpring):
        return lambda t: (
            lambda q, v: effect.stiffness * (np.maximum(effect.lower - q, 0) - np.maximum(q - effect.upper, 0))
        )
    if isinstance(effect, rd.JointStopDamper):
        return lambda t: (
            lambda q, v: -effect.damping * (np.maximum(effect.lower - q, 0) + np.maximum(q - effect.upper, 0)) * v
        )
    assert isinstance(effect, rd.ExternalWrench)
    frame = model.getFrameId(effect.frame)

    def wrench(t: float) -> Callable:
        on = effect.start_s <= t < effect.end_s

        def torque(q, v):
            if not on:
                return 0.0 * v
            J = pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED).reshape(6, -1)
            return J.T @ effect.wrench

        return torque

    return wrench


def _control(law, model, data, t: float, q, v, middle: float) -> np.ndarray:
    """Torque of PD or computed torque; the reference at t, on the side of its knots where `middle` lies."""
    plan = law.reference
    t = min(max(t, 0.0), np.nextafter(plan.breaks[-1], 0)) if middle < plan.breaks[-1] else t
    q_d, v_d, a_d = plan.at(t)
    if isinstance(law, rd.PD):
        return law.kp * (q_d - q) + law.kd * (v_d - v)
    own = law.model.model
    return pin.rnea(own, own.createData(), q, v, a_d + law.kp * (q_d - q) + law.kd * (v_d - v))
