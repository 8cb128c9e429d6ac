"""An arm on joints that move like its base, against a free flyer of Pinocchio with the same motion of the base."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd


def on_moving_base(arm: rd.Robot) -> rd.Robot:
    """The arm on slides along x, y, z and rotations about x, y, z; see docs/how_to/mount_an_arm.md."""
    axes = [("prismatic", "1 0 0"), ("prismatic", "0 1 0"), ("prismatic", "0 0 1")]
    axes += [("continuous", axis) for _, axis in axes]
    body = '<inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
    text = '<link name="b0"/>' + "".join(
        f'<link name="b{k + 1}">{body}</link><joint name="base_{k}" type="{kind}"><parent link="b{k}"/>'
        f'<child link="b{k + 1}"/><axis xyz="{axis}"/>'
        '<limit lower="-100" upper="100" effort="1e9" velocity="1e3"/></joint>'
        for k, (kind, axis) in enumerate(axes)
    )
    return rd.Robot.from_text(f'<robot name="base">{text}</robot>').attach(arm, frame="b6", prefix="arm_")


@pytest.mark.parametrize("name", ["planar_2r", "skew_tree", "ur5"])
def test_torques_on_a_moving_base_are_those_of_a_free_flyer(name: str) -> None:
    """The rotations at 0 with rates w have the angular acceleration dw/dt + (w_x w_y ẑ − w_x w_z ŷ + w_y w_z x̂).

    A free flyer takes the twist in base axes and its rate, whose linear part is p̈ − ω × ṗ. 1e-12 of the largest torque.
    """
    arm, rng = rd.load(name), np.random.default_rng(3)
    q, v, a = rng.uniform(-1, 1, (3, arm.n))
    base_v, base_a = rng.uniform(-2, 2, (2, 6))
    moving = on_moving_base(arm)
    tau = moving.inverse_dynamics(np.append(np.zeros(6), q), np.append(base_v, v), np.append(base_a, a))
    (x, y, z), spin = base_v[3:], base_v[3:]
    angular = base_a[3:] + np.array([y * z, -x * z, x * y])
    linear = base_a[:3] - np.cross(spin, base_v[:3])
    flyer = pin.buildModelFromXML(arm.description.text.decode(), pin.JointModelFreeFlyer())
    place = pin.integrate(flyer, pin.neutral(flyer), np.append(np.zeros(6), q))
    state = place, np.append(base_v, v), np.concatenate([linear, angular, a])
    data = flyer.createData()
    flyer.gravity.linear = arm.gravity
    expected = pin.rnea(flyer, data, *state)[6:]
    np.testing.assert_allclose(tau[6:], expected, rtol=0, atol=1e-12 * np.abs(expected).max())
