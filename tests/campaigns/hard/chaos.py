"""Motion that forgets its start: the time t* up to which a run says it is resolved, and what is true there.

    |t* − t| ≤ 0.2 t, |q_h − q|(t) = the limit that the run names;    |q_h − q|(t*) ≤ estimate / 0.3

An error that grows as exp(λ t) reaches a limit ln 3 / λ = 1.1 / λ sooner if it is three times as large; from 1e-4 of
the limit or less it takes 9 / λ, of which a fifth is 1.8 / λ. The truth is SciPy's DOP853 over Pinocchio's articulated
bodies, checked by a second tolerance; near rounding, the double pendulum as a Taylor series in 160 bits.

    Lyapunov time  T / ln(|δq(T)| / |δq(0)|),    by linearise along a run, and by two motions 1e-6 aside

The tangent is carried by RK4: with h = 2.5 ms and up to ω = 20 per second it errs by T (h ω)⁴ ω / 120 = 3e-6 in 3 s,
of its largest size, which may be 50 times that at the end; two motions 1e-6 aside, which grow to 1e-3, by 1e-3. Allowed
is 0.01 of the logarithm.
[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, I.14 and II.4]
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import solve_ivp

import robot_dyn as rd
from tests.campaigns.hard import double_pendulum
from tests.campaigns.hard.case import Case, Row

TITLE = "Chaos"
PERIOD = 0.01  # [s] between samples
APART, LEAST = 0.2, 0.3
METHODS: dict[str, Any] = {
    "planar_2r": {
        "RK4": ("RK4", 0.01), "GaussLegendre4": ("GaussLegendre4", 0.01), "Midpoint": ("Midpoint", 1e-3),
        "SemiImplicitEuler": ("SemiImplicitEuler", 1e-3), "Rodas5PFixed": ("Rodas5PFixed", 2e-3),
        "DOP853 of rtol 1e-7": (rd.integrate.Adaptive("DOP853", 1e-7, 1e-9), 0.0),
        "Rodas5P of rtol 1e-6": (rd.integrate.Adaptive("Rodas5P", 1e-6, 1e-8), 0.0),
    },
    "panda": {"RK4": ("RK4", 2e-3), "DOP853 of rtol 1e-6": (rd.integrate.Adaptive("DOP853", 1e-6, 1e-8), 0.0)},
}  # fmt: skip
FINE = {
    "DP8": ("DP8", 2e-3), "GaussLegendre6": ("GaussLegendre6", 5e-3),
    "DOP853 of rtol 1e-11": (rd.integrate.Adaptive("DOP853", 1e-11, 1e-13), 0.0),
    "DOP853 of rtol 3e-14": (rd.integrate.Adaptive("DOP853", 3e-14, 1e-15), 0.0),
}  # fmt: skip
SLOW = ("Rodas5PFixed", "Rodas5P of rtol 1e-6")  # their steps are not compiled: 4 starts
SHORT = {"planar_2r": ("RK4", "SemiImplicitEuler", "DOP853 of rtol 1e-7"), "panda": ("RK4", "DOP853 of rtol 1e-6")}
NAMES = {"planar_2r": "double pendulum", "panda": "Panda"}
DURATION = {"planar_2r": 9.0, "panda": 4.0}  # [s]
GUARD = 1e-3  # [rad] between two truths where the limit is passed


@cache
def arm(name: str) -> rd.Robot:
    """The robot, fingers locked."""
    robot = rd.load(name)
    return robot.with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else robot


def start(seed: int, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Near where a chain of links stands on end, so that it goes over the top."""
    rng = np.random.default_rng((29, seed))
    q = rng.uniform(0.2, 0.6, n) * rng.choice([-1, 1], n)
    return q + (np.pi / 2 if n == 2 else 0.0) * np.eye(n)[0], rng.uniform(1, 2, n)


def times(duration: float) -> np.ndarray:
    return np.linspace(0, duration, round(duration / PERIOD) + 1)


def motion(robot: rd.Robot, q0: np.ndarray, v0: np.ndarray, t: np.ndarray, rtol: float = 3e-14) -> np.ndarray:
    """Positions by SciPy's DOP853 over Pinocchio's articulated bodies, (k, n)."""
    model, n = robot.model, robot.n
    data, none = model.createData(), np.zeros(n)

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], none)])

    return solve_ivp(rate, (0, t[-1]), np.concatenate([q0, v0]), "DOP853", t, rtol=rtol, atol=rtol / 30).y[:n].T


@cache
def of_bodies(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """The true q at the samples, and how far two tolerances are apart so far."""
    robot, t = arm(name), times(DURATION[name])
    q, other = (motion(robot, *start(seed, robot.n), t, rtol) for rtol in (3e-14, 1e-12))
    return q, np.maximum.accumulate(np.abs(q - other).max(axis=1))


def rows(case: str, runs: list[tuple[rd.Trajectory, np.ndarray]]) -> Iterator[Row]:
    """The run whose t* is farthest off, and the one whose estimate is."""
    yield max((_horizon(case, *each) for each in runs), key=lambda row: row.found)
    yield max((_estimate(case, *each) for each in runs), key=lambda row: row.found)


def errors(run: rd.Trajectory, q: np.ndarray) -> np.ndarray:
    """The largest true error up to each sample."""
    return np.maximum.accumulate(np.abs(run.q - q[: len(run.q)]).max(axis=1))


def passed(run: rd.Trajectory, q: np.ndarray) -> float:
    """Time at which the true error passes the limit that the run names; the end if it does not."""
    facts = run.error.ends_early.facts if run.error.ends_early else {}
    limit = float(facts.get("limit", facts.get("tenth", 0.1)))
    beyond = np.flatnonzero(errors(run, q) > limit)
    return float(run.t[beyond[0]]) if len(beyond) else float(run.t[-1])


def _horizon(case: str, run: rd.Trajectory, q: np.ndarray) -> Row:
    said, true = run.error.until_s, passed(run, q)
    measure = f"t* = {said:.3g} s, limit truly passed at {true:.3g} s: apart, of that"
    return Row(case, measure, abs(said / true - 1), APART, str(run.error) if said < true else "")


def _estimate(case: str, run: rd.Trajectory, q: np.ndarray) -> Row:
    i = int(np.searchsorted(run.t, run.error.until_s, side="right")) - 1
    return Row(
        case, "true error at t* over its estimate", errors(run, q)[i] / run.error.at(run.error.until_s), 1 / LEAST
    )


def _run(robot: rd.Robot, of: tuple[Any, float], seed: int, duration: float, engine: str = "auto") -> rd.Trajectory:
    method, step = of
    fixed = {"step_s": step} if step else {}
    return rd.simulate(
        robot, *start(seed, robot.n), duration_s=duration, method=method, record_every_s=PERIOD,
        engine=engine, **fixed,
    )  # fmt: skip


def _of_arm(name: str, method: str, starts: int, seed: int) -> Iterator[Row]:
    robot, runs, unsure = arm(name), [], 0.0
    for k in range(seed, seed + starts):
        q, apart = of_bodies(name, k)
        engine = "interpreted" if starts == 1 else "compiled"  # machine code takes longer to make than a few runs
        run = _run(robot, METHODS[name][method], k, DURATION[name], engine)
        runs.append((run, q))
        unsure = max(unsure, float(apart[np.searchsorted(run.t, passed(run, q))]))
    case = f"{NAMES[name]}, {method}" + (f", {starts} starts" if starts > 1 else "")
    yield from rows(case, runs)
    yield Row(case, "two truths apart where the limit is passed, in rad", unsure, GUARD)


def _fine(method: str, seed: int) -> Iterator[Row]:
    """Runs near rounding, to which floats know no truth."""
    robot, duration, runs = arm("planar_2r"), 22.0, []
    for k in range(seed, seed + 3):
        q = of_series(k, duration)
        runs.append((_run(robot, FINE[method], k, duration), q))
    yield from rows(f"double pendulum, {method}, 3 starts", runs)


@cache
def of_series(seed: int, duration: float) -> np.ndarray:
    """The true q at the samples, in 160 bits."""
    return double_pendulum.positions(*start(seed, 2), times(duration))


def _lyapunov(seed: int) -> Iterator[Row]:
    """Of a run half of whose samples are middles of steps."""
    robot, duration, small, h = arm("planar_2r"), 3.0, 1e-6, PERIOD / 4
    q0, v0 = start(seed, 2)
    method = rd.integrate.Adaptive("DOP853", 1e-11, 1e-13)
    run = rd.simulate(robot, q0, v0, duration_s=duration, method=method, record_every_s=h / 2)
    A = [rd.linearise(robot, q, v, np.zeros(2))[0] for q, v in zip(run.q, run.v, strict=True)]
    aside = np.array([1.0, -1.0])
    x = np.array([*aside, 0.0, 0.0])
    for first, middle, last in zip(A[:-1:2], A[1::2], A[2::2], strict=True):
        a = first @ x
        b = middle @ (x + h / 2 * a)
        c = middle @ (x + h / 2 * b)
        x = x + h / 6 * (a + 2 * b + 2 * c + last @ (x + h * c))
    near, far = (motion(robot, q0 + side * small * aside, v0, times(duration))[-1] for side in (1, -1))
    grown = np.linalg.norm(near - far) / (2 * small), np.linalg.norm(x[:2])
    exact, made = (duration / np.log(each / np.linalg.norm(aside)) for each in grown)
    measure = f"{made:.4g} s by linearise, {exact:.4g} s by two runs: logarithms of the growth apart"
    yield Row("Lyapunov time of the double pendulum", measure, abs(np.log(grown[1] / grown[0])), 0.01)


CASES = [
    *(Case(f"{NAMES[of]}, {name}", partial(_of_arm, of, name, 1)) for of in METHODS for name in SHORT[of]),
    Case("Lyapunov time of the double pendulum", _lyapunov),
    *(
        Case(f"{NAMES[of]}, {name}, {starts} starts", partial(_of_arm, of, name, starts), True)
        for of in METHODS
        for name in METHODS[of]
        for starts in ([4] if name in SLOW else [16])
    ),
    *(Case(f"double pendulum, {name}, near rounding", partial(_fine, name), True) for name in FINE),
]
