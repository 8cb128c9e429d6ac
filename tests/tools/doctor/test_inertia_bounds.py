"""Moments that a mass within a shape cannot have are found in each direction, and the mistake behind them is named."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from robot_dyn.tools.doctor.inertia_bounds import SLACK, Body, excess, matrix
from robot_dyn.tools.doctor.repairs import KEYS, repairs

CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2


def body(rng: np.random.Generator) -> Body:
    """A solid box with edges of 3 to 60 cm and the density of a link, turned and away from the origin of its link."""
    edges = np.exp(rng.uniform(np.log(0.03), np.log(0.6), 3))
    volume, R = float(edges.prod()), np.linalg.qr(rng.normal(size=(3, 3)))[0]
    own = R @ np.diag((edges @ edges - edges**2) / 12) @ R.T
    mass = float(rng.uniform(500, 4000) * volume)
    origin = rng.normal(size=3) * edges.max()
    return Body(mass, mass * own, CORNERS * edges @ R.T, origin, (volume, volume * own))


def texts(body: Body) -> dict[str, str]:
    return dict(zip(KEYS, map(repr, body.moments[np.triu_indices(3)].tolist()), strict=True))


def test_no_mass_within_a_shape_exceeds_the_bound() -> None:
    """Point masses at and between the corners of a shape, whose centre is the origin of the points."""
    rng = np.random.default_rng(1)
    worst = 0.0
    for _ in range(500):
        points = rng.normal(size=(rng.integers(2, 30), 3)) * rng.uniform(0.01, 1.0, 3)
        weights = rng.dirichlet(np.full(len(points), rng.uniform(0.1, 2.0)))
        x = points - weights @ points
        moments = np.einsum(
            "k,kij->ij", weights, (x**2).sum(axis=1)[:, None, None] * np.eye(3) - x[:, :, None] * x[:, None]
        )
        worst = max(worst, excess(1.0, moments, x).ratio)
    assert 0.5 < worst <= 1 + 1e-9  # two points reach it


def test_moments_of_a_body_within_its_own_shape_raise_no_alarm() -> None:
    """Moments of 2000 links from their own shapes, each number perturbed by up to 5 %.

    The triangle inequality is another matter: thin rods break it by less than 5 %.
    """
    rng = np.random.default_rng(2)
    links = [body(rng) for _ in range(2000)]
    perturbed = [
        replace(link, moments=(lambda E: link.moments * (E + E.T) / 2)(1 + rng.uniform(-0.05, 0.05, (3, 3))))
        for link in links
    ]
    alarms = sum(excess(link.mass, link.moments, link.points).ratio > SLACK for link in perturbed)
    assert alarms <= 0.01 * len(links)


@pytest.mark.parametrize(
    ("edges", "axes", "axis", "ratio"),
    [
        # Σ of a uniform box along an edge e is m e²/12, and the bound along another edge f is m f²/4: e²/(3 f²)
        ((0.6, 0.1, 0.1), [1, 0, 2], 1, 12.0),
        ((0.6, 0.1, 0.1), [2, 1, 0], 2, 12.0),
        ((0.4, 0.3, 0.1), [2, 1, 0], 2, 16 / 3),
        ((0.4, 0.3, 0.1), [0, 2, 1], 2, 3.0),
        ((0.2, 0.5, 0.1), [0, 2, 1], 2, 25 / 3),
    ],
)
def test_moments_exchanged_between_axes_exceed_the_bound_along_the_short_one(
    edges: tuple[float, float, float], axes: list[int], axis: int, ratio: float
) -> None:
    squares = np.square(edges)
    moments = np.diag((squares.sum() - squares) / 12)[axes][:, axes]
    most = excess(2.0, 2.0 * moments, CORNERS * edges)
    assert most.ratio == pytest.approx(ratio, rel=1e-12)
    assert abs(most.n[axis]) == pytest.approx(1.0) and most.extent == pytest.approx(edges[axis] / 2)
    assert most.needed == pytest.approx(most.extent * ratio**0.5)
    assert np.trace(moments) / 2 <= (squares / 4).sum()  # the bound on ½ tr I finds none of them


def exchanged(axes: list[int]):
    P = np.eye(3)[axes]
    return lambda link: replace(link, moments=P @ link.moments @ P.T)


def parallel_axis_forgotten(link: Body) -> Body:
    d = link.origin
    return replace(link, moments=link.moments + link.mass * (d @ d * np.eye(3) - np.outer(d, d)))


def sign_of(key: str):
    signs = matrix([-1.0 if other == key else 1.0 for other in KEYS])
    return lambda link: replace(link, moments=link.moments * signs)


MISTAKES = {
    "axes x and y": exchanged([1, 0, 2]),
    "axes y and z": exchanged([0, 2, 1]),
    "sign of ixy": sign_of("ixy"),
    "parallel axis": parallel_axis_forgotten,
    "ten times": lambda link: replace(link, moments=10 * link.moments),
    "g m²": lambda link: replace(link, moments=1000 * link.moments),
    "mass": lambda link: replace(link, mass=link.mass / 10),
    "order": lambda link: replace(link, moments=matrix(link.moments[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist())),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_the_mistake_behind_impossible_moments_is_among_the_candidates(mistake: str) -> None:
    """Of 300 links: the true moments are always among the candidates; if there is one candidate, it has them."""
    rng = np.random.default_rng(3)
    counts: Counter[str] = Counter()
    for _ in range(300):
        link = body(rng)
        wrong = MISTAKES[mistake](link)
        if not wrong.impossible():
            continue
        stated = texts(wrong)
        results = [
            replace(
                link,
                mass=float(repair.texts.get("value", wrong.mass)),
                moments=matrix([float((stated | repair.texts)[key]) for key in KEYS]),
            )
            for repair in repairs(wrong, stated, repr(wrong.mass))
        ]
        right = [
            np.abs(x.moments - link.moments).max() <= 1e-3 * np.abs(link.moments).max()
            and x.mass == pytest.approx(link.mass)
            for x in results
        ]
        counts["impossible"] += 1
        counts["among"] += any(right)
        counts["single"] += len(right) == 1
        counts["single and right"] += right == [True]
    assert counts["impossible"] >= 20
    assert counts["among"] == counts["impossible"]
    assert counts["single and right"] == counts["single"]


def test_a_possible_body_is_left_alone() -> None:
    rng = np.random.default_rng(4)
    links = [body(rng) for _ in range(200)]
    assert max(excess(link.mass, link.moments, link.points).ratio for link in links) < SLACK
    assert all(link.plausible() for link in links)


@pytest.mark.parametrize(("axes", "name"), [([1, 0, 2], "x and y"), ([2, 1, 0], "x and z"), ([1, 2, 0], "x and z")])
def test_an_exchange_of_two_axes_is_named_before_an_order_with_the_same_numbers(axes: list[int], name: str) -> None:
    """A bar along x: iyy = izz, so a cyclic order of the axes gives the numbers of an exchange."""
    edges = np.array([0.6, 0.05, 0.05])
    own = np.diag((edges @ edges - edges**2) / 12)
    volume = float(edges.prod())
    wrong = Body(2.0, 2.0 * own[axes][:, axes], CORNERS * edges, np.zeros(3), (volume, volume * own))
    assert [repair.mistake for repair in repairs(wrong, texts(wrong), "2.0")] == [f"the axes {name} exchanged"]
