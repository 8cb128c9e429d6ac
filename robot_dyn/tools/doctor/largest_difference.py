"""The largest differences of N and M of two robots, found by random states and local ascent within the joint limits.

    ΔN_j(q) = s_j N_b,j(s q + o) − N_a,j(q),   ΔM_jk(q) = s_j s_k M_b,jk(s q + o) − M_a,jk(q)

A search proves no bound: the largest difference found is a lower bound of the largest one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.foundations import largest_found, search_box
from robot_dyn.queries import of_joint
from robot_dyn.tools.doctor.coordinate_map import JointMap

_ROUNDING = 1e-12  # of the largest entry of N or M: smaller differences are rounding


@final
@dataclass(frozen=True)
class Share:
    """Contribution of a body to a difference.

    Attributes:
        link: Link of a that the joint of the body carries, or "(armature)".
        value: Contribution, in the unit of the difference.
    """

    link: str
    value: float


@final
@dataclass(frozen=True)
class LargestDifference:
    """The largest |b − a| found of N or of a row of M.

    Attributes:
        joint: Joint of a, the row.
        quantity: "N" or "M".
        column: Joint of the column of M; empty for N.
        unit: Unit of the values.
        a, b: Values in both descriptions, in the coordinates of a.
        effort_fraction: |b − a| of N as a fraction of the smaller effort limit; nan without limits, and for M.
        q: Posture, coordinates of a, in [rad] or [m].
        shares: Contributions of the bodies to b − a, largest first; their sum is b − a.
    """

    joint: str
    quantity: str
    column: str
    unit: str
    a: float
    b: float
    effort_fraction: float
    q: tuple[float, ...]
    shares: tuple[Share, ...]

    @property
    def difference(self) -> float:
        """The difference b − a."""
        return self.b - self.a


class MappedPair(NamedTuple):
    """Two robots, with b in the coordinates of a: q_b[order] = sign q_a + offset."""

    a: Robot
    b: Robot
    order: np.ndarray
    sign: np.ndarray
    offset: np.ndarray
    bodies: Mapping[str, str]  # joint of a for each matched joint of b

    def of_b(self, q: np.ndarray) -> np.ndarray:
        """Return coordinates of b, (..., n)."""
        q_b = np.empty_like(q)
        q_b[..., self.order] = self.sign * q + self.offset
        return q_b

    def N(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return N of a and of b in the coordinates of a, (..., n)."""
        return self.a.N(q), self.sign * self.b.N(self.of_b(q))[..., self.order]

    def M(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return M of a and of b in the coordinates of a, (..., n, n)."""
        M = self.b.M(self.of_b(q))[..., self.order[:, None], self.order]
        return self.a.M(q), self.sign[:, None] * self.sign * M

    def limits_of_b(self) -> tuple[np.ndarray, np.ndarray]:
        """Return the position limits of b in the coordinates of a."""
        ends = np.stack([self.sign * (x[self.order] - self.offset) for x in (self.b.lower, self.b.upper)])
        return ends.min(axis=0), ends.max(axis=0)


def mapped_pair(a: Robot, b: Robot, maps: tuple[JointMap, ...]) -> MappedPair:
    """Return both robots with the maps of all joints of a, which include its coordinates."""
    of = {x.a: x for x in maps}
    chosen = [of[name] for name in a.joint_names]
    return MappedPair(
        a, b,
        np.array([b.joint_names.index(x.b) for x in chosen]),
        np.array([float(x.sign) for x in chosen]),
        np.array([x.offset for x in chosen]),
        {x.b: x.a for x in maps},
    )  # fmt: skip


def largest_differences(
    pair: MappedPair, links: Mapping[str, str], samples: int, seed: int
) -> Iterator[LargestDifference]:
    """Yield the largest difference found of N, then of M, for each joint of a.

    Args:
        pair: The robots.
        links: Link that each joint of a carries.
        samples: Number of random states.
        seed: Seed of the random generator.
    """
    n = pair.a.n
    low, high = _box(pair)
    states = np.random.default_rng(seed).uniform(low, high, (samples, n))
    for quantity, query in (("N", pair.N), ("M", pair.M)):
        value_a, value_b = query(states)
        difference, rounding = value_b - value_a, _ROUNDING * np.abs(value_a).max()
        for j in range(n):
            k = () if quantity == "N" else (int(np.argmax(np.abs(difference[:, j]).max(axis=0))),)
            at = (j, *k)
            q = largest_found(
                lambda q, at=at, query=query: np.subtract(*(x[(slice(None), *at)] for x in query(q))),
                states, difference[(slice(None), *at)], low, high,
            )  # fmt: skip
            first, second = (float(x[at]) for x in query(q))
            second = first if abs(second - first) <= rounding else second
            yield _reported(pair, links, quantity, at, q, first, second)


def _box(pair: MappedPair) -> tuple[np.ndarray, np.ndarray]:
    """Return the limits of the search: positions that both robots may take, at most a turn, or ±1 m of a slide.

    Where limits exclude each other, such as 0 to 2π and −2π to 0, those of a count.
    """
    low_b, high_b = pair.limits_of_b()
    low, high = np.maximum(pair.a.lower, low_b), np.minimum(pair.a.upper, high_b)
    low, high = np.where(low < high, (low, high), (pair.a.lower, pair.a.upper))
    return search_box(low, high, pair.a.joint_types)


def _reported(
    pair: MappedPair, links: Mapping[str, str], quantity: str, at: tuple[int, ...], q: np.ndarray, a: float, b: float
) -> LargestDifference:
    names, kinds, limits = (
        pair.a.joint_names,
        pair.a.joint_types,
        (pair.a.effort_limit, pair.b.effort_limit[pair.order]),
    )
    j, k = at[0], at[-1]
    limit = min((float(x[j]) for x in limits if 0 < x[j] < np.inf), default=np.nan)
    if quantity == "N":
        unit = of_joint("N m", kinds[j])
    else:
        unit = ("kg m²", "kg m", "kg")[(kinds[j] == "prismatic") + (kinds[k] == "prismatic")]
    return LargestDifference(
        joint=names[j],
        quantity=quantity,
        column=names[k] if quantity == "M" else "",
        unit=unit,
        a=a,
        b=b,
        effort_fraction=abs(b - a) / limit if quantity == "N" else np.nan,
        q=tuple(map(float, q)),
        shares=_shares(pair, links, at, q) if a != b else (),
    )


def _shares(pair: MappedPair, links: Mapping[str, str], at: tuple[int, ...], q: np.ndarray) -> tuple[Share, ...]:
    """Return the contributions of the bodies to ΔN_j or ΔM_jk, by the regressor: τ_j = Σ Y_j,body θ_body."""
    shares: dict[str, float] = {}
    j, k = at[0], at[-1]
    for robot, sign, matches, place in (
        (pair.a, -1.0, {name: name for name in pair.a.body_names}, np.arange(pair.a.n)),
        (pair.b, float(pair.sign[j] * (pair.sign[k] if len(at) > 1 else 1.0)), pair.bodies, pair.order),
    ):
        x, still = q if robot is pair.a else pair.of_b(q), np.zeros(pair.a.n)
        Y = robot.regressor(x, still, still)
        if len(at) > 1:
            Y = robot.regressor(x, still, np.eye(pair.a.n)[place[k]]) - Y
            if j == k:
                shares["(armature)"] = shares.get("(armature)", 0.0) + sign * float(robot.armature[place[j]])
        parts = (Y[place[j]] * robot.inertial_parameters).reshape(len(robot.body_names), -1).sum(axis=1)
        for name, part in zip(robot.body_names, parts, strict=True):
            body = matches.get(name, name)
            shares[links.get(body, body)] = shares.get(links.get(body, body), 0.0) + sign * float(part)
    ordered = sorted(shares.items(), key=lambda entry: -abs(entry[1]))
    return tuple(Share(name, value) for name, value in ordered if value != 0)
