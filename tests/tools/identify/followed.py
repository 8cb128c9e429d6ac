"""Simulated logs: an arm that follows a random Fourier series, with friction, offsets and noise."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.tools.identify import FourierSeries


@dataclass(frozen=True)
class Bench:
    """What is measured, and how.

    Attributes:
        viscous, coulomb: Friction of each joint, (n,).
        duration_s, step_s: Times of the log, in [s].
        torque_noise: Standard deviation of torques, as a part of their rms.
        encoder_noise: Standard deviation of positions, in [rad].
        late_s: Time by which torques are late, in [s].
    """

    viscous: np.ndarray
    coulomb: np.ndarray
    duration_s: float = 30.0
    step_s: float = 0.01
    torque_noise: float = 0.02
    encoder_noise: float = 1e-5
    late_s: float = 0.0


def log_of(arm: rd.Robot, bench: Bench, seed: int, offset: Any = 0.0, gain: Any = 1.0) -> dict[str, np.ndarray]:
    """Return a log of an arm that follows its reference exactly; noise does not reach the motion."""
    rng = np.random.default_rng(seed)
    series = FourierSeries(bench.duration_s, 12)
    x = rng.normal(size=(series.size, arm.n))
    x[0] = rng.uniform(-0.5, 0.5, arm.n)
    t = np.arange(0.0, bench.duration_s, bench.step_s)

    def motion(at: np.ndarray) -> list[np.ndarray]:
        return [B @ x for B in series.basis(at)]

    x[1:] *= 1.5 / np.abs(motion(t)[1]).max(axis=0)
    q, v, a = motion(t - bench.late_s)
    tau = arm.inverse_dynamics(q, v, a) + bench.viscous * v + bench.coulomb * np.sign(v) + offset
    tau = gain * tau + bench.torque_noise * np.sqrt((tau**2).mean(axis=0)) * rng.normal(size=tau.shape)
    q = motion(t)[0]
    return {"t": t, "q": q + bench.encoder_noise * rng.normal(size=q.shape), "tau": tau, "desired": q}
