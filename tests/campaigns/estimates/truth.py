"""The truth of a scene: SciPy's DOP853 near rounding over `pin.aba` and torques written out here, cut at every switch.

Windows, ticks and breaks are known times. Where a stop is touched or left, or a joint with bristles turns, is located
on SciPy's dense output, and the integration begins again there with the formulas of the other side.

It shares the numbers of a scene with the library, and the reference polynomial; no step, loop, event, effect or
controller.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853, solve_ivp
from scipy.optimize import brentq

import robot_dyn as rd

STOPS, BRISTLES = (
    (rd.effects.JointStopSpring, rd.effects.JointStopDamper),
    (rd.effects.LuGreFriction, rd.effects.DahlFriction),
)
_LOOKS = np.linspace(0, 1, 9)  # of a step: where guards are looked at
_DEEP, _SLOW = 1e-15, 1e-12  # [rad], [rad/s]: by which a level is passed


def truth(setup: rd.Setup, times: np.ndarray, tolerance: float = 3e-14, longest: float = 5e-3) -> np.ndarray:
    """Positions at ascending times, (k, n)."""
    n, none, model = len(setup.q0), np.zeros(len(setup.q0)), setup.plant.dynamics.model
    data, law, effects = model.createData(), setup.controller, setup.plant.effects
    bristles = [Bristles(effect) for effect in effects if isinstance(effect, BRISTLES)]
    stops = [effect for effect in effects if isinstance(effect, STOPS)]
    others = [each for each in effects if not isinstance(each, (*STOPS, *BRISTLES))]
    forces = [_force(model, data, effect) for effect in others]
    period = law.period_s if law else 0.0
    ends = {0.0, setup.duration_s} | {t for effect in effects for t in effect.switches}
    ends |= set(law.knots if law else ())
    if period:
        ends |= {k * period for k in range(int(setup.duration_s / period + 2))}
    ends = sorted(t for t in ends if 0 <= t <= setup.duration_s)
    ends = [t for t, after in zip(ends, [*ends[1:], np.inf], strict=True) if after - t > 1e-12]
    least = np.full((2 + len(bristles)) * n, tolerance / 10)
    for each in stops:
        if isinstance(each, rd.effects.JointStopSpring):
            least[n : 2 * n] = np.maximum(least[n : 2 * n], _rounding(model, setup.q0, each.stiffness))
    y = np.concatenate([setup.q0, setup.v0, *(none for _ in bristles)])
    held, result = None, np.empty((len(times), n))
    result[times <= 0.0] = setup.q0
    guards = _guards(stops, bool(bristles), n)
    for start, end in pairwise(ends):
        middle = (start + end) / 2
        acting = [force(middle) for force in forces]
        if period and abs(start / period - round(start / period)) < 1e-6:
            held = _control(law, model, data, start, y[:n], y[n : 2 * n], start)

        def rate(t, y, sides, acting=acting, held=held, middle=middle):
            q, v, z = y[:n], y[n : 2 * n], y[2 * n :].reshape(-1, n)
            u = none if law is None else held if period else _control(law, model, data, t, q, v, middle)
            for force in acting:
                u = u + force(q, v)
            for stop, (low, high) in zip(stops, guards.beyond(sides), strict=True):
                u = u + _stop(stop, q, v, low, high)
            rates = []
            for bristle, deflection in zip(bristles, z, strict=True):
                torque, bends = bristle.motion(v, guards.way(sides), deflection)
                u = u + torque
                rates.append(bends)
            return np.concatenate([v, pin.aba(model, data, q, v, u), *rates])

        y = _across(rate, guards, start, end, y, times, result, tolerance, least, longest)
    return result


def _across(rate, guards: Guards, t: float, end: float, y, times, result, tolerance: float, least, longest: float):
    """The state at the end of a segment, begun again wherever a guard changes its sign; positions are written."""
    n, sides = result.shape[1], guards.sides(y)
    while t < end:
        solver = DOP853(lambda t, y, sides=sides: rate(t, y, sides), t, y, end, rtol=tolerance, atol=least,
                        max_step=longest if len(sides) else np.inf)  # fmt: skip
        passed = None
        while solver.status == "running" and passed is None:
            solver.step()
            assert solver.status != "failed", f"at t = {solver.t}"
            passed = guards.first(solver, sides) if len(sides) else None
            until = solver.t if passed is None else passed[0]
            inside = (times > solver.t_old) & (times <= until)
            if inside.any():
                result[inside] = solver.dense_output()(times[inside])[:n].T
        if passed is None:
            return solver.y
        root, k = passed
        before, y = solver.t_old, solver.dense_output()(solver.t_old)
        if root > before:
            y = solve_ivp(
                lambda t, y, sides=sides: rate(t, y, sides), (before, root), y, "DOP853", rtol=tolerance, atol=least
            ).y[:, -1]
        t, sides = root, np.where(np.arange(len(sides)) == k, -sides, sides)
    return y


class Guards:
    """Coordinates of (q, v) that pass a level: q at a stop, v of a joint with bristles."""

    def __init__(self, rows: np.ndarray, levels: np.ndarray, n: int, stops: int) -> None:
        self.rows, self.levels, self.n, self.stops = rows, levels, n, stops
        self.slack = np.where(rows < n, _DEEP, _SLOW)

    def sides(self, y: np.ndarray) -> np.ndarray:
        """On which side of its level each is, 1 or −1."""
        return np.where(y[self.rows] >= self.levels, 1.0, -1.0)

    def beyond(self, sides: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Of each stop: whether each joint is beyond its lower and its upper one."""
        n = self.n
        return [
            (sides[2 * k * n : (2 * k + 1) * n] < 0, sides[(2 * k + 1) * n : (2 * k + 2) * n] > 0)
            for k in range(self.stops)
        ]

    def way(self, sides: np.ndarray) -> np.ndarray:
        """The sign of each velocity."""
        return sides[-self.n :]

    def first(self, solver: DOP853, sides: np.ndarray) -> tuple[float, int] | None:
        """The first that leaves its side in the latest step, and when; q is looked at where it turns, too."""
        dense, before, h = solver.dense_output(), solver.t_old, solver.t - solver.t_old
        at = before + h * _LOOKS
        states = dense(at)
        v = states[self.n : 2 * self.n]
        turns = np.argwhere(v[:, :-1] * v[:, 1:] < 0)
        more = [brentq(lambda s, j=j: dense(s)[self.n + j], at[k], at[k + 1], xtol=1e-15) for j, k in turns]
        at = np.union1d(at, more)
        rates = np.abs(np.diff(states[self.rows])).max(axis=1) * len(_LOOKS) / h
        slack = np.maximum(
            self.slack, 4 * np.spacing(solver.t) * rates
        )  # a root is known to a unit of time's last place
        left = sides[:, None] * (dense(at)[self.rows] - self.levels[:, None]) < -slack[:, None]
        if not left.any():
            return None
        found = []
        for k in np.flatnonzero(left.any(axis=1)):
            i = int(left[k].argmax())

            def gap(s: float, k=k) -> float:
                return sides[k] * (dense(s)[self.rows[k]] - self.levels[k])

            low = at[i - 1] if i else before
            found.append((brentq(gap, low, at[i], xtol=1e-16) if gap(low) > 0 else low, int(k)))
        return min(found)


def _guards(stops: list, bristles: bool, n: int) -> Guards:
    rows = [np.arange(n) for _ in stops for _ in range(2)] + [np.arange(n, 2 * n)] * bristles
    levels = [np.broadcast_to(x, n) for each in stops for x in (each.lower, each.upper)] + [np.zeros(n)] * bristles
    empty = np.zeros(0, int), np.zeros(0)
    return Guards(np.concatenate([empty[0], *rows]), np.concatenate([empty[1], *levels]), n, len(stops))


class Bristles:
    """LuGre's or Dahl's friction as smooth formulas of one sign of v."""

    def __init__(self, effect: Any) -> None:
        self.effect = effect

    def motion(self, v: np.ndarray, way: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Torque and rate of the deflection."""
        e = self.effect
        stiffness = e.bristle_stiffness
        if isinstance(e, rd.effects.DahlFriction):
            w = 1 - stiffness * z / e.coulomb * way
            return -stiffness * z, np.abs(w) ** (1.0 if e.exponent is None else e.exponent) * np.sign(w) * v
        level = e.coulomb + (e.static - e.coulomb) * np.exp(-((v / e.stribeck_velocity) ** 2))
        rate = v - stiffness * way * v * z / level
        return -(stiffness * z + e.bristle_damping * rate + e.viscous * v), rate


def _stop(stop, q, v, low, high) -> np.ndarray:
    """Torque of a stop beyond which each joint is, or is not."""
    below, above = np.where(low, stop.lower - q, 0.0), np.where(high, q - stop.upper, 0.0)
    return (
        stop.stiffness * (below - above)
        if isinstance(stop, rd.effects.JointStopSpring)
        else -stop.damping * (below + above) * v
    )


def _rounding(model, q, stiffness) -> float:
    """What rounding of q by 4 u leaves of a velocity, 4 u ω: q enters the load with the stiffness.

    Pressed on a stop of ω = 1e4 rad/s, steps that ask for less of v shrink to 1e-6 s, since shorter ones alone make
    h ω² u small; they gain nothing.
    """
    M = pin.crba(model, model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    fastest = np.linalg.eigvals(np.linalg.solve(M, np.diag(stiffness))).real.max()
    return 2 * np.finfo(float).eps * float(np.sqrt(fastest))


def _force(model, data, effect) -> Callable[[float], Callable]:
    """Torque of an effect on (q, v), for the time at which it is asked."""
    if isinstance(effect, rd.effects.ViscousFriction):
        return lambda t: lambda q, v: -effect.viscous * v
    if isinstance(effect, rd.effects.Spring):
        return lambda t: lambda q, v: -effect.stiffness * (q - effect.rest)
    if isinstance(effect, rd.effects.RegularisedCoulombFriction):
        return lambda t: lambda q, v: -effect.coulomb * np.tanh(v / effect.velocity_scale)
    assert isinstance(effect, rd.effects.ExternalWrench)
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
    if isinstance(law, rd.control.PD):
        return law.kp * (q_d - q) + law.kd * (v_d - v)
    own = law.model.model
    return pin.rnea(own, own.createData(), q, v, a_d + law.kp * (q_d - q) + law.kd * (v_d - v))
