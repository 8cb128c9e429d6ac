"""The modes of a run with dry friction or rigid stops: what ends a mode, and the state and the mode behind it.

    impact        v⁺ = argmin ½ |v⁺ − v|²_M over v⁺ᵢ ≥ −eᵢ vᵢ at each stop that is struck or touched
    acceleration  that of least constraint, of the joints at rest; one that broke away moves the way it was let go

A joint that slides stops where v = 0, one that is held breaks away where the reaction λ leaves its interval. Impacts
that follow each other ever faster end where the sum of their intervals says, in an impact without restitution.
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
from robot_dyn.simulation.state_equation import StateEquation

_ACCUMULATED = 1e-6  # [s] for all impacts that are still to come: what ends there has no effect beyond its square
_CROWDED = 20  # impacts within that time: they go on for ever, whatever the restitution
_STILL = 1e-14  # [rad/s] or [m/s]: joints this slow stop together with the one that stops
_STOP = {-1: "lower stop", 1: "upper stop"}


class Guard(NamedTuple):
    """A quantity that ends a mode where it passes a level.

    Attributes:
        joint: Its index.
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
        mode: What is held now, and which way the others slide.
    """

    def __init__(self, equation: StateEquation) -> None:
        self.equation, self.effects = equation, equation.equation_of_motion.set_valued
        self.stops = tuple(each for each in self.effects if isinstance(each, RigidStops))
        self._n = n = equation.plant.dynamics.n
        self.impulses = np.arange(2 * n + equation.states - n, 2 * n + equation.states)
        self.mode = Mode(np.zeros(n), np.zeros(n))
        self._impacts: list[float] = []  # times of the latest
        rubs = (each.at_rest(np.zeros(n)).most > 0 for each in self.effects if not isinstance(each, RigidStops))
        self._rubs = sum(rubs, start=np.zeros(n, bool))  # what may stick where its velocity is 0

    def start(self, y: np.ndarray) -> None:
        """The mode at the start: all that may be held is, until the reactions are known."""
        q, v = y[: self._n], y[self._n : 2 * self._n]
        least, most = self._intervals(q)
        held = (v == 0) & ((least < 0) | (most > 0))
        self.mode = Mode(held.astype(float), np.sign(v))

    @property
    def key(self) -> bytes:
        """The mode in bytes."""
        return self.mode.held.tobytes() + self.mode.direction.tobytes()

    def _intervals(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        known = [each.at_rest(q) for each in self.effects]
        return sum(each.least for each in known), sum(each.most for each in known)  # pyright: ignore[reportReturnType]

    def guards(self, y: np.ndarray) -> list[Guard]:
        """What ends the mode at a state y."""
        n, made = self._n, []
        q, v = y[:n], y[n : 2 * n]
        least, most = self._intervals(q)
        for i in range(n):
            if self.mode.held[i]:
                row = int(self.impulses[i])
                levels = ((float(least[i]), 1), (float(most[i]), -1))
                made += [Guard(i, row, level, side, True) for level, side in levels if np.isfinite(level)]
                continue
            if self.mode.direction[i] and (self._rubs[i] or v[i] == 0):
                made.append(Guard(i, n + i, 0.0, int(self.mode.direction[i]), False))
            for stops in self.stops:
                for level, side in ((stops.lower, 1), (stops.upper, -1)):
                    position = float(np.broadcast_to(level, n)[i])
                    leaves = q[i] == position and v[i] == 0  # then its velocity is watched until it turns
                    if np.isfinite(position) and not leaves:
                        made.append(Guard(i, i, position, side, False))
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
        y, n, happened = y.copy(), self._n, []
        q, v = y[:n], y[n : 2 * n]
        for stops in self.stops:
            q[:] = stops.snapped(q)
        v[(np.abs(v) <= _STILL) & self._rubs] = 0.0
        forced: dict[int, int] = {}
        if guard is not None and guard.rate:
            forced[guard.joint] = guard.side
        elif guard is not None:
            y[guard.row] = guard.level
        y[self.impulses] = 0.0
        before, M = self.mode, self.equation.plant.M(q)
        for k, stops in enumerate(self.stops):
            side = stops.touched(q)
            if (side * v > 0).any():
                happened += self._struck(t, y, held, M, k, side)
        forced = {i: way for i, way in forced.items() if v[i] == 0}  # the impact may have thrown it the other way
        self.mode = settled(self.effects, M, self._load(t, y, held), q, v, forced)[1]
        struck = {each.joint for each in happened}
        others = [i for i, name in enumerate(self.equation.plant.dynamics.joint_names) if name not in struck]
        return y, happened + [each for i in others if (each := self._changed(i, before, t, y))]

    def _struck(
        self, t: float, y: np.ndarray, held: Array | None, M: np.ndarray, k: int, side: np.ndarray
    ) -> list[Occurrence]:
        """The impact, or the last of ever faster ones, its work in y."""
        n, stops = self._n, self.stops[k]
        before = y[n : 2 * n].copy()
        strike = np.flatnonzero(side * before > 0)
        e = np.broadcast_to(stops.restitution, n).astype(float)
        y[n : 2 * n] = _impact(M, before, side, e, np.zeros(n, bool))
        a = settled(self.effects, M, self._load(t, y, held), y[:n], y[n : 2 * n])[0]
        v = y[n : 2 * n]
        returns = (side * a > 0) & (side * v < 0) & (e < 1)
        with np.errstate(divide="ignore", invalid="ignore"):
            left = np.where(returns, 2 * np.abs(v) / (np.abs(a) * (1 - e)), np.inf)
        still = left < _ACCUMULATED  # those that are kicked off their stops by others, too
        self._impacts = [*self._impacts[1 - _CROWDED :], t]
        if len(self._impacts) == _CROWDED and t - self._impacts[0] < _ACCUMULATED:  # as several stops in turn
            still |= (side != 0) & (2 * np.abs(v) <= np.abs(a) * _ACCUMULATED)
        last = [i for i in strike if still[i]]
        if still.any():
            y[n : 2 * n] = _impact(M, before, side, e, still)
        v = y[n : 2 * n]
        y[self._work(stops)] += (v + before) @ M @ (v - before) / 2
        return [
            self._occurrence(
                i, f"{'comes to rest at' if i in last else 'strikes'} its {_STOP[int(side[i])]}",
                t + (float(left[i]) if left[i] < _ACCUMULATED else 0.0), y, int(side[i]),
            )
            for i in strike.tolist()
        ]  # fmt: skip

    def _work(self, stops: RigidStops) -> int:
        """The entry of y that is the work of stops."""
        works = [each for each in self.equation.plant.forces if not isinstance(each, Conservative)]
        first = self.equation.size - len(self.equation.sources) + 1
        return first + next(i for i, each in enumerate(works) if each is stops)

    def _load(self, t: float, y: np.ndarray, held: Array | None) -> np.ndarray:
        """All torques but the reactions, less C v and ∂V/∂q."""
        equation, motion = self.equation, self.equation.equation_of_motion
        q, v, z, _ = equation.state(y)
        u = equation.actuation(t, q, v, z, held)
        total = sum(motion.torques(t, q, v, z=z[equation.state_size :]), start=motion.on_joints(u))
        return total - equation.plant.dynamics.inverse_dynamics(q, v, 0 * v)

    def _changed(self, i: int, before: Mode, t: float, y: np.ndarray) -> Occurrence | None:
        """What the change of the mode is for a joint, in words."""
        touched = next((int(side) for each in self.stops if (side := each.touched(y[: self._n])[i])), 0)
        was, held = before.held[i], self.mode.held[i]
        way, direction = before.direction[i], self.mode.direction[i]
        if held and not was:
            return self._occurrence(i, f"rests at its {_STOP[touched]}" if touched else "sticks", t, y, 0)
        if was and not held:
            word = f"leaves its {_STOP[touched]}" if touched == -direction and touched else "slides"
            return self._occurrence(i, word, t, y, int(direction))
        if way * direction < 0 and y[self._n + i] == 0 and self._rubs[i]:
            return self._occurrence(i, "reverses", t, y, int(direction))
        return None

    def _occurrence(self, i: int, what: str, t: float, y: np.ndarray, direction: int) -> Occurrence:
        n, joint = self._n, self.equation.plant.dynamics.joint_names[i]
        return Occurrence(t, f"{joint} {what}", direction, tuple(y[:n].tolist()), tuple(y[n : 2 * n].tolist()), joint)


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
