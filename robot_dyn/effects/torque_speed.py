"""Torque–speed lines of motors: polylines with the torque at a speed, and the fraction of a line that a demand uses.

A demand of torque and speed (τ, v) uses the fraction λ of a line τ = ℓ(|v|) if (τ, v)/λ lies on it: |τ|/λ = ℓ(|v|/λ).
Unlike |τ|/ℓ(|v|), it is defined at the no-load speed, where ℓ = 0; where ℓ is constant, both are equal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf
from typing import final

import numpy as np

from robot_dyn.foundations.errors import RobotDynError, shown

Points = tuple[tuple[float, float], ...]
"""Corners (speed, torque) of a line: the torque is constant below the first speed and above the last one."""
NO_LINE = np.array([[0.0], [inf]])
"""Speed and torque of a joint without a line."""

_ROUNDING = 1e-12


@final
@dataclass(frozen=True, eq=False)
class TorqueSpeed:
    """The lines of n joints, with corners padded to the same number k by repeating the last one.

    Attributes:
        speed: Speeds of the corners, (n, k), in [rad/s] or [m/s].
        torque: Torques there, (n, k), in [N m] or [N]; inf for a joint without a line.
    """

    speed: np.ndarray
    torque: np.ndarray

    @classmethod
    def padded(cls, lines: Sequence[np.ndarray]) -> TorqueSpeed:
        """Return the lines of joints, each an array of speeds and torques, (2, k)."""
        size = max(line.shape[1] for line in lines)
        table = np.stack([np.pad(line, ((0, 0), (0, size - line.shape[1])), "edge") for line in lines], axis=1)
        return cls(*table)

    @classmethod
    def of_joints(cls, lines: Mapping[str, Points], joint_names: Sequence[str]) -> TorqueSpeed | None:
        """Return the lines of joints by name; None if no joint has one."""
        if not any(name in lines for name in joint_names):
            return None
        return cls.padded([np.transpose(lines[name]) if name in lines else NO_LINE for name in joint_names])

    @property
    def exists(self) -> np.ndarray:
        """True for joints with a line, (n,)."""
        return np.isfinite(self.torque[:, 0])

    @property
    def finite(self) -> np.ndarray:
        """Torques at the corners, (n, k); 1 for joints without a line."""
        return np.where(self.exists[:, None], self.torque, 1.0)

    @property
    def slopes(self) -> np.ndarray:
        """Slopes before, between and after the corners, (n, k + 1)."""
        step = np.diff(self.speed)
        inner = np.divide(np.diff(self.finite), step, out=np.zeros_like(step), where=step > 0)
        return np.pad(inner, ((0, 0), (1, 1)))

    def times(self, factor: float | np.ndarray) -> TorqueSpeed:
        """Return the lines with torques times a factor, a scalar or (n,)."""
        return replace(self, torque=np.reshape(factor, (-1, 1)) * self.torque)

    def at(self, v: np.ndarray) -> np.ndarray:
        """Return ℓ(|v|), (..., n)."""
        columns = zip(np.moveaxis(np.abs(v), -1, 0), self.speed, self.torque, strict=True)
        return np.stack([np.interp(*column) for column in columns], axis=-1)

    @property
    def hull(self) -> tuple[np.ndarray, np.ndarray]:
        """Torque at rest and slope, (n, m) each, of straight lines whose minimum is the concave hull; slope 0: none."""
        starts = np.where(self.exists, self.torque[:, 0], 0.0)[:, None].repeat(len(self.speed.T), axis=1)
        slopes = np.zeros_like(starts)
        for i, (x, y) in enumerate(zip(self.speed, self.torque, strict=True)):
            pairs = [(j, k) for j in range(len(x)) for k in range(j + 1, len(x)) if x[k] > x[j]]
            lines = [(y[j] - b * x[j], b) for j, k in pairs for b in [(y[k] - y[j]) / (x[k] - x[j])]]
            above = [(a, b) for a, b in lines if (a + b * x >= y - _ROUNDING * y[0]).all() and b < 0]
            for m, (a, b) in enumerate(sorted(set(above))[: len(x)]):
                starts[i, m], slopes[i, m] = a, b
        return starts, slopes

    def used(self, tau: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Return the fraction λ of the lines that |τ| at the speed |v| uses, (..., n); 0 without a line."""
        tau, v, x, y, slope = np.abs(tau), np.abs(v), self.speed, self.finite, self.slopes
        start = np.concatenate([y[:, :1], y], axis=1) - slope * np.concatenate([x[:, :1], x], axis=1)
        piece = (y * v[..., None] > tau[..., None] * x).sum(axis=-1)  # the number of corners above the ray to (τ, v)
        rows = np.arange(len(x))
        slope, start = slope[rows, piece], start[rows, piece]
        # beyond the last corner, at torque 0, the ray runs along the axis of speeds
        level = np.divide(tau - slope * v, start, out=np.full_like(tau, inf), where=start > 0)
        return np.where(self.exists, np.where((tau == 0) & (start <= 0), v / np.maximum(x[:, -1], 1e-300), level), 0.0)


def check_line(name: str, speed: np.ndarray, torque: np.ndarray, error: type[RobotDynError]) -> None:
    """Raise an error unless the speeds of a polyline increase, and its torques do not."""
    if np.shape(speed) != np.shape(torque):
        raise error(f"{name}: got {len(speed)} speeds and {len(torque)} torques; give one torque for each speed")
    if not torque[0] > 0:
        raise error(f"{name}: torque must begin with a positive value, got {torque[0]:g}")
    step = np.diff(speed)
    if ((step < 0) | ((step == 0) & (np.diff(torque) != 0))).any():
        raise error(f"{name}: speed must increase from point to point, got {shown(np.asarray(speed).tolist())}")
    if (np.diff(torque) > 0).any():
        raise error(f"{name}: torque must not increase with speed, got {shown(np.asarray(torque).tolist())}")
