"""Long runs: what energy does over up to 1e7 steps, 16 starts side by side, and whether the way back leads home.

    Gauss methods in (q, p)   mean drift within 3 standard errors of 0;    max |E − E₀| ∝ h^(p ± 0.3)
                              where truncation is below rounding, |E − E₀| ≤ 10 u √N (|K| + |V|)
    explicit methods          E − E₀ ∝ h^e with e within 0.3 of p or p + 1
    forth and back            |q − q₀| ≤ 2 u N (1 + ω T)

A symplectic method keeps a neighbouring energy for exponentially long times; what is left of its error is rounding,
which walks at random: √N of u of the terms added, ten of them for the arithmetic of a step. The drift is the mean of
the second half less that of the first, of each start. Two steps are compared while their motions are the same: of the
Panda, which tumbles, the median of 16 exponents has a standard error of 0.2 to 0.8 over 25 s, of 0.2 or less over 5 s.
An error of a step of order p + 1 gives p in sum, and one more where the error of that order takes no energy. A
symmetric method retraces its steps but for rounding, u in each of 2 N, which regular motion of ω = 10 per second
carries on linearly. For a body that spins about three axes through its centre of mass the momentum p₁ about the first
is the vertical angular momentum, a linear invariant of Runge–Kutta methods.
[Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, IV.1, V.1, VIII.5 and IX.8; Hairer, McLachlan,
Razakarivony, Achieving Brouwer's law with implicit Runge–Kutta methods, BIT 48, 2008]
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache, partial

import numpy as np

import robot_dyn as rd
from tests.campaigns.hard.case import Case, Row

TITLE = "Long runs"
U, STARTS, SAMPLES = 2.0**-53, 16, 200
ERRORS, EXPONENT, WALK, FAST = 3.0, 0.3, 10.0, 10.0
ORDER = {"GaussLegendre2": 2, "GaussLegendre4": 4, "GaussLegendre6": 6, "RK4": 4, "DP8": 8}
STEPS = {"GaussLegendre2": 0.01, "GaussLegendre4": 0.02, "GaussLegendre6": 0.04, "RK4": 0.02, "DP8": 0.05}  # [s]
PACE = {"planar_2r": 1.0, "ur5": 1.0, "panda": 0.125, "body": 4.0}  # of these steps: how slowly it moves
SAME = {"panda": 5.0}  # [s] in which motions of two steps are the same; what tumbles longer has its own largest error
NAMES = {"planar_2r": "double pendulum", "ur5": "UR5", "panda": "Panda", "body": "torque-free body"}
_JOINT = (
    '<joint name="{0}" type="continuous"><parent link="{1}"/><child link="{2}"/><axis xyz="{3}"/></joint>'
    '<link name="{2}"><inertial><mass value="{4}"/><inertia ixx="{5}" iyy="{6}" izz="{7}" ixy="0" ixz="0" iyz="0"/>'
    "</inertial></link>"
)
BODY = '<robot name="body"><link name="base"/>' + "".join(
    _JOINT.format(*each)
    for each in (
        ("yaw", "base", "outer", "0 0 1", 1e-3, 1e-6, 1e-6, 1e-6),
        ("pitch", "outer", "inner", "0 1 0", 1e-3, 1e-6, 1e-6, 1e-6),
        ("roll", "inner", "body", "1 0 0", 2.0, 0.05, 0.03, 0.04),
    )
)


@cache
def arm(name: str) -> rd.Robot:
    """The robot, fingers locked; the body is a link on three axes through its centre of mass, without gravity."""
    if name == "body":
        return rd.Robot.from_text(BODY + "</robot>").with_(gravity=(0.0, 0.0, 0.0))
    robot = rd.load(name)
    return robot.with_(lock={"panda_finger_joint1": 0.0}) if name == "panda" else robot


def step_of(name: str, method: str) -> float:
    """A step in [s] at which truncation is seen, and falls as it should."""
    return PACE[name] * STEPS[method]


def starts(name: str, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Of regular motion: near where gravity lets it hang, or a spin about the axis of the largest inertia."""
    rng, n = np.random.default_rng((31, seed)), arm(name).n
    q, v = rng.uniform(-0.4, 0.4, (2, STARTS, n))
    if name == "body":
        return q, v + 2.0 * np.eye(n)[2]
    hangs = {"planar_2r": [-np.pi / 2, 0.0], "ur5": [0.0, np.pi / 2, 0.0, 0.0, 0.0, 0.0]}
    return q + hangs.get(name, [0.0, np.pi - 0.2, 0.0, -0.5, 0.0, 0.5, 0.0]), v


def energies(name: str, method: str, step: float, steps: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """E − E₀ at the samples, (16, m), and the largest |K| + |V| of each run."""
    q0, v0 = starts(name, seed)
    runs = rd.rollouts(
        arm(name), q0, v0, duration_s=steps * step, method=method, step_s=step, record=("energy",),
        record_every_s=steps * step / SAMPLES, threads=1,
    )  # fmt: skip
    assert runs.kinetic is not None and runs.potential is not None
    energy = runs.kinetic + runs.potential
    return energy - energy[:, :1], (np.abs(runs.kinetic) + np.abs(runs.potential)).max(axis=1)


def drift(error: np.ndarray) -> float:
    """The mean drift over the starts, in standard errors."""
    half = error.shape[1] // 2
    each = error[:, half:].mean(axis=1) - error[:, :half].mean(axis=1)
    return float(abs(each.mean()) / (each.std(ddof=1) / np.sqrt(len(each))))


def exponent(name: str, method: str, steps: int, seed: int, symplectic: bool) -> float:
    """Of the step, in the largest error of energy or in the last one: the median over the starts."""
    sizes = []
    for factor in (1, 2):
        error, _ = energies(name, method, step_of(name, method) / factor, steps * factor, seed)
        sizes.append(np.abs(error).max(axis=1) if symplectic else np.abs(error[:, -1]))
    return float(np.median(np.log2(sizes[0] / sizes[1])))


def _symplectic(name: str, method: str, steps: int, seed: int) -> Iterator[Row]:
    case = f"{NAMES[name]}, {method}, {steps:g} steps of {step_of(name, method):g} s"
    error, _ = energies(name, method, step_of(name, method), steps, seed)
    yield Row(case, "mean drift of 16 starts, in standard errors", drift(error), ERRORS)
    least = min(steps, 10_000)
    if name in SAME:
        least = min(least, round(SAME[name] / step_of(name, method)))
    e = exponent(name, method, least, seed, True)
    measure = f"max |E − E₀| over {least:g} steps ∝ h^{e:.2f}: off p = {ORDER[method]}"
    yield Row(case, measure, abs(e - ORDER[method]), EXPONENT)


def _explicit(name: str, method: str, steps: int, seed: int) -> Iterator[Row]:
    case = f"{NAMES[name]}, {method}, {steps:g} steps of {step_of(name, method):g} s"
    e, p = exponent(name, method, steps, seed, False), ORDER[method]
    yield Row(case, f"E − E₀ ∝ h^{e:.2f}: off p or p + 1", min(abs(e - p), abs(e - p - 1)), EXPONENT)


def _rounded(name: str, method: str, step: float, steps: int, seed: int) -> Iterator[Row]:
    case = f"{NAMES[name]}, {method}, {steps:g} steps of {step:g} s"
    error, scale = energies(name, method, step, steps, seed)
    walk = float(np.std(error[:, -1] / scale, ddof=1) / (U * np.sqrt(steps)))
    yield Row(case, "spread of E − E₀ over 16 starts, in u √N (|K| + |V|)", walk, WALK)
    yield Row(case, "mean drift of 16 starts, in standard errors", drift(error), ERRORS)


def _back(name: str, method: str, step: float, steps: int, seed: int) -> Iterator[Row]:
    robot, (q0, v0) = arm(name), starts(name, seed)
    options = {"duration_s": steps * step, "method": method, "step_s": step, "record_every_s": steps * step}
    there = rd.rollouts(robot, q0, v0, threads=1, **options)
    back = rd.rollouts(robot, there.q[:, -1], -there.v[:, -1], threads=1, **options)
    off = float(np.abs(back.q[:, -1] - q0).max())
    allowed = 2 * U * steps * (1 + FAST * steps * step)
    case = f"{NAMES[name]}, {method}, {steps:g} steps of {step:g} s forth and back"
    yield Row(case, "distance from the start, worst of 16, in rad", off, allowed)


def _momentum(method: str, steps: int, seed: int) -> Iterator[Row]:
    """The vertical angular momentum M₁ v of the body, by Pinocchio."""
    step, robot, (q0, v0) = step_of("body", method), arm("body"), starts("body", seed)
    runs = rd.rollouts(
        robot, q0, v0, duration_s=steps * step, method=method, step_s=step, threads=1,
        record_every_s=steps * step / SAMPLES,
    )  # fmt: skip
    vertical = np.einsum("...ij,...j->...i", robot.M(runs.q), runs.v)[..., 0]
    off = np.abs(vertical - vertical[:, :1]).max() / np.abs(vertical[:, 0]).max()
    case = f"torque-free body, {method}, {steps:g} steps of {step:g} s"
    yield Row(case, "vertical angular momentum, worst of 16, in u √N", float(off / (U * np.sqrt(steps))), WALK)


STEPS_OF = {  # of the full form: some 4 minutes on one core at most
    "planar_2r": {
        "GaussLegendre2": 10**7,
        "GaussLegendre4": 5 * 10**6,
        "GaussLegendre6": 3 * 10**6,
        "RK4": 10**6,
        "DP8": 10**6,
    },
    "body": {"GaussLegendre2": 10**6, "GaussLegendre4": 10**6, "GaussLegendre6": 10**6, "RK4": 10**5, "DP8": 10**5},
    "ur5": {"GaussLegendre2": 10**5, "GaussLegendre4": 10**5, "GaussLegendre6": 10**5, "RK4": 10**4, "DP8": 10**4},
    "panda": {"GaussLegendre2": 10**5, "GaussLegendre4": 10**5, "GaussLegendre6": 10**5},
}


def _case(name: str, method: str, steps: int, full: bool = True) -> Case:
    run = _symplectic if method.startswith("GaussLegendre") else _explicit
    return Case(f"{NAMES[name]}, {method}, {steps:g} steps", partial(run, name, method, steps), full)


def _short_steps(steps: int, full: bool = True) -> Case:
    made = partial(_rounded, "planar_2r", "GaussLegendre6", 2e-3, steps)
    return Case(f"double pendulum, GaussLegendre6, {steps:g} short steps", made, full)


def _there_and_back(steps: int, full: bool = True) -> Case:
    return Case(
        f"double pendulum, {steps:g} steps and back", partial(_back, "planar_2r", "GaussLegendre4", 0.01, steps), full
    )


CASES = [
    _case("planar_2r", "GaussLegendre4", 20_000, False),
    _case("planar_2r", "RK4", 20_000, False),
    _short_steps(20_000, False),
    _there_and_back(2_000, False),
    *(_case(name, method, steps) for name, of in STEPS_OF.items() for method, steps in of.items()),
    _short_steps(10**7),
    _there_and_back(10**6),
    Case("torque-free body, momentum over 1e+06 steps", partial(_momentum, "GaussLegendre4", 10**6), True),
]
