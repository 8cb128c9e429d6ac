"""What a run keeps for its picture: wrenches in base axes, joints at their stops, and the robot itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import at_stop, robot_of, wrenches

Q = np.array([[0.3, -1.1, 0.9, -0.6, 1.2, 0.4], [0.5, -0.9, 0.7, -0.3, 1.0, 0.2]])
F = np.array([12.0, -5.0, 7.0, 0.6, -0.4, 0.9])


@pytest.mark.parametrize("axes", ["body", "world", "world_aligned"])
def test_a_wrench_in_base_axes_does_the_same_work(axes: str) -> None:
    """τ = Jᵀ F is one torque, in whatever axes F was given: rounding of a few hundred N m, 1e-12."""
    arm = rd.load("ur5")
    effect = rd.effects.ExternalWrench("tool0", F, expressed_in=axes, end_s=1.0)
    plant = rd.Plant(arm, [effect])
    recorded = wrenches(plant, np.array([0.0, 0.5]), Q)["tool0"][:, 1:]
    J = arm.jacobian(Q, "tool0", expressed_in="world_aligned")
    for q, wrench, jacobian in zip(Q, recorded, J, strict=True):
        np.testing.assert_allclose(jacobian.T @ wrench, effect.torque(arm, 0.0, q, 0 * q), atol=1e-12)


def test_wrenches_on_one_link_add_up_and_act_in_their_windows() -> None:
    """Both sides of a switch are kept, though no sample lies there."""
    arm = rd.load("ur5")
    effects = [
        rd.effects.ExternalWrench("tool0", F, end_s=0.5),
        rd.effects.ExternalWrench("tool0", 2 * F, start_s=0.2, end_s=0.3),
    ]
    rows = wrenches(rd.Plant(arm, effects), np.array([0.0, 1.0]), Q)["tool0"]
    np.testing.assert_allclose(rows[:, 0], [0, 0.2, 0.2, 0.3, 0.3, 0.5, 0.5, 1.0], rtol=1e-6)
    np.testing.assert_allclose(rows[:, 1:], np.outer([1, 1, 3, 3, 1, 1, 0, 0], F))
    assert (np.diff(rows[:, 0].astype(np.float32)) > 0).all()


def test_a_joint_is_at_its_stop_exactly_where_the_stop_pushes() -> None:
    arm = rd.load("ur5")
    spring, damper = rd.effects.joint_stops(np.full(6, -1.0), np.full(6, 0.8))
    plant = rd.Plant(arm, [spring, damper])
    np.testing.assert_array_equal(at_stop(plant, Q), spring.torque(arm, 0.0, Q, 0 * Q) != 0)
    assert at_stop(rd.Plant(arm), Q) is None


def test_a_run_gives_its_robot_back_with_all_its_edits() -> None:
    """M, N and the limits are those of the robot that ran, to the bit."""
    payload = rd.Payload("panda_hand", 1.5, (0.0, 0.01, 0.08), ((0.01, 0.001, 0), (0.001, 0.02, 0), (0, 0, 0.015)))
    arm = rd.load("panda").with_(
        lock={"panda_finger_joint1": 0.02}, payload=payload, armature=0.1, gravity=(0.1, 0.0, -3.7), mass_scale=1.3
    )
    q = np.linspace(-0.5, 0.6, 7)
    run = rd.simulate(arm, q0=q, duration_s=0.002, estimate_error=False)
    again = robot_of(run)
    assert again.edits == arm.edits
    np.testing.assert_array_equal(again.M(q), arm.M(q))
    np.testing.assert_array_equal(again.N(q), arm.N(q))


@pytest.mark.parametrize(
    "edits",
    [
        "{}",
        "[]",
        "no JSON",
        '{"gravity": 3, "lock": [], "armature": [], "payloads": [], "mass_scale": 1}',
        '{"gravity": [0, 0, "x"], "lock": [["nobody", 1]], "armature": [], "payloads": [{}], "mass_scale": 1}',
    ],
)
def test_edits_that_are_none_are_refused(edits: str) -> None:
    run = rd.simulate(rd.load("pendulum"), q0=[0.1], duration_s=0.002, estimate_error=False)
    with pytest.raises(rd.RobotDynError, match=r"edits|gravity must"):
        robot_of(replace(run, metadata=run.metadata | {"edits": edits}))
