"""The modes of a run with dry friction or rigid stops: what ends a mode, and the state and the mode behind it.

    impact        v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched
    acceleration  that of least constraint, of the joints at rest; one that broke away moves the way it was let go

A joint that slides stops where v = 0, one that is held breaks away where the reaction λ leaves its interval. Impacts
that follow each other ever faster end where the sum of their intervals says, in one impulse that takes what velocity
their joint has left; what other joints do in that time is followed.
[Moreau 1988; Glocker 2001; Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, ch. 8]
"""

from __future__ import annotations

from typing import NamedTuple, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.convex import minimum
from robot_dyn.effects.effect import Conservative
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.effects.set_valued import Mode, settled
from robot_dyn.simulation.event import Occurrence
from robot_dyn.simulation.gaps import Coordinates, end_of_gap
from robot_dyn.simulation.state_equation import StateEquation

_ACCUMULATED = 1e-6  # [s] for all impacts that are still to come: what ends there has no effect beyond its square
_CROWDED = 20  # impacts within that time: they go on for ever, whatever the restitution
_STILL = 1e-14  # [rad/s] or [m/s]: joints this slow stop together with the one that stops
_STOP = {-1: "lower stop", 1: "upper stop"}


class Guard(NamedTuple):
    """A quantity that ends a mode where it passes a level.

    Attributes:
        joint: Its index among the coordinates: joints, then motors in a backlash.
        row: Entry of y, the rate of which it is if `rate`.
        level: The level, in the unit of q, v or λ.
        side: 1 where it must stay above, −1 where it must stay below.
        rate: Whether it is a reaction, the rate of an impulse.
    """

    joint: int
    row: int
    level: float
    side: int
    rate: bool


@final
class Modes:
    """The mode of a run.

    Args:
        equation: Its state equation, of effects without a mode.

    Attributes:
        whole: What is held now, and which way the others slide, of all coordinates.
    """

    def __init__(self, equation: StateEquation) -> None:
        self.equation, self.effects = equation, equation.equation_of_motion.set_valued
        self.stops = tuple(each for each in self.effects if isinstance(each, RigidStops))
        self._n = n = equation.plant.dynamics.n
        self.of = Coordinates(equation)
        self.laws, self.impulses = self.of.widened(self.effects), self.of.impulses
        self.whole = Mode(np.zeros(len(self.of.joints)), np.zeros(len(self.of.joints)))
        self._impacts: list[tuple[float, Array]] = []  # times of the latest, and the coordinates that struck
        rubs = (each.at_rest(np.zeros(n)).most > 0 for each in self.effects if not isinstance(each, RigidStops))
        self._rubs = self.of.wide(sum(rubs, start=np.zeros(n, bool)), False)  # what may stick where its velocity is 0

    def start(self, y: np.ndarray) -> None:
        """The mode at the start: all that may be held is, until the reactions are known."""
        x, v = y[self.of.rows], y[self.of.speeds]
        least, most = self._intervals(x)
        held = (v == 0) & ((least < 0) | (most > 0))
        self.whole = Mode(held.astype(float), np.sign(v), self.of.contact(held, y.copy()))

    @property
    def mode(self) -> Mode:
        """The mode of the joints."""
        n, whole = self._n, self.whole
        return Mode(whole.held[:n], whole.direction[:n], whole.contact)

    def follow(self, before: Modes) -> None:
        """Go on from the mode of the same effects on other bodies."""
        self.whole, self._impacts = before.whole, before._impacts

    @property
    def key(self) -> bytes:
        """The mode in bytes."""
        contact = b"" if self.whole.contact is None else self.whole.contact.tobytes()
        return self.whole.held.tobytes() + self.whole.direction.tobytes() + contact

    def joint(self, coordinate: int) -> int:
        """The joint of a coordinate."""
        return int(self.of.joints[coordinate])

    def _intervals(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        known = [each.at_rest(x) for each in self.laws]
        return sum(each.least for each in known), sum(each.most for each in known)  # pyright: ignore[reportReturnType]

    def guards(self, y: np.ndarray) -> list[Guard]:
        """What ends the mode at a state y."""
        n, of, made = self._n, self.of, []
        x, v, whole = y[of.rows], y[of.speeds], self.whole
        least, most = self._intervals(x)
        for i, (row, speed) in enumerate(zip(of.rows.tolist(), of.speeds.tolist(), strict=True)):
            if whole.held[i]:
                levels = ((float(least[i]), 1), (float(most[i]), -1))
                made += [Guard(i, int(of.impulses[i]), at, side, True) for at, side in levels if np.isfinite(at)]
                continue
            if whole.direction[i] and (self._rubs[i] or v[i] == 0):
                made.append(Guard(i, speed, 0.0, int(whole.direction[i]), False))
            ends = [(stops.lower, stops.upper) for stops in self.stops] if i < n else [(-of.level, of.level)]
            for both in ends:
                for level, side in zip(both, (1, -1), strict=True):
                    position = float(np.broadcast_to(level, n)[i] if i < n else level[i - n])
                    leaves = x[i] == position and v[i] == 0  # then its velocity is watched until it turns
                    if np.isfinite(position) and not leaves:
                        made.append(Guard(i, row, position, side, False))
        return made

    def after(
        self, t: float, y: np.ndarray, held: Array | None, guard: Guard | None
    ) -> tuple[np.ndarray, list[Occurrence]]:
        """The state behind an event, in a mode of its own from there on, and what happened.

        Args:
            t: Time, in [s].
            y: The state at the event.
            held: The actuation in zero-order hold.
            guard: What passed its level; None at the start of a run.
        """
        y, n, of, happened = y.copy(), self._n, self.of, []
        q, v = y[:n], y[n : 2 * n]
        for stops in self.stops:
            q[:] = stops.snapped(q)
        v[(np.abs(v) <= _STILL) & self._rubs[:n]] = 0.0
        forced: dict[int, int] = {}
        if guard is not None and guard.rate:
            forced[guard.joint] = guard.side
        elif guard is not None:
            y[guard.row] = guard.level
        of.snap(y)
        y[self.impulses] = 0.0
        before, M = self.whole, self.equation.plant.M(q)
        for stops in self.stops or (None,) * bool(of.gaps):
            side = of.wide(np.zeros(n, int) if stops is None else stops.touched(q), of.ends(y[of.rows]))
            if (side * y[of.speeds] > 0).any():
                happened += self._struck(t, y, held, M, stops, side)
        forced = {i: way for i, way in forced.items() if y[of.speeds[i]] == 0}  # the impact may have thrown it back
        found = settled(self.laws, *self._bodies(t, y, held, M), y[of.rows], y[of.speeds], forced)[1]
        self.whole = found._replace(contact=of.contact(found.held, y))
        struck = {each.joint for each in happened}
        names = self.equation.plant.dynamics.joint_names
        others = [i for i, joint in enumerate(of.joints) if names[joint] not in struck]
        return y, happened + [each for i in others if (each := self._changed(i, before, t, y))]

    def _struck(
        self, t: float, y: np.ndarray, held: Array | None, M: np.ndarray, stops: RigidStops | None, side: np.ndarray
    ) -> list[Occurrence]:
        """The impact, with those that end behind it, its work in y."""
        n, of = self._n, self.of
        start, speeds = y.copy(), y[of.speeds]
        strike = np.flatnonzero(side * speeds > 0)
        e = of.wide(np.broadcast_to(0.0 if stops is None else stops.restitution, n).astype(float), of.restitution)
        whole = self._bodies(t, y, held, M)[0]
        self._impacts = [each for each in self._impacts if t - each[0] < _ACCUMULATED] + [(t, strike)]
        v = _impact(whole, speeds, side, e, np.zeros(len(e), bool))
        after, ended = self._ended(t, y, held, M, v, side, e)
        of_gaps = of.take(y, after)
        if stops is not None:
            v, before = y[n : 2 * n], start[n : 2 * n]
            y[self._work(stops)] += (v + before) @ M @ (v - before) / 2 - of_gaps
        rests = ended < np.inf
        return [
            self._occurrence(
                i, f"{'comes to rest at' if rests[i] else 'strikes'} {self._place(i, int(side[i]))}",
                t + (float(ended[i]) if rests[i] else 0.0), y, int(side[i]),
            )
            for i in strike.tolist()
        ]  # fmt: skip

    def _ended(
        self, t: float, y: np.ndarray, held: Array | None, M: np.ndarray, v: np.ndarray, side: np.ndarray, e: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The velocity (N,) behind the bounces that follow an impact, and in how long each of their joints rests, (N,).

        inf for joints that go on. The stop of a joint pushes that joint alone: its bounces together are one impulse
        that takes the velocity it has behind the impact. It is not known where another joint strikes in their time.
        """
        of, y, after, ended = self.of, y.copy(), v, np.full(len(e), np.inf)
        crowded = len(self._impacts) >= _CROWDED  # as several stops in turn
        while True:  # each joint once, since those at rest do not return
            of.take(y, after)
            whole, load = self._bodies(t, y, held, M)
            a = settled(self.laws, whole, load, y[of.rows], y[of.speeds])[0]
            if crowded and (turns := self._in_turn(after, a, side) & (ended == np.inf)).any():
                ended[turns] = 0.0
                after = _impact(whole, v, side, e, ended < np.inf)
                continue
            left, meets = _lasts(after, a, side, 0 * e if crowded else e), self._meets(y, a)
            first = int(np.argmin(left))  # the others are kicked by its bounces, and then loaded with it at rest
            meets[first] = np.inf
            if not left[first] < _ACCUMULATED or (left[first] > meets.min() and not crowded):
                return after, ended
            ended[first] = left[first]
            after = _impact(whole, v, side, e, ended < np.inf)

    def _in_turn(self, v: np.ndarray, a: np.ndarray, side: np.ndarray) -> np.ndarray:
        """Which coordinates throw each other at their stops, faster and faster, (N,): all of them end with v = 0."""
        strikes = np.bincount(np.concatenate([each for _, each in self._impacts]), minlength=len(v))
        return (strikes > 1) & (side != 0) & (np.abs(v) < _ACCUMULATED * np.abs(a).max())

    def _meets(self, y: np.ndarray, a: np.ndarray) -> np.ndarray:
        """In how long each coordinate meets a stop or an end of its gap, at accelerations that stay, (N,)."""
        n, of = self._n, self.of
        x, v, meets = y[of.rows], y[of.speeds], np.full(len(a), np.inf)
        known = [(each.lower, each.upper) for each in self.stops] or [(-np.inf, np.inf)]
        for each in known:
            lower, upper = (np.broadcast_to(level, n).astype(float) for level in each)
            meets = np.fmin(meets, _falls(x - of.wide(lower, -of.level), v, a))
            meets = np.fmin(meets, _falls(of.wide(upper, of.level) - x, -v, -a))
        return meets

    def _place(self, i: int, side: int) -> str:
        """What a coordinate touches, in words."""
        return f"its {_STOP[side]}" if i < self._n else end_of_gap(side)

    def _work(self, stops: RigidStops) -> int:
        """The entry of y that is the work of stops."""
        works = [each for each in self.equation.plant.forces if not isinstance(each, Conservative)]
        first = self.equation.size - len(self.equation.sources) + 1
        return first + next(i for i, each in enumerate(works) if each is stops)

    def _bodies(self, t: float, y: np.ndarray, held: Array | None, M: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The mass matrix of all coordinates, and all torques but the reactions, less C v and ∂V/∂q."""
        equation, motion = self.equation, self.equation.equation_of_motion
        q, v, z, _ = equation.state(y)
        u = equation.actuation(t, q, v, z, held)
        total = sum(motion.torques(t, q, v, z=z[equation.state_size :]), start=motion.on_joints(u))
        return self.of.bodies(M, total - equation.plant.dynamics.inverse_dynamics(q, v, 0 * v), u, y)

    def _changed(self, i: int, before: Mode, t: float, y: np.ndarray) -> Occurrence | None:
        """What the change of the mode is for a coordinate, in words."""
        if i < self._n:
            touched = next((int(side) for each in self.stops if (side := each.touched(y[: self._n])[i])), 0)
        else:
            touched = int(self.of.ends(y[self.of.rows])[i - self._n])
        was, held = before.held[i], self.whole.held[i]
        way, direction = before.direction[i], self.whole.direction[i]
        if held and not was:
            return self._occurrence(i, f"rests at {self._place(i, touched)}" if touched else "sticks", t, y, 0)
        if was and not held:
            word = f"leaves {self._place(i, touched)}" if touched == -direction and touched else "slides"
            return self._occurrence(i, word, t, y, int(direction))
        if way * direction < 0 and y[self.of.speeds[i]] == 0 and self._rubs[i]:
            return self._occurrence(i, "reverses", t, y, int(direction))
        return None

    def _occurrence(self, i: int, what: str, t: float, y: np.ndarray, direction: int) -> Occurrence:
        n, joint = self._n, self.equation.plant.dynamics.joint_names[self.joint(i)]
        return Occurrence(t, f"{joint} {what}", direction, tuple(y[:n].tolist()), tuple(y[n : 2 * n].tolist()), joint)


def _lasts(v: np.ndarray, a: np.ndarray, side: np.ndarray, e: np.ndarray) -> np.ndarray:
    """How long the bounces of each joint that leaves its stop at v still take, Σ 2 eᵏ |v| / |a|; inf for the others."""
    returns = (side * a > 0) & (side * v < 0) & (e < 1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(returns, 2 * np.abs(v) / (np.abs(a) * (1 - e)), np.inf)


def _falls(d: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """The time t > 0 at which d + v t + a t²/2 first vanishes, d ≥ 0, for each; nan where it never does, or rests."""
    with np.errstate(divide="ignore", invalid="ignore"):
        root = np.sqrt(v * v - 2 * a * d)
        return np.where(v > 0, np.where(a < 0, (v + root) / -a, np.nan), 2 * d / (root - v))


def _impact(M: np.ndarray, v: np.ndarray, side: np.ndarray, e: np.ndarray, still: np.ndarray) -> np.ndarray:
    """The velocity behind an impact at the stops on those sides; friction is finite, and takes no part.

    Joints that are to be still have 0: a projection in the norm of M, which adds no energy.
    """
    n = len(v)
    bound = np.where(still, -v, -(1 + e) * v)
    meets = side * v >= 0
    lower = np.where((side < 0) & meets | still, bound, -np.inf)
    upper = np.where((side > 0) & meets | still, bound, np.inf)
    change = minimum(M, np.zeros(n), np.zeros(n), lower, upper)
    after = np.where((change == bound) & (side != 0) & meets, -e * v, v + change)
    return np.where(still, 0.0, after)
