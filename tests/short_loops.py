"""Random sampled loops in short runs, and the spectral radius of a period of each from its definition.

    x' = A x + B u,   u_k = law(k, what was measured at t_k − τ_m) acts on [t_k + τ_u, t_{k+1} + τ_u)

The plant is a chain of one to three slides on springs and dampers, M_ij = Σ_{k ≥ max(i, j)} m_k e_iᵀ e_j, or an arm at
rest, linearised by differences of Pinocchio's ABA. Delays are whole or parts of periods; the velocity is measured or a
difference, and filtered or not; the law is a PD or a PID. No line of the library's own map is used.
`python -m tests.short_loops --loops 100 --seed 1` judges the advice on that many; exit code 1 if one is wrong.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil, inf

import numpy as np
import pinocchio as pin
from scipy.linalg import expm

import robot_dyn as rd
from tests.slides import slides as chain

ABOVE, BELOW, CLOSE = 1.001, 0.999, 1e-3  # of a radius that must not be called stable, or unstable; of a limit
ARMS = ("ur5", "panda")


@dataclass(frozen=True)
class Arm:
    """What is controlled, about its rest: A and B, the inertia of each joint, where it starts, and the load there."""

    name: str
    plant: rd.Plant
    A: np.ndarray
    B: np.ndarray
    inertia: np.ndarray
    q0: np.ndarray
    rest: np.ndarray
    load: np.ndarray


@dataclass(frozen=True)
class ShortLoop:
    """A loop and its period; `ki` is None for a PD."""

    arm: Arm
    kp: np.ndarray
    ki: np.ndarray | None
    kd: np.ndarray
    late: tuple[float, float]
    differences: bool
    order: int
    cutoff: float
    periods: int
    period: float = 1e-3

    def __str__(self) -> str:
        velocity = "differences " * self.differences + f"low-pass of order {self.order}" * bool(self.order)
        law = f"{'PD' if self.ki is None else 'PID'} of {velocity or 'v'}, {self.periods} periods"
        return f"{self.arm.name}, {law}, delays {self.late[0]:.3g} and {self.late[1]:.3g}"

    @property
    def highest(self) -> float:
        """The period from which its filter has no meaning, in [s]."""
        return np.pi / self.cutoff if self.order else inf

    def radius(self, T: float) -> float:
        """Spectral radius of a period: of x, torques and samples on their way, the integral, and the filter's past."""
        A, B, n = self.arm.A, self.arm.B, len(self.kp)
        waiting, acting = (ceil(each) for each in self.late)
        rows = iter(np.eye(n * (9 + acting + 2 * waiting)).reshape(-1, n, n * (9 + acting + 2 * waiting)))
        x = np.vstack([next(rows), next(rows)])
        torques = [next(rows) for _ in range(acting + 1)]
        samples = [np.vstack([next(rows), next(rows)]) for _ in range(waiting)]
        z, before, r1, r2, y1, y2 = (next(rows) for _ in range(6))
        q, v = np.split(samples[-1] if waiting else x, 2)
        rate = (q - before) / T if self.differences else v
        y = self._filtered(T, (rate, r1, r2), (y1, y2))
        torques.insert(0, z - self.kp[:, None] * q - self.kd[:, None] * y)
        z = 0 * z if self.ki is None else z - T * self.ki[:, None] * q
        both = np.block([[A, B], [np.zeros((n, 3 * n))]])
        measures, acts = -self.late[0] % 1, self.late[1] % 1
        for a, b in pairwise(sorted({0.0, acts, measures, 1.0})):
            if waiting and a == measures:
                samples = [x, *samples[:-1]]
            u = torques[acting] if a < acts else torques[int(self.late[1])]
            flow = expm(both * (b - a) * T)[: 2 * n]
            x = flow[:, : 2 * n] @ x + flow[:, 2 * n :] @ u
        made = np.vstack([x, *torques[: acting + 1], *samples, z, q, rate, r1, y, y1])
        return float(np.abs(np.linalg.eigvals(made)).max())

    def _filtered(self, T: float, x: tuple[np.ndarray, ...], y: tuple[np.ndarray, ...]) -> np.ndarray:
        """What leaves Butterworth's filter, by the bilinear transform, of what enters and left it, the newest first."""
        K = np.tan(self.cutoff * T / 2)
        if self.order == 1:
            return (K * (x[0] + x[1]) + (1 - K) * y[0]) / (1 + K)
        if self.order == 2:
            a, b, c = 1 + np.sqrt(2) * K + K * K, 2 * (K * K - 1), 1 - np.sqrt(2) * K + K * K
            return (K * K * (x[0] + 2 * x[1] + x[2]) - b * y[0] - c * y[1]) / a
        return x[0]

    def longest(self) -> float:
        """The period at which the radius first passes 1, to 1e-9; 0 if it starts above, inf if it never does."""
        A = self.arm.A
        loop = A - self.arm.B @ np.hstack([np.diag(self.kp), np.diag(self.kd)])
        rates, ring = np.abs(np.linalg.eigvals([A, loop])).ravel(), np.abs(np.linalg.eigvals(A).imag).max()
        T, before, last = 1e-4 / rates.max(), 0.0, min(300 / rates[rates > 1e-6 * rates.max()].min(), self.highest)
        while self.radius(T) <= 1 + 1e-11:  # rounding
            before, T = T, min(1.04 * T, T + 1 / (20 * ring)) if 0 < ring * T < 100 else 1.04 * T
            if last <= T:
                return self.highest
        while before and T - before > 1e-9 * T:
            middle = (before + T) / 2
            before, T = (before, middle) if self.radius(middle) > 1 else (middle, T)
        return before

    def setup(self) -> rd.Setup:
        """A run of `periods` periods."""
        target, law = rd.control.hold(self.arm.rest + self.arm.load / self.kp), rd.control.PD
        gains = {"kp": self.kp, "kd": self.kd, "period_s": self.period}
        if self.ki is not None:
            law, gains = rd.control.PID, {**gains, "ki": self.ki}
        velocity = [rd.control.Differences()] * self.differences
        velocity += [rd.control.LowPass(self.cutoff, self.order)] if self.order else []
        made = law(target, **gains)
        if velocity or any(self.late):
            made = rd.control.Loop(
                made, velocity=velocity, measurement_delay_periods=self.late[0], actuation_delay_periods=self.late[1]
            )
        q = self.arm.q0
        return rd.Setup(self.arm.plant, q, 0 * q, self.periods * self.period, made, estimate_error=False)


def slides(rng: np.random.Generator) -> Arm:
    """A chain of slides, at most of them with springs, dampers or both."""
    n = int(rng.integers(1, 4))
    mass, axes = 10 ** rng.uniform(-0.5, 0.7, n), rng.normal(size=(n, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    tail = np.cumsum(mass[::-1])[::-1]
    M = np.array([[tail[max(i, j)] * (axes[i] @ axes[j]) for j in range(n)] for i in range(n)])
    k = 10 ** rng.uniform(0, 3, n) * mass * (rng.random() < 0.5)
    d = 10 ** rng.uniform(-1.5, 1.5, n) * mass * (rng.random() < 0.5)
    names = ["base", *(f"l{i + 1}" for i in range(n))]
    blocks = [(f"j{i + 1}", names[i], names[i + 1], m) for i, m in enumerate(mass.tolist())]
    robot = chain(*blocks, axes=tuple(" ".join(map(repr, e)) for e in axes.tolist())).with_(gravity=(0, 0, 0))
    effects = [rd.effects.Spring(k)] * bool(k.any()) + [rd.effects.ViscousFriction(d)] * bool(d.any())
    inverse, zero = np.linalg.inv(M), np.zeros((n, n))
    A = np.block([[zero, np.eye(n)], [-inverse * k, -inverse * d]])
    name = f"{n} slides" + " with springs" * bool(k.any()) + " with dampers" * bool(d.any())
    return Arm(
        name, rd.Plant(robot, effects), A, np.vstack([zero, inverse]), np.diag(M), rng.uniform(0.05, 0.2, n),
        np.zeros(n), np.zeros(n),
    )  # fmt: skip


def at_rest(name: str, rng: np.random.Generator) -> Arm:
    """An arm that a torque holds at a posture."""
    robot = rd.load(name)
    robot = robot.with_(lock=dict.fromkeys(robot.joint_names[7:], 0.0)) if name == "panda" else robot
    q = 0.3 * np.cos(np.arange(robot.n) + 0.4) + rng.uniform(-0.2, 0.2, robot.n)
    full = pin.buildModelFromUrdf(robot.description.source)
    model = pin.buildReducedModel(full, list(range(robot.n + 1, full.njoints)), pin.neutral(full))
    data, v, h = model.createData(), 0 * q, 1e-3
    load = pin.computeGeneralizedGravity(model, data, q).copy()

    def a(x: np.ndarray) -> np.ndarray:
        return pin.aba(model, data, x[: robot.n], x[robot.n :], load).copy()

    x, M = np.concatenate([q, v]), pin.crba(model, data, q).copy()
    M = np.triu(M) + np.triu(M, 1).T
    slope = [
        (
            45 * (a(x + h * e) - a(x - h * e))
            - 9 * (a(x + 2 * h * e) - a(x - 2 * h * e))
            + a(x + 3 * h * e)
            - a(x - 3 * h * e)
        )
        / (60 * h)
        for e in np.eye(2 * robot.n)
    ]  # of order 6
    zero, inverse = np.zeros((robot.n, robot.n)), np.linalg.inv(M)
    A = np.vstack([np.hstack([zero, np.eye(robot.n)]), np.array(slope).T])
    return Arm(name, rd.Plant(robot), A, np.vstack([zero, inverse]), np.diag(M), q, q, load)


def drawn(seed: int, index: int) -> tuple[ShortLoop, float]:
    """Loop number `index` of a seed, and its exact limit: every tenth one is an arm."""
    rng = np.random.default_rng([seed, index, 17])
    arm = at_rest(ARMS[index // 10 % 2], rng) if index % 10 == 9 else slides(rng)
    n = len(arm.q0)
    omega, zeta = 10 ** rng.uniform(0.5, 1.7, n), 10 ** rng.uniform(-1.3, 0.3, n) * (rng.random() > 0.1)
    kp, kd = arm.inertia * omega**2, 2 * zeta * omega * arm.inertia
    ki = kp * omega * zeta * rng.uniform(0.05, 1.5, n) if rng.random() < 0.4 and zeta.all() else None
    ki = None if arm.load.any() else ki  # an integral leaves the posture
    late = [(0.0, 0.0), tuple(rng.integers(0, 3, 2).astype(float)), tuple(np.round(rng.uniform(0, 2, 2), 3))]
    loop = ShortLoop(
        arm, kp, ki, kd, late[int(rng.integers(3))], bool(rng.random() < 0.3), int(rng.choice([0, 0, 1, 2])),
        float(omega.max() * 10 ** rng.uniform(0.5, 2.0)), int(rng.integers(3, 40)),
    )  # fmt: skip
    limit, near = loop.longest(), rng.uniform(-0.02, 0.02) if rng.random() < 0.5 else rng.uniform(-0.7, 0.7)
    period = limit * 10**near if 0 < limit < inf else 10 ** rng.uniform(-3, 0)
    return replace(loop, period=float(min(period, 0.99 * loop.highest))), limit


@dataclass(frozen=True)
class Judged:
    """What the advice on a loop says, and what is so."""

    label: str
    radius: float
    stable: bool
    exact: float
    stated: float

    @property
    def off(self) -> float:
        """How far the stated period is from the exact one, in parts of it."""
        return 0.0 if self.stated == self.exact else abs(self.stated / self.exact - 1) if self.exact else inf

    @property
    def holds(self) -> bool:
        """Whether verdict and limit are right."""
        return not (self.radius > ABOVE if self.stable else self.radius < BELOW) and self.off <= CLOSE

    def __str__(self) -> str:
        said = "stable" if self.stable else "unstable"
        return f"{self.label}: radius {self.radius:.7g}, {said}; up to {self.exact:.6g} s, stated {self.stated:.6g} s"


def judge(seed: int, index: int) -> Judged:
    loop, exact = drawn(seed, index)
    advice = rd.advise(loop.setup())
    return Judged(f"{seed}/{index} {loop}", loop.radius(loop.period), advice.stable, exact, advice.longest_period_s)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", action="store_true", help="print every loop")
    options = parser.parse_args()
    found = []
    for index in range(options.loops):
        found.append(judge(options.seed, index))
        if options.show or not found[-1].holds:
            print("     " if found[-1].holds else "WRONG", found[-1], flush=True)
    radii = {said: [each.radius for each in found if each.stable == said] for said in (True, False)}
    limits, worst = [each.exact for each in found], max(found, key=lambda each: each.off)
    print(
        f"seed {options.seed}: {len(radii[True])} called stable, of radius {max(radii[True], default=0):.9g} at most;"
    )
    print(f"{len(radii[False])} called unstable, of radius {min(radii[False], default=inf):.9g} at least;")
    print(f"{limits.count(0.0)} that no period makes stable, {limits.count(inf)} that every one does;")
    print(f"stated periods off by {worst.off:.2g} at most: {worst}")
    wrong = sum(not each.holds for each in found)
    print(f"{wrong} of {len(found)} wrong")
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main())
