"""Problems A01 and A05 of the IFToMM library of multibody benchmarks: time to 1e-5 m over 10 s.

error = the largest over samples each 0.01 s of |x − x_ref|, with x the position of the mass, or of the slider

A01, a pendulum from the horizontal, has a closed form. The reference of A05, the stiff flyball governor, is SciPy's
DOP853 at 1e-13 on equations derived by hand, which share nothing with the library.
[González, Dopico, Lugrís, Cuadrado, A benchmarking system for MBS simulation software, Multibody Syst. Dyn. 16, 2006]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import pi
from statistics import median
from typing import Any, final

import numpy as np
from scipy.integrate import solve_ivp
from scipy.special import ellipj, ellipk

import robot_dyn as rd
from benchmarks.measure import Effort, row, seconds, starter_setup, table
from robot_dyn.integrate.adaptive import ADAPTIVE

WITHIN, G = 1e-5, 9.81  # [m], [m/s²]
LADDERS: dict[str, tuple[float, ...]] = {
    "RK4": (0.02, 0.01, 5e-3, 2e-3, 1e-3, 2e-4, 1e-4),
    "DP8": (0.1, 0.05, 0.02, 0.01, 5e-4, 2e-4, 1e-4),
    "GaussLegendre6": (0.1, 0.05, 0.02, 0.01, 5e-3, 2e-3),
    "DOP853": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9),
    "Rodas5PFixed": (0.01, 5e-3, 2e-3, 1e-3),
    "Rodas5P": (1e-4, 1e-5, 1e-6, 1e-7, 1e-8),
}  # steps in [s], or tolerances


@final
@dataclass(frozen=True)
class Problem:
    """A benchmark: its scene, what is compared, and the reference."""

    scene: str
    position: Callable[[np.ndarray], np.ndarray]
    reference: Callable[[np.ndarray], np.ndarray]
    methods: tuple[str, ...]

    def setup(self, **options: Any) -> rd.Setup:
        """Its setup with other options."""
        return replace(starter_setup(self.scene), **options)


def pendulum(t: np.ndarray) -> np.ndarray:
    """X and z of the mass, (m, 2): sin(θ/2) = k sn(K − ω t), with θ from below, k = sin 45°, ω = √(g/l)."""
    m = 0.5  # k²
    sn, _, dn, _ = ellipj(ellipk(m) - np.sqrt(G) * t, m)
    half = np.sqrt(m) * sn  # sin(θ/2), and dn = cos(θ/2)
    return np.stack([-2 * half * dn, 2 * half**2 - 1], axis=-1)


# The governor: bars of 0.3 kg, 1 × 0.01 × 0.01 m, balls of 5 kg, a slider of 3 kg and 0.1 m, hinges 0.05 m off the axis
BAR, BALL, SLIDER, OFF, K, C, FREE = 0.3, 5.0, 3.0, 0.05, 8e5, 4e4, 0.5
LONG, ACROSS = BAR * 2e-4 / 12, BAR * (1 + 1e-4) / 12  # of a bar about its own axis, and across it


def about_shaft(angle: Any) -> Any:
    """Inertia about the shaft at an angle of the rods below the horizontal, by the parallel axis theorem."""
    s, c = np.sin(angle), np.cos(angle)
    rod = LONG * s**2 + ACROSS * c**2 + BAR * (OFF + c / 2) ** 2 + BALL * (OFF + c) ** 2
    return LONG + SLIDER * 0.02 / 12 + 2 * rod


def governor_rate(t: float, y: np.ndarray) -> np.ndarray:
    """Y' of y = (turn of the shaft, angle of the rods, height of the slider, their rates): both sides move alike.

    The angular momentum about the shaft is constant; with ℓ the length of a coupler and F its force,

        J ω = const,   2 I θ'' = ω² J'/2 + 2 g cos θ (m/2 + m_b) − 2 F ∂ℓ/∂θ,   m_s s'' = −2 F ∂ℓ/∂s − m_s g
    """
    _, angle, height, rate, speed = y
    s, c = np.sin(angle), np.cos(angle)
    turn = about_shaft(pi / 6) * 2 * pi / about_shaft(angle)
    slope = 4 * (LONG - ACROSS) * s * c - 2 * BAR * (OFF + c / 2) * s - 4 * BALL * (OFF + c) * s
    x, z = c / 2, 1 - s / 2 - height
    length = np.hypot(x, z)
    of_angle, of_height = -(x * s + z * c) / (2 * length), -z / length
    force = K * (length - FREE) + C * (of_angle * rate + of_height * speed)
    about_hinge = ACROSS + BAR / 4 + BALL
    falling = 2 * G * c * (BAR / 2 + BALL) - 2 * force * of_angle
    return np.array(
        [turn, rate, speed, (turn**2 * slope / 2 + falling) / (2 * about_hinge), -2 * force * of_height / SLIDER - G]
    )


def governor(t: np.ndarray, method: str = "DOP853", tolerance: float = 1e-13) -> np.ndarray:
    """The height of the slider, (m, 1)."""
    start = np.array([0.0, pi / 6, 0.5, 0.0, 0.0])
    found: Any = solve_ivp(
        governor_rate, (0.0, t[-1]), start, method=method, t_eval=t, rtol=tolerance, atol=tolerance / 10
    )
    return found.y[2][:, None]


PROBLEMS = {
    "A01, simple pendulum": Problem(
        "simple_pendulum",
        lambda q: -np.stack([np.sin(q[:, 0]), np.cos(q[:, 0])], axis=-1),
        pendulum,
        ("RK4", "DP8", "GaussLegendre6", "DOP853"),
    ),
    "A05, stiff flyball governor": Problem(
        "flyball_governor",
        lambda q: 0.5 + q[:, 3:],
        governor,
        ("DP8", "DOP853", "Rodas5PFixed", "Rodas5P"),
    ),
}


def iftomm(effort: Effort) -> None:
    """The first step or tolerance of each method that is within 1e-5 m, its error, steps and time."""
    duration = 0.05 if effort.quick else 10.0
    table("what", "method", "step or tolerance", "error, m", "steps", "time, ms")
    for name, problem in PROBLEMS.items():
        known = problem.setup(duration_s=duration, record_every_s=0.01, estimate_error=False)
        t = rd.simulate(known).t
        reference = problem.reference(t)
        for method in problem.methods:
            for number in LADDERS[method]:
                setup = replace(known, **_options(method, number))
                run = rd.simulate(setup)
                error = np.inf
                if run.outcome.ending == "finished" and len(run.t) == len(t):
                    error = float(np.abs(problem.position(run.q) - reference).max())
                if error < WITHIN:
                    repeats = 1 if effort.quick or run.statistics.wall_s > 1 else 5
                    ms = 1e3 * median(seconds(lambda: rd.simulate(setup)) for _ in range(repeats))
                    row(name, method, f"{number:g}", f"{error:.1e}", run.statistics.steps, f"{ms:.2f}")
                    break


def _options(method: str, number: float) -> dict[str, Any]:
    if method in ADAPTIVE:
        return {"method": rd.integrate.Adaptive(method, number, number), "step_s": None, "engine": "compiled"}
    return {"method": rd.integrate.method(method), "step_s": number, "engine": "compiled"}
