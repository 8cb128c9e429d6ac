"""Coordinates of what holds and strikes: q of the joints, then δ = θ − q of each motor in a rigid backlash.

    M' = [M + E B Eᵀ, E B; B Eᵀ, B],    load' = (load + E u_m, u_m),   u_m = u − b θ̇,   B = n² J

E picks the joints of the motors. The ends of a gap are stops of δ. [As of `effects.rigid_backlash`]
"""

from __future__ import annotations

from typing import Any, final

import numpy as np

from robot_dyn.effects.effect import Conservative
from robot_dyn.effects.rigid_backlash import RigidBacklash
from robot_dyn.effects.set_valued import Interval
from robot_dyn.simulation.state_equation import StateEquation

_NEAR = 4e-15  # of an end of a gap, or in its unit
_END = {-1: "backward end", 1: "forward end"}


@final
class Coordinates:
    """The coordinates of a state equation, N of them.

    Attributes:
        joints: The joint of each, (N,).
        rows, speeds, impulses: Entries of y that are its position, velocity and the impulse of its reaction, (N,).
        gaps: Number of those that are no joint, the last ones.
    """

    def __init__(self, equation: StateEquation) -> None:
        n, motion = equation.plant.dynamics.n, equation.equation_of_motion
        first, end = 2 * n + equation.state_size, 2 * n + equation.states
        self._n = n
        own, works = [], [each for each in equation.plant.forces if not isinstance(each, Conservative)]
        for k, place in motion.states.items():
            effect = motion.effects[k]
            if not isinstance(effect, RigidBacklash):
                continue
            joints, at = list(effect.driven(n)), first + place.start
            work = equation.size - len(equation.sources) + 1 + next(i for i, x in enumerate(works) if x is effect)
            columns = [at + i * len(joints) + np.arange(len(joints)) for i in range(4)]
            numbers = [np.asarray(effect.of(name, n), float) for name in ("gap", "restitution")]
            own.append((np.array(joints), *columns, *numbers, effect.reflected(n), np.full(len(joints), work)))
        self._drives = [x for x in works if isinstance(x, RigidBacklash)]
        self._first = [first + motion.states[k].start for k in motion.states if motion.effects[k] in self._drives]
        made = [np.concatenate(column) for column in zip(*own, strict=True)] if own else [np.zeros(0, int)] * 9
        joints, delta, speed, self._motors, impulse, self._level, self._e, self._inertia, self._works = made
        self.gaps, self._own = len(joints), joints
        self.joints = np.concatenate([np.arange(n), joints])
        self.rows = np.concatenate([np.arange(n), delta])
        self.speeds = np.concatenate([n + np.arange(n), speed])
        self.impulses = np.concatenate([np.arange(end - n, end), impulse])

    def widened(self, effects: tuple[Any, ...]) -> tuple[Any, ...]:
        """The laws of these coordinates: those of the joints, and those of the gaps."""
        return (*(_OfJoints(each, self._n) for each in effects), _OfGaps(self)) if self.gaps else effects

    def wide(self, of_joints: np.ndarray, of_gaps: Any = 0.0) -> np.ndarray:
        """Numbers of joints and of gaps, (N,)."""
        return np.concatenate([of_joints, np.broadcast_to(of_gaps, self.gaps)]) if self.gaps else of_joints

    @property
    def restitution(self) -> np.ndarray:
        """That of the gaps, (gaps,)."""
        return self._e

    @property
    def level(self) -> np.ndarray:
        """The ends of gaps, to each side, (gaps,)."""
        return self._level

    def ends(self, x: np.ndarray) -> np.ndarray:
        """1 or −1 for each gap of which an end is touched at positions (N,), 0 elsewhere, (gaps,)."""
        delta, near = x[self._n :], _NEAR * np.maximum(1.0, self._level)
        return np.where(np.abs(delta) >= self._level - near, np.sign(delta), 0.0).astype(int)

    def snap(self, y: np.ndarray) -> None:
        """Make what touches an end lie exactly there, in y."""
        side = self.ends(y[self.rows])
        rows = self.rows[self._n :]
        y[rows] = np.where(side != 0, side * self._level, y[rows])

    def bodies(self, M: np.ndarray, load: np.ndarray, u: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """M' and load'."""
        if not self.gaps:
            return M, load
        n = self._n
        drag = [x.drag(n, y[at : at + x.state_size(n)]) for x, at in zip(self._drives, self._first, strict=True)]
        torque, E = u[self._own] - np.concatenate(drag), np.eye(n)[:, self._own]
        EB = E * self._inertia
        whole = np.block([[M + EB @ E.T, EB], [EB.T, np.diag(self._inertia)]])
        return whole, np.concatenate([load + E @ torque, torque])

    def take(self, y: np.ndarray, v: np.ndarray) -> float:
        """Take the velocities (N,) behind an impact, with the works of gaps, in y; returns the sum of these."""
        before, motors = y[self.speeds].copy(), y[self._motors].copy()
        y[self.speeds] = v
        if not self.gaps:
            return 0.0
        y[self._motors] = v[self._own] + v[self._n :]
        works = -self._inertia * (y[self._motors] - motors) * (v[self._own] + before[self._own]) / 2
        np.add.at(y, self._works, works)
        return float(works.sum())

    def part(self, y: np.ndarray) -> None:
        """Let motors keep their speeds where the velocities of their joints have jumped, in y."""
        y[self.speeds[self._n :]] = y[self._motors] - y[self.speeds[: self._n]][self._own]

    def contact(self, held: np.ndarray, y: np.ndarray) -> np.ndarray | None:
        """The ends at which motors rest, by joint; None without gaps. Motors there move with their joints in y."""
        if not self.gaps:
            return None
        rests = held[self._n :] > 0
        made = np.zeros(self._n)
        made[self._own] = self.ends(y[self.rows]) * rests
        y[self._motors] = np.where(rests, y[self.speeds[: self._n]][self._own], y[self._motors])
        return made


class _OfJoints:
    """The law of an effect, of all coordinates."""

    def __init__(self, effect: Any, n: int) -> None:
        self.effect, self._n = effect, n

    def at_rest(self, x: np.ndarray) -> Interval:
        """As of `SetValued`."""
        known = self.effect.at_rest(x[: self._n])
        return Interval(*(np.concatenate([each, np.zeros(len(x) - self._n)]) for each in known))

    def sliding(self, v: np.ndarray) -> np.ndarray:
        """As of `SetValued`."""
        return np.concatenate([self.effect.sliding(v[: self._n]), np.zeros(len(v) - self._n)])


class _OfGaps:
    """The law of the ends of gaps, of all coordinates."""

    def __init__(self, coordinates: Coordinates) -> None:
        self._of = coordinates

    def at_rest(self, x: np.ndarray) -> Interval:
        """As of `SetValued`."""
        side = np.concatenate([np.zeros(len(x) - self._of.gaps), self._of.ends(x)])
        return Interval(np.where(side > 0, -np.inf, 0.0), np.where(side < 0, np.inf, 0.0))

    def sliding(self, v: np.ndarray) -> np.ndarray:
        """As of `SetValued`."""
        return np.zeros_like(v)


def end_of_gap(side: int) -> str:
    """An end of a backlash, in words."""
    return f"the {_END[side]} of its backlash"
