"""The truth of scenes with dry friction and rigid stops: SciPy's DOP853 in a mode, and modes found by trying them.

Behind an event the mode is the one, of all combinations of stuck and sliding joints, that contradicts nothing:

    stuck: a = 0 and −f ≤ λ ≤ f, without the bound on the side of a stop that is touched;   sliding: a in its direction

M is positive definite, so that there is one, unless friction of rest is above that of sliding: then either of two
joints may go on and hold the other, and no truth is known from there on. A joint that strikes and whose bounces still
to come take less than 1e-7 s is at rest; what its impact kicks off other stops goes on. Impacts obey v⁺ = −e v where
impulses push, v⁺ ≥ −e v elsewhere. It shares the numbers of a scene with the library, and the torques of `truth`; no
convex problem, mode, event or step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import combinations, islice, product

import numpy as np
import pinocchio as pin
from scipy.integrate import DOP853
from scipy.optimize import brentq

import robot_dyn as rd
from tests.campaigns.estimates.truth import _control, _force

_LOOKS = np.linspace(0, 1, 9)[1:]  # of a step: where guards are looked at
_AT_STOP, _STILL, _RESTS = 4e-15, 1e-11, 1e-7  # [rad], [rad/s]; and [s] that bounces still to come may take
_CROWDED, _CROWD = 20, 1e-6  # events, [s]
_SLACK = 1e-9  # of the torques that add up: a condition that holds at its limit


class Bodies:
    """The motion of a setup in a mode: signs of sliding joints, and which are stuck."""

    def __init__(self, setup: rd.Setup) -> None:
        model, self.n, self.law = setup.plant.dynamics.model, len(setup.q0), setup.controller
        self.model, self.data, effects = model, model.createData(), setup.plant.effects
        self.friction = [each for each in effects if isinstance(each, rd.effects.DryFriction)]
        stops = [each for each in effects if isinstance(each, rd.effects.RigidStops)]
        none = np.full(self.n, np.inf)
        known = (stops[0].lower, stops[0].upper, stops[0].restitution) if stops else (-none, none, 0)
        self.lower, self.upper, e = known
        self.e, self.stops = np.broadcast_to(np.asarray(e, float), self.n), bool(stops)
        others = [each for each in effects if not isinstance(each, rd.effects.DryFriction | rd.effects.RigidStops)]
        self.several = False  # whether more than one mode was possible behind an event
        self.forces = [_force(model, self.data, each)(0.0) for each in others]

    def M(self, q: np.ndarray) -> np.ndarray:
        return pin.crba(self.model, self.data, q).copy()

    def level(self, v: np.ndarray) -> np.ndarray:
        """Friction of sliding, all in all."""
        made = np.zeros(self.n)
        for each in self.friction:
            static = each.coulomb if each.static is None else each.static
            curve = 0.0 if each.stribeck_velocity is None else np.exp(-((v / each.stribeck_velocity) ** 2))
            made = made + each.coulomb + (static - each.coulomb) * curve
        return made

    @property
    def rough(self) -> np.ndarray:
        """Friction of rest, all in all."""
        levels = (x.coulomb if x.static is None else x.static for x in self.friction)
        return sum((np.broadcast_to(each, self.n) for each in levels), np.zeros(self.n))

    def applied(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torques of effects without friction and stops, and of the controller."""
        made = np.zeros(self.n)
        for force in self.forces:
            made = made + force(q, v)
        return made if self.law is None else made + _control(self.law, self.model, self.data, t, q, v, t)

    def load(self, t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """All torques but those of friction and stops."""
        return self.applied(t, q, v) - pin.nonLinearEffects(self.model, self.data, q, v)

    def motion(self, t: float, y: np.ndarray, way: np.ndarray, stuck: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A and the reactions of stuck joints."""
        q, v = y[: self.n], y[self.n :]
        if not stuck.any():
            return pin.aba(self.model, self.data, q, v, self.applied(t, q, v) - self.level(v) * way), np.zeros(self.n)
        M, left, a = self.M(q), self.load(t, q, v) - self.level(v) * way, np.zeros(self.n)
        free = ~stuck
        a[free] = np.linalg.solve(M[free][:, free], left[free])
        return a, np.where(stuck, M @ a - left, 0.0)

    def touched(self, q: np.ndarray) -> np.ndarray:
        """−1 at a lower stop, 1 at an upper one."""
        return np.where(q <= self.lower + _AT_STOP, -1, np.where(q >= self.upper - _AT_STOP, 1, 0))

    def mode(self, t: float, y: np.ndarray, way: np.ndarray, stuck: np.ndarray, forced: dict[int, int]):
        """The mode at a state: signs, and what is stuck; those nearest to the mode before are tried first."""
        v, side, rough = y[self.n :], self.touched(y[: self.n]), self.rough
        rests = np.flatnonzero((v == 0) & ((rough > 0) | (side != 0)))
        free = np.where(rough > 0, np.sign(v), 0.0)
        usual = [0 if stuck[i] and i not in forced else int(forced.get(i, 2)) for i in rests]
        best, least, motion = None, np.inf, np.zeros(self.n)
        two_levels = len(rests) > 1 and bool((rough > self.level(0 * v))[rests].any())
        for made in _nearest(usual, [[forced[i]] if i in forced else [0, -1, 1] for i in rests]):
            trial, held = free.copy(), np.zeros(self.n, bool)
            held[rests] = [each == 0 for each in made]
            trial[rests] = made
            a, reaction = self.motion(t, y, np.where(rough > 0, trial, 0.0), held)
            size = np.abs(self.load(t, y[: self.n], v)) + rough
            low = np.where(side > 0, -np.inf, -rough)
            high = np.where(side < 0, np.inf, rough)
            off = np.where(held, np.maximum(low - reaction, reaction - high), 0.0)
            diagonal = np.diag(self.M(y[: self.n]))
            off[rests] = np.where(held[rests], off[rests], -a[rests] * trial[rests] * diagonal[rests])
            off[rests] = np.where(~held[rests] & (side[rests] * trial[rests] > 0), np.inf, off[rests])
            worst = float((off / (size + 1e-300)).max(initial=0.0))
            if worst <= _SLACK and least <= _SLACK:
                self.several = self.several or np.abs(a - motion).max() > 1e-6 * (1 + np.abs(motion).max())
            elif worst < least:
                best, least, motion = (np.where(rough > 0, trial, 0.0), held), worst, a
            if least <= _SLACK and not two_levels:
                break
        assert best is not None
        assert least < 1e-6, f"no mode at t = {t}: {least}"
        return best

    def impact(self, q: np.ndarray, v: np.ndarray, still: np.ndarray) -> np.ndarray:
        """The velocity behind an impact: of all sets of joints that are pushed, the one without a contradiction."""
        side, M = self.touched(q), self.M(q)
        touching = np.flatnonzero(side * v >= 0) if self.stops else []
        touching = [i for i in touching if side[i] != 0]
        target = np.where(still, 0.0, -self.e * v)
        for size in range(1, len(touching) + 1):
            for pushed in combinations(touching, size):
                P = list(pushed)
                inverse = np.linalg.inv(M)
                impulse = np.linalg.solve(inverse[np.ix_(P, P)], target[P] - v[P])
                after = v + inverse[:, P] @ impulse
                after[P] = target[P]
                rest = [i for i in touching if i not in pushed]
                near = _SLACK * (np.abs(v).max() + 1e-300)
                if (side[P] * impulse <= 1e-12).all() and (side[rest] * (after[rest] - target[rest]) <= near).all():
                    return after
        raise AssertionError(f"no impact at {q}, {v}")


def _nearest(usual: list[int], choices: list[list[int]]) -> Iterator[tuple[int, ...]]:
    """All combinations, those that differ least from the usual one first."""
    n = len(usual)
    base = [u if u in each else each[0] for u, each in zip(usual, choices, strict=True)]
    for changes in range(n + 1):
        for where in combinations(range(n), changes):
            others = [[x for x in choices[i] if x != base[i]] for i in where]
            for made in product(*others):
                trial = list(base)
                for i, x in zip(where, made, strict=True):
                    trial[i] = x
                yield tuple(trial)


def nonsmooth_truth(setup: rd.Setup, times: np.ndarray, tolerance: float = 1e-13, longest: float = 5e-3) -> np.ndarray:
    """Positions at ascending times, (k, n)."""
    result = np.empty((len(times), len(setup.q0)))
    result[times <= 0] = setup.q0
    for _ in _modes(setup, times, result, tolerance, longest):
        pass
    return result


def time_of_event(setup: rd.Setup, count: int) -> float:
    """When event number `count` happens, or one with several modes behind it; the duration if there is none.

    Or where `_CROWDED` of them fall within `_CROWD`: stops throw joints at each other for ever, in less than floats
    resolve, and what velocity the truth leaves them, 1e-8 rad/s, is by chance.
    """
    none = np.empty(0), np.empty((0, len(setup.q0)))
    latest: list[float] = []
    for k, (t, several) in enumerate(islice(_modes(setup, *none, 1e-10, 1e-2), count), 1):
        latest = [*latest[1 - _CROWDED :], t]
        if several or k == count or (len(latest) == _CROWDED and t - latest[0] < _CROWD):
            return t
    return setup.duration_s


def _modes(setup: rd.Setup, times, result, tolerance: float, longest: float) -> Iterator[tuple[float, bool]]:
    """The times at which modes end, and whether several were possible then; positions are written to the result."""
    bodies, n, t = Bodies(setup), len(setup.q0), 0.0
    y = np.concatenate([setup.q0, setup.v0]).astype(float)
    ends = [each for each in (setup.controller.knots if setup.controller else ()) if 0 < each < setup.duration_s]
    y, way, stuck = _behind(bodies, t, y, np.zeros(n), np.zeros(n, bool), {})
    for end in [*sorted(ends), setup.duration_s]:
        while t < end:
            t, y, way, stuck = _until_event(bodies, t, end, y, way, stuck, times, result, tolerance, longest)
            yield t, bodies.several


def _until_event(bodies, t, end, y, way, stuck, times, result, tolerance, longest):
    """Go on in a mode up to an event or the end; the state and the mode behind it."""
    n = bodies.n

    def rate(at: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([np.where(stuck, 0.0, x[n:]), bodies.motion(at, x, way, stuck)[0]])

    guards = _guards(bodies, y, way, stuck)
    leaves = (bodies.touched(y[:n]) != 0) & ~stuck
    with np.errstate(divide="ignore", invalid="ignore"):  # so that a step does not end behind a bounce
        apex = np.where(leaves & (y[n:] != 0), np.abs(y[n:] / rate(t, y)[n:]), np.inf).min(initial=np.inf)
    first = min(apex / 2, longest, end - t)
    solver = DOP853(rate, t, y, end, rtol=tolerance, atol=tolerance / 10, max_step=longest, first_step=first)
    while True:
        solver.step()
        dense, before = solver.dense_output(), solver.t_old
        h, hits, lowest = solver.t - before, [], before
        for part in _LOOKS:
            at = before + part * h
            x = solver.y if part == 1 else dense(at)
            values = bodies_values(bodies, at, x, way, stuck)
            hits = [(k, g) for k, g in guards if g(x, values) < 0]
            if hits:
                break
            lowest = at
        if hits:
            roots = []
            for k, g in hits:

                def of(s: float, g=g, dense=dense) -> float:
                    return g(dense(s), bodies_values(bodies, s, dense(s), way, stuck))

                roots.append((brentq(of, lowest, at, xtol=1e-15) if of(lowest) > 0 else lowest, k, g))
            root, k, g = min(roots, key=lambda each: each[0])
            inside = (times > before) & (times < root)
            result[inside] = dense(times[inside])[:n].T if inside.any() else result[inside]
            x = _exact(rate, before, dense(before), root, tolerance)
            x, root = _polished(rate, root, x, lambda s, x, g=g: g(x, bodies_values(bodies, s, x, way, stuck)))
            return root, *_switched(bodies, root, x, way, stuck, k)
        inside = (times > before) & (times <= solver.t)
        if inside.any():
            result[inside] = dense(times[inside])[:n].T
        if solver.status != "running":
            return end, solver.y.copy(), way, stuck


def bodies_values(bodies: Bodies, t: float, x: np.ndarray, way: np.ndarray, stuck: np.ndarray) -> np.ndarray:
    """The reactions of stuck joints."""
    return bodies.motion(t, x, way, stuck)[1] if stuck.any() else np.zeros(bodies.n)


def _guards(bodies: Bodies, y: np.ndarray, way: np.ndarray, stuck: np.ndarray) -> list[tuple[tuple, Callable]]:
    """What ends a mode where it becomes negative, by joint and kind."""
    n, made, side, rough = bodies.n, [], bodies.touched(y[: bodies.n]), bodies.rough
    for i in range(n):
        if stuck[i]:
            if side[i] >= 0:
                made.append(((i, "breaks", -1), lambda x, r, i=i: rough[i] - r[i]))
            if side[i] <= 0:
                made.append(((i, "breaks", 1), lambda x, r, i=i: rough[i] + r[i]))
            continue
        if way[i]:
            made.append(((i, "stops", 0), lambda x, r, i=i: way[i] * x[n + i] + (1e-13 if y[n + i] == 0 else 0.0)))
        made.append(((i, "strikes", -1), lambda x, r, i=i: x[i] - bodies.lower[i]))
        made.append(((i, "strikes", 1), lambda x, r, i=i: bodies.upper[i] - x[i]))
    return made


def _exact(rate, t: float, y: np.ndarray, end: float, tolerance: float) -> np.ndarray:
    """The state at a time within a step, without dense output."""
    if end <= t:
        return y
    solver = DOP853(rate, t, y, end, rtol=tolerance, atol=tolerance / 10)
    while solver.status == "running":
        solver.step()
    return solver.y


def _polished(rate, t: float, y: np.ndarray, g) -> tuple[np.ndarray, float]:
    """The root of g near a state, by two Newton steps along a straight line."""
    for _ in range(2):
        f, eps = rate(t, y), 1e-7
        slope = (g(t + eps, y + eps * f) - g(t - eps, y - eps * f)) / (2 * eps)
        if slope == 0 or abs(shift := -g(t, y) / slope) > 1e-6:
            break
        t, y = t + shift, y + shift * f
    return y, t


def _switched(bodies: Bodies, t: float, y: np.ndarray, way, stuck, what):
    """The state and the mode behind an event."""
    (i, kind, side), n, forced = what, bodies.n, {}
    y = y.copy()
    y[n:][stuck] = 0.0
    if kind == "stops":
        y[n + i] = 0.0
    elif kind == "breaks":
        forced[i] = side
    else:
        y[i] = bodies.lower[i] if side < 0 else bodies.upper[i]
    return _behind(bodies, t, y, way, stuck, forced)


def _behind(bodies: Bodies, t: float, y: np.ndarray, way, stuck, forced):
    """Impacts, and the mode that follows."""
    n, y = bodies.n, y.copy()
    q, v = y[:n], y[n:]
    side = bodies.touched(q)
    q[:] = np.where(side < 0, bodies.lower, np.where(side > 0, bodies.upper, q))
    still, v0 = np.zeros(n, bool), v.copy()
    if (side * v > 0).any():
        v[:] = bodies.impact(q, v0, still)
        v[(np.abs(v) < _STILL)] = 0.0
        a = bodies.motion(t, y, np.sign(v) * (bodies.rough > 0), np.zeros(n, bool))[0]
        a_rest = _resting_acceleration(bodies, t, y)
        a = a if a_rest is None else a_rest
        back = (side * a > 0) & (side * v < 0) & (bodies.e < 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            still = back & (side * v0 > 0) & (2 * np.abs(v) < _RESTS * np.abs(a) * (1 - bodies.e))
        if still.any():
            v[:] = bodies.impact(q, v0, still)
            v[still] = 0.0
        forced = {}
    way, stuck = bodies.mode(t, y, way, stuck & (v == 0), {i: d for i, d in forced.items() if v[i] == 0})
    return y, way, stuck


def _resting_acceleration(bodies: Bodies, t: float, y: np.ndarray) -> np.ndarray | None:
    several = bodies.several
    try:
        way, stuck = bodies.mode(t, y, np.zeros(bodies.n), np.zeros(bodies.n, bool), {})
    except AssertionError:
        return None
    finally:
        bodies.several = several  # that was a question, no mode of the motion
    return bodies.motion(t, y, way, stuck)[0]
