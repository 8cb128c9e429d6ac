"""The load of an arm from a log: ten parameters of a rigid body at its tip.

    π_loaded − π_empty = R_L θ + e,   cov e = Σ_loaded + Σ_empty,   θ = (m, m c, I) in the frame of the link

π are base parameters from a log with the load, and from one without it or from the arm's numbers. Friction and offsets
of both logs may differ. The consistent load is the nearest body with P(θ) ⪰ 0 in the metric of the covariance.
[Atkeson, An, Hollerbach 1986; Gaz, De Luca 2017; Wensing, Kim, Slotine 2018]
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Payload, Robot
from robot_dyn.description import parameters as parameters_of
from robot_dyn.foundations import (
    UNREPORTED,
    Answer,
    Block,
    Table,
    Value,
    choice,
    instance,
    read_only,
    spatial_inertia,
)
from robot_dyn.tools.identify.estimation import Estimate, Model
from robot_dyn.tools.identify.identification import CUTOFF_HZ, estimated
from robot_dyn.tools.identify.log import LogError, read_log
from robot_dyn.tools.identify.physical import MARGIN, centred, nearest_bodies, pseudo_inertia, seen_from, whitening

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.control import PiecewisePolynomial

NAMES = "m", "m cx", "m cy", "m cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"
_SIZE_M = 0.1  # [m]: unit of the centre of mass and of moments, so that columns are of similar size
_BLIND = 1e-7  # least singular value of what the log shows, relative to the largest
_PULL = 1e-3  # weight of zero, in standard errors by size, where the log shows nothing


@final
@dataclass(frozen=True, eq=False, repr=False)
class PayloadEstimate(Answer, Value):
    """The load at a link, from a log.

    Attributes:
        arm: Name of the arm.
        link: Link that carries the load; parameters are about its origin and along its axes.
        values: m, m c, I about the origin in the order of `names`, (10,), in [kg], [kg m], [kg m²]; nan where blind.
        half_widths: Half widths of the 95 % intervals, (10,); inf where blind.
        has_empty: True if a log without the load was given; otherwise errors of the arm's numbers are not included.
        is_possible: True if a rigid body with these numbers exists; otherwise `load` is the nearest one.
        load: The consistent load, for `arm.with_(payload=…)`.
    """

    arm: str
    link: str
    values: np.ndarray
    half_widths: np.ndarray
    has_empty: bool
    is_possible: bool
    load: Payload = field(metadata=UNREPORTED)

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return NAMES

    @property
    def blind(self) -> tuple[str, ...]:
        """Parameters that the log does not show."""
        return tuple(name for name, width in zip(NAMES, self.half_widths, strict=True) if np.isinf(width))

    def blocks(self) -> Iterator[Block]:
        yield f"{self.arm}: load at {self.link}, {self.load.mass:.4g} kg at {np.round(self.load.com, 4).tolist()} m"
        if not self.has_empty:
            yield "relative to the arm's numbers, whose errors are not in the intervals; give a log without load"
        load = self.load
        consistent = parameters_of(spatial_inertia(load.mass, np.array(load.com), np.array(load.inertia)))
        heading = "parameter", "estimate", "± 95 %", "nearest body"
        yield Table(heading, tuple(zip(NAMES, self.values, self.half_widths, consistent, strict=True)), digits=4)
        if self.blind:
            yield f"not seen in this log: {', '.join(self.blind)}"


def payload(
    arm: Robot,
    log: object,
    *,
    empty: object = None,
    link: str | None = None,
    reference: PiecewisePolynomial | None = None,
    gains: ArrayLike | None = None,
    cutoff_hz: float = CUTOFF_HZ,
    slow: ArrayLike | None = None,
) -> PayloadEstimate:
    """Estimate the load that an arm carries from a minute of its motion.

    The same filters, instruments and rows as in `identify` are used, and the motion must determine the same base
    parameters. With `empty`, numbers of the arm's file do not matter; only its geometry does.

    Args:
        arm: The arm without the load.
        log: Log with the load; see `identify`.
        empty: Log without the load, of any motion; by default the numbers of the arm are used.
        link: Link that carries the load; by default the last link.
        reference: The desired motion at the times of the logs, if they have no desired positions.
        gains: Drive gains, a number or (n,), in [N m/A], if the logs have currents.
        cutoff_hz: Cutoff of the filters, in [Hz].
        slow: Speed below which rows of a joint are left out, a number or (n,).

    Raises:
        LogError: If a log cannot be used, see `identify`, the link is unknown, or no joint moves it.
        MissingExtraError: If the nearest body is needed, and cvxpy or clarabel is not installed.

    Source: Atkeson, An, Hollerbach, Estimation of inertial parameters of manipulator loads and links, 1986.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=LogError)

    def estimate(source: object) -> tuple[Model, Estimate]:
        return estimated(arm, read_log(arm, source, reference, gains), cutoff_hz, slow)

    model, loaded = estimate(log)
    link = arm.frame_names[-1] if link is None else choice("link", link, arm.frame_names, error=LogError)
    r, R = len(model.base.columns), model.base.R
    y, covariance = _base(loaded, r)
    if empty is None:
        y = y - R @ arm.inertial_parameters
    else:
        other, spread = _base(estimate(empty)[1], r)
        y, covariance = y - other, covariance + spread
    A = R @ _in_bodies(arm, link)
    sizes = np.array([1.0, *[_SIZE_M] * 3, *[_SIZE_M**2] * 6])
    L = whitening(covariance)
    W, z = L @ A * sizes, L @ y
    U, s, V = np.linalg.svd(W, full_matrices=False)
    seen = s > _BLIND * s[0]
    values = V[seen].T @ (U[:, seen].T @ z / s[seen])
    errors = np.linalg.norm(V[seen].T / s[seen], axis=1)
    is_blind = np.linalg.norm(np.eye(10) - V[seen].T @ V[seen], axis=0) > np.sqrt(_BLIND)
    is_possible = not is_blind.any() and float(np.linalg.eigvalsh(pseudo_inertia(values))[0]) > MARGIN
    pulled = np.vstack([W, _PULL * np.eye(10)]), np.append(z, np.zeros(10))
    m, c, inertia = centred(sizes * (values if is_possible else nearest_bodies(*pulled)))
    body = Payload(link, m, tuple(c.tolist()), tuple(map(tuple, ((inertia + inertia.T) / 2).tolist())))
    return PayloadEstimate(
        *(arm.name, link, np.where(is_blind, np.nan, values * sizes)),
        *(np.where(is_blind, np.inf, 1.96 * errors * sizes), empty is not None, is_possible, body),
    )


def _base(found: Estimate, r: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the r base parameters of an estimate and their covariance."""
    return found.fit.values[:r], found.fit.covariance[:r, :r]


def _in_bodies(arm: Robot, link: str) -> np.ndarray:
    """Return the matrix from parameters in the frame of a link to those of all bodies, (10 N, 10)."""
    q, bodies = np.zeros(arm.n), arm.body_names
    for k in reversed(range(len(bodies))):
        g = np.linalg.inv(arm.placement(q, bodies[k])) @ arm.placement(q, link)
        moved = np.linalg.inv(arm.placement(q + 0.5, bodies[k])) @ arm.placement(q + 0.5, link)
        if np.allclose(g, moved, atol=1e-9):
            result = np.zeros((len(bodies), 10, 10))
            result[k] = seen_from(arm, q, bodies[k], link)
            return result.reshape(-1, 10)
    raise LogError(f"link {link!r} is not moved by a joint; name the link that carries the load")
