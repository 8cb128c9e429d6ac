"""The cross-check: every robot of the catalog agrees by both implementations, and a wrong one is caught and named."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Lagrangian, ModelWarning, compare
from robot_dyn.cross_check import random_state
from robot_dyn.foundations import DescriptionError, QueryError
from robot_dyn.lagrange import Linkage
from tests.long import robots

REFUSED = {"alex_psyonic_hands", "hector", "iris_simple", "ur3_empty"}  # a mimic of nothing; nothing moves; no link


def quiet(name: str) -> rd.Robot:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        return rd.load(name)


@pytest.mark.parametrize("name", robots(without=REFUSED))
def test_the_implementations_agree_on(name: str) -> None:
    """1e-12 on the scale of the terms added; forward dynamics max(1e-12, 8 n u κ) in the norm of M."""
    result = compare(quiet(name), samples=2, seed=3)
    assert result.ok, result.worst
    quantities = {agreement.quantity for agreement in result.agreements}
    expected = {"M", "C", "N", "inverse_dynamics", "kinetic_energy", "potential_energy", "momentum", "jacobian"}
    of_file = {"file: links and joints", "file: origin", "file: axis", "file: limits", "file: mass", "file: inertia"}
    assert expected | of_file <= quantities
    assert not any("yourdfpy" in note for note in result.notes)
    assert ("forward_dynamics" in quantities) != any("no forward dynamics" in note for note in result.notes)


@pytest.mark.parametrize("name", sorted(REFUSED))
def test_a_refused_robot_says_why(name: str) -> None:
    with pytest.raises(DescriptionError, match=r"no joint moves|not defined|has no <link>"):
        rd.load(name)


def test_a_robot_of_69_files_is_each_in_the_catalog() -> None:
    """example-robot-data 6.0.0 has 69 URDFs, urdf/ nine; no two share a name."""
    assert len(rd.list_robots()) == 69 + 9


@pytest.mark.parametrize("name", ["ur5", "skew_tree", "mimic_chain"])
def test_edited_robots_agree(name: str) -> None:
    """Gravity in any direction, armature, payload and a lock are taken by both implementations alike."""
    robot = rd.load(name)
    payload = rd.Payload(robot.frame_names[-1], 0.8, (0.05, -0.02, 0.1), np.diag([0.01, 0.02, 0.025]).tolist())
    edited = robot.with_(gravity=(1.0, -2.0, 3.0), armature=0.3, payload=payload, lock={robot.joint_names[-1]: 0.4})
    result = compare(edited, samples=5)
    assert result.ok, result.worst


@pytest.mark.parametrize(
    ("member", "change", "quantities"),
    [
        (
            "gravity",
            lambda g: g + np.array([0, 0, 1e-10]),
            {"N", "inverse_dynamics", "potential_energy", "M a + C v + N = ID"},
        ),
        ("armature", lambda a: a + 1e-11, {"M", "momentum", "kinetic_energy"}),
    ],
)
def test_an_implementation_that_errs_by_1e_11_is_caught(monkeypatch, member: str, change, quantities: set[str]) -> None:
    """One number moved by 1e-11 of its size: only quantities that depend on it are named."""
    robot = rd.load("planar_2r").with_(gravity=(0.3, 0.5, -9.0))
    whole = Lagrangian.linkage.func  # pyright: ignore[reportFunctionMemberAccess]

    def wrong(self: Lagrangian) -> Linkage:
        linkage = whole(self)
        return replace(linkage, **{member: change(getattr(linkage, member))})

    monkeypatch.setattr(Lagrangian, "linkage", property(wrong))
    result = compare(robot, samples=5)
    failed = {agreement.quantity for agreement in result.agreements if not agreement.ok}
    assert quantities <= failed
    assert not {"jacobian", "placement", "C"} & failed


def test_a_disagreement_names_its_state_and_entry(monkeypatch) -> None:
    """N of the second joint moved by 1e-9 N m: the worst entry is that joint, at a state that reproduces it."""
    robot, original = rd.load("planar_2r").with_(gravity=(0.0, 0.0, -9.81)), Lagrangian.N
    monkeypatch.setattr(Lagrangian, "N", lambda self, q: original(self, q) + np.array([0.0, 1e-9]))
    result = compare(robot, samples=4)
    assert not result.ok
    (N,) = (agreement for agreement in result.agreements if agreement.quantity == "N")
    assert not N.ok
    assert N.entry == "joint_2"
    assert N.pinocchio == robot.N(N.state["q"])[1]
    np.testing.assert_allclose(N.own - N.pinocchio, 1e-9, rtol=1e-5)


def test_a_comparison_is_repeatable() -> None:
    robot = rd.load("ur5")
    assert compare(robot, samples=2, seed=1) == compare(robot, samples=2, seed=1)
    assert compare(robot, samples=2, seed=1) != compare(robot, samples=2, seed=2)


def test_samples_must_be_positive() -> None:
    with pytest.raises(QueryError, match="samples must be a whole number, from 1 to 1000000, got 0"):
        compare(rd.load("ur5"), samples=0)


def test_states_lie_within_the_limits_and_have_no_zeros() -> None:
    robot = rd.load("panda")
    rng = np.random.default_rng(0)
    for _ in range(20):
        state = random_state(robot, rng)
        assert np.all((state["q"] >= robot.lower) & (state["q"] <= robot.upper))
        assert all(np.all(x != 0) for x in state.values())


@pytest.mark.parametrize(
    ("options", "said"), [({"seed": -1}, "seed"), ({"samples": 1.5}, "samples"), ({"samples": True}, "samples")]
)
def test_states_and_seeds_are_counted_in_whole_numbers(options, said) -> None:
    with pytest.raises(QueryError, match=f"{said} must be a whole number"):
        rd.compare(rd.load("pendulum"), **options)
