"""Digits do not depend on where an arm stands, nor on the lengths beside which its own are small."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.cross_check import random_state
from robot_dyn.description import check
from robot_dyn.lagrange import floored, magnitudes, scaled
from tests.chains import body, chain
from tests.queries import ARGUMENTS, FRAMED, general

FAR = {"potential_energy", "placement", "centre_of_mass"}  # have the distance in them by definition
BASES = ("1000 -300 200", "4e5 -9e5 3e5", "5e5 5e6 -1e6")  # in [m]
COM, JOINT = (0.4, 0.1, -0.2), (1.0, -0.3, 0.1)  # of a link, and of the next joint, in its length
AXES = ("0.3 0.2 1", "1 0.1 -0.4", "0.2 1 0.3", "-0.4 0.3 1")


def standing_at(xyz: str) -> rd.Robot:
    """skew_tree on a base that is fixed there."""
    text = (Path(__file__).parents[2] / "urdf" / "skew_tree.urdf").read_text()
    base = '<link name="base"'
    stand = f'<joint name="stand" type="fixed"><origin xyz="{xyz}"/><parent link="earth"/><child link="base"/></joint>'
    return rd.Robot(check(text.replace(base, f'<link name="earth"/>{stand}{base}').encode(), xyz))


@cache
def long_chain() -> rd.Robot:
    """Ten joints, one of which slides, on links of 1 km, 100 m … 1 µm and of 1001 … 1 kg."""
    parts, parent, before = ['<link name="base"/>'], "base", 0.0
    for i in range(10):
        length = 10.0 ** (3 - i)
        mass, kind = 1 + length, "prismatic" if i == 2 else "revolute"
        shares = {"ixx": 0.02, "iyy": 0.08, "izz": 0.09, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
        moments = " ".join(f'{axis}="{share * mass * length**2:.9g}"' for axis, share in shares.items())
        com, joint = (
            " ".join(f"{x:.9g}" for x in size * np.array(by)) for size, by in ((length, COM), (before, JOINT))
        )
        parts.append(
            f'<link name="link_{i}"><inertial><origin xyz="{com}" rpy="0.3 0.2 -0.5"/><mass value="{mass:.9g}"/>'
            f'<inertia {moments}/></inertial></link><joint name="joint_{i}" type="{kind}"><axis xyz="{AXES[i % 4]}"/>'
            f'<origin xyz="{joint}" rpy="0.4 -0.7 0.2"/><parent link="{parent}"/><child link="link_{i}"/>'
            '<limit lower="-1.5" upper="1.5" effort="9" velocity="9"/></joint>'
        )
        parent, before = f"link_{i}", length
    return rd.Robot(check(f'<robot name="chain">{"".join(parts)}</robot>'.encode(), "chain"))


@pytest.mark.parametrize("xyz", BASES)
@pytest.mark.parametrize("method", [*sorted(ARGUMENTS.keys() - FAR), "forward_dynamics_derivatives"])
def test_where_the_base_stands_changes_no_digit_of_the_dynamics(method: str, xyz: str) -> None:
    """Up to 5000 km: 1e-15 of the largest entry."""
    near, far = rd.load("skew_tree"), standing_at(xyz)
    state = dict(zip(("q", "v", "a"), general(near, 3), strict=True))
    state["tau"] = state["a"]
    names = ARGUMENTS.get(method, ("q", "v", "tau"))
    arguments = [state[name] for name in names] + [near.frame_names[-1]] * (method in FRAMED)
    if method == "forward_dynamics_derivatives":
        from robot_dyn.codegen.derivatives import forward_dynamics_derivatives

        here, there = (forward_dynamics_derivatives(robot, *arguments) for robot in (near, far))
    else:
        here, there = (getattr(robot, method)(*arguments) for robot in (near, far))
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-15 * np.abs(here).max())


@pytest.mark.parametrize("xyz", BASES)
def test_implementations_agree_wherever_the_base_stands(xyz: str) -> None:
    result = rd.compare(standing_at(xyz), samples=3)
    assert result.ok, result.worst


def test_implementations_agree_on_a_chain_from_a_kilometre_to_a_micrometre() -> None:
    """In all quantities to 1e-12 of the terms; C and its products to a few roundings of them, 4u."""
    result = rd.compare(long_chain(), samples=5)
    assert result.ok, result.worst
    for agreement in result.agreements:
        if "oriolis" in agreement.quantity or agreement.quantity in ("C", "Ṁ = C + Cᵀ"):
            assert agreement.error <= 4.5e-16, agreement


def test_the_coriolis_matrix_is_that_of_300_bits() -> None:
    """Entry by entry of A15's Christoffel symbols: 4u of the terms, where world axes leave 1e-7."""
    robot, rng = long_chain(), np.random.default_rng(1)
    own, proven = rd.Lagrangian(robot), rd.Lagrangian(robot, rd.accuracy.Ball(300))
    state = random_state(robot, rng)
    q, v = state["q"], state["v"]
    true, scale = rd.accuracy.midpoint(proven.C(q, v)), magnitudes(own.linkage, q).C(v)
    assert np.all(np.abs(robot.C(q, v) - true) <= 4.5e-16 * scale)
    in_world_axes = pin.computeCoriolisMatrix(robot.model, robot.model.createData(), q, v)
    assert np.max(np.abs(in_world_axes - true) / scale) > 1e-9  # the case is hard enough to tell


@pytest.mark.long
def test_kernels_of_a_chain_from_a_kilometre_to_a_micrometre_pass_their_check() -> None:
    """A kernel as right as the robot is handed out, of C and of what is solved with light links."""
    robot = long_chain()
    fast = rd.compiled(robot, cache=False)
    q, v, a = general(robot, 2)
    size = magnitudes(rd.Lagrangian(robot).linkage, q)
    assert np.all(np.abs(fast.C(q, v) - robot.C(q, v)) <= 1e-15 * size.C(v))
    tau = robot.inverse_dynamics(q, v, a)
    back = robot.inverse_dynamics(q, v, fast.forward_dynamics(q, v, tau))
    assert np.all(np.abs(back - tau) <= 1e-13 * size.inverse_dynamics(v, a))


@pytest.mark.parametrize("moment", ["1e-10", "1e-13"])
def test_a_kernel_of_a_very_light_tip_is_checked_where_it_answers(moment: str) -> None:
    """Torques of 1 N m would turn such a tip at more than 1e10 rad/s², which a kernel declines and does not write."""
    text = chain(body(2, moments=0.1), body("1e-6", moments=moment), at=("0 0 0", "1 0 0"))
    robot = rd.Robot(check(text.encode(), "light"))
    fast = rd.compiled(robot, cache=False)
    q, v, a = np.random.default_rng(6).normal(size=(3, 20, 2))
    tau = robot.inverse_dynamics(q, v, a)
    for rows in (slice(0, 1), slice(0, 20)):
        answer = fast.forward_dynamics(q[rows], v[rows], tau[rows])
        np.testing.assert_allclose(answer, robot.forward_dynamics(q[rows], v[rows], tau[rows]), rtol=1e-9, atol=1e-6)


def test_an_entry_without_terms_is_held_to_its_neighbours() -> None:
    """1e-22 beside a scale of 1e-4 is rounding of the neighbour; beside nothing at all there is no such excuse."""
    scale = np.array([[1e-4, 0.0], [0.0, 0.0]])
    error = np.array([[0.0, 1e-22], [0.0, 1e-22]])
    assert np.all(scaled(error, floored(scale)) <= 1e-17)
    assert scaled(error, floored(np.zeros((2, 2))))[0, 1] == np.inf
    np.testing.assert_array_equal(floored(np.array([3.0, 0.0, 2.0])), [3.0, 3.0, 2.0])


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")
def test_compare_says_what_it_cannot_compare() -> None:
    """Products of inertia of 1e6 make M indefinite at most states; all but forward dynamics is compared."""
    text = chain("", body(2.5, moments=(0.0003, 0.03, 0.03), ixy="1e6"), axes=("0 1 0", "0 0 1"))
    robot = rd.Robot(check(text.encode(), "indefinite"))
    result = rd.compare(robot, samples=6)
    assert result.notes[0] == "forward dynamics not compared at 4 of 6 states, where M is not positive definite"
    assert result.ok
