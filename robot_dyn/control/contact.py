"""External torques over time: contacts above a threshold, and a threshold from a log without contact.

The threshold comes from block maxima. A joint's scale s is the median of its maxima of |r| in B blocks; each block has
the number m = max |r|/s over joints and samples. If the threshold is the (k+1)-th largest m, a fresh block exceeds it
with a probability distributed as Beta(k + 1, B − k). The interval of Clopper and Pearson for k of B contains the
central interval of this distribution.

[Clopper, Pearson, The use of confidence or fiducial limits, 1934; David, Nagaraja, Order Statistics, 2003, sec. 7.2]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.foundations.validate import duration, number, numbers
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.queries.units import of_joint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

_APART = 5.0  # smallest block in time constants, so that maxima of neighbouring blocks are nearly independent
_HOUR_S = 3600.0


@final
@dataclass(frozen=True)
class Contact:
    """An interval in which the external torque exceeds its threshold.

    Attributes:
        start_s: First time, in [s].
        end_s: Last time, in [s].
        joint: Name of the joint that exceeds its threshold by the largest factor.
        torque: External torque of this joint at that time, in [N m] or [N].
    """

    start_s: float
    end_s: float
    joint: str
    torque: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class AlarmThreshold(Answer, ReadOnly):
    """A threshold of each joint, with the alarms per hour to expect without contact.

    An alarm is a block in which a joint exceeds its threshold.

    Attributes:
        joint_names: Names of the n joints.
        joint_types: Types of the joints, such as "revolute".
        torque: Threshold of |r|, (n,), in [N m] or [N].
        exceeded: Number k of blocks of the log that exceed it.
        block_count: Number B of blocks of the log.
        block_s: Length of a block, in [s].
        level: Confidence level of the interval.
        low: Lower end of the interval of alarms per hour in new logs of such motions.
        high: Upper end of this interval.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    torque: np.ndarray
    exceeded: int
    block_count: int
    block_s: float
    level: float
    low: float
    high: float

    @reported
    def alarms_per_hour(self) -> float:
        """Alarms per hour in the log itself: 3600 k/(B block_s)."""
        return _HOUR_S * self.exceeded / (self.block_count * self.block_s)

    def blocks(self) -> Iterator[Block]:
        seen = f"{self.exceeded} of {self.block_count} blocks of {self.block_s:g} s exceed it"
        yield f"{self.low:.3g} to {self.high:.3g} alarms per hour without contact, at {self.level:.0%}: {seen}"
        units = [of_joint("N m", kind) for kind in self.joint_types]
        yield Table(
            ("joint", "threshold", "unit"), tuple(zip(self.joint_names, self.torque.tolist(), units, strict=True))
        )


@final
@dataclass(frozen=True, eq=False, repr=False)
class ExternalTorque(Answer, ReadOnly):
    """The external torque on the joints over time, as `external_torque` or a `MomentumObserver` estimates it.

    Attributes:
        joint_names: Names of the n joints.
        joint_types: Types of the joints, such as "revolute".
        t: Times, (m,), in [s].
        torque: r, (m, n), in [N m] or [N], without the offset.
        offset: Mean external torque at rest, (n,), in [N m] or [N]; 0 if none was subtracted.
        bandwidth_rad_s: K, (n,), in [rad/s]: r has the time constant 1/K.
    """

    joint_names: tuple[str, ...]
    joint_types: tuple[str, ...]
    t: np.ndarray = field(metadata=UNREPORTED)
    torque: np.ndarray = field(metadata=UNREPORTED)
    offset: np.ndarray
    bandwidth_rad_s: np.ndarray

    @reported
    def largest(self) -> np.ndarray:
        """Largest |r| of each joint, (n,), in [N m] or [N]."""
        return np.abs(self.torque).max(axis=0)

    def contacts(self, threshold: ArrayLike | AlarmThreshold) -> tuple[Contact, ...]:
        """Return the intervals in which a joint exceeds its threshold; those less than 1/K apart are one contact.

        Args:
            threshold: Largest |r| without contact, a scalar or (n,), in [N m] or [N], or the result of `threshold`.

        Raises:
            ControlError: If the threshold has another shape, or is not positive.
        """
        shapes = (), (len(self.joint_names),)
        threshold = threshold.torque if isinstance(threshold, AlarmThreshold) else threshold
        threshold = numbers("threshold", threshold, *shapes, above=0, error=ControlError)
        with np.errstate(over="ignore"):  # inf exceeds, too
            share = np.abs(self.torque) / threshold
        exceeds = np.concatenate([[False], (share > 1).any(axis=1), [False]])
        starts, ends = np.flatnonzero(exceeds[1:] != exceeds[:-1]).reshape(-1, 2).T
        apart = self.t[starts[1:]] - self.t[ends[:-1] - 1] > 1 / self.bandwidth_rad_s.min()
        contacts = []
        for rows in np.split(np.arange(len(starts)), np.flatnonzero(apart) + 1) if len(starts) else ():
            start, end = starts[rows[0]], ends[rows[-1]]
            row, joint = np.unravel_index(share[start:end].argmax(), (end - start, len(self.joint_names)))
            torque = float(self.torque[start + row, joint])
            contacts.append(Contact(float(self.t[start]), float(self.t[end - 1]), self.joint_names[joint], torque))
        return tuple(contacts)

    def block_maxima(self, block_s: float = 1.0) -> np.ndarray:
        """Return the largest |r| of each joint in consecutive blocks, (B, n); an incomplete last block is omitted.

        Args:
            block_s: Length of a block, in [s]; at least 5/K, so that neighbours are nearly independent.

        Raises:
            ControlError: If blocks are shorter than 5/K, or longer than the log, or have no samples.
        """
        least = _APART / float(self.bandwidth_rad_s.min())
        block_s = duration("block_s", block_s, error=ControlError)
        length = self.t[-1] - self.t[0]
        if not least <= block_s <= length:
            raise ControlError(
                f"block_s must be from 5/K = {least:.3g} s to the {length:g} s of the log, got {block_s:g}"
            )
        count = min(int(length / block_s * (1 + 1e-12)), len(self.t))
        starts = np.searchsorted(self.t, self.t[0] + block_s * np.arange(count + 1) * (1 - 1e-12))
        if (np.diff(starts) == 0).any():
            raise ControlError(f"block_s: some blocks of {block_s:g} s have no samples; use longer blocks")
        return np.maximum.reduceat(np.abs(self.torque[: starts[-1]]), starts[:-1], axis=0)

    def threshold(
        self, alarms_per_hour: float | None = None, *, block_s: float = 1.0, level: float = 0.95
    ) -> AlarmThreshold:
        """Compute the threshold of a log without contact, from its block maxima.

        The interval of alarms per hour assumes independent blocks, and motions and noise like those of the log. It is
        approximate for few blocks, because the scales of the joints come from the same log.

        Args:
            alarms_per_hour: Upper end of the interval; None for the largest value of the log as the threshold.
            block_s: Length of a block, in [s], at least 5/K.
            level: Confidence level of the interval, between 0 and 1.

        Raises:
            ControlError: If the log is too short for `alarms_per_hour`, or a value is invalid.
        """
        from scipy.special import betaincinv  # imported here because both take time
        from scipy.stats import binomtest

        level = number("level", level, above=0, error=ControlError)
        if level >= 1:
            raise ControlError(f"level must be between 0 and 1, got {level:g}")
        maxima = self.block_maxima(block_s)
        count, per_hour = len(maxima), _HOUR_S / block_s
        scale = np.maximum(np.median(maxima, axis=0), np.finfo(float).tiny)
        ranked = np.sort((maxima / scale).max(axis=1))[::-1]

        k = 0
        if alarms_per_hour is not None:
            wanted = number("alarms_per_hour", alarms_per_hour, above=0, error=ControlError)
            highs = per_hour * betaincinv(np.arange(1, count + 1), np.arange(count, 0, -1), (1 + level) / 2)
            k = int(np.searchsorted(highs, wanted, "right")) - 1
            if k < 0:
                needed = np.log((1 - level) / 2) / min(np.log1p(-wanted / per_hour), -1e-300) * block_s
                raise ControlError(
                    f"alarms_per_hour = {wanted:g} needs a log of {np.ceil(needed):.6g} s without contact, got"
                    f" {count * block_s:g} s; record longer, or allow {highs[0]:.3g}"
                )
        interval = binomtest(k, count).proportion_ci(level, "exact")
        low, high = float(interval.low) * per_hour, float(interval.high) * per_hour
        return AlarmThreshold(
            *(self.joint_names, self.joint_types, scale * ranked[k], k, count, block_s, level, low, high)
        )

    def blocks(self) -> Iterator[Block]:
        yield f"external torque from {self.t[0]:g} to {self.t[-1]:g} s, {len(self.t)} samples"
        units = [of_joint("N m", kind) for kind in self.joint_types]
        rows = zip(self.joint_names, self.largest.tolist(), self.offset.tolist(), units, strict=True)
        yield Table(("joint", "largest", "offset", "unit"), tuple(rows))
