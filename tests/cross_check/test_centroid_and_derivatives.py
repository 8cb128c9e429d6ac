"""Centre of mass, centroidal momentum, derivatives of inverse dynamics and the regressor of Slotine and Li."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.description import check
from robot_dyn.foundations import QueryError
from tests.queries import general

ENGINES = [lambda robot: robot, rd.Lagrangian]
ARMS = ["planar_2r", "skew_tree", "ur5", "mimic"]


def arm(name: str) -> rd.Robot:
    """An arm with armature; "mimic" has a coupled joint with ratio and offset."""
    if name != "mimic":
        robot = rd.load(name)
        return robot.with_(armature=np.linspace(0.1, 0.4, robot.n))
    text = rd.load("skew_tree").description.text
    parts = str(text, "utf-8").split("</joint>")
    moving = [i for i, part in enumerate(parts) if 'type="revolute"' in part or 'type="continuous"' in part]
    source = parts[moving[0]].split('<joint name="')[1].split('"')[0]
    parts[moving[-1]] += f'<mimic joint="{source}" multiplier="-1.7" offset="0.3"/>'
    return rd.Robot(check("</joint>".join(parts).encode(), "mimic"))


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ARMS)
def test_derivatives_of_inverse_dynamics_are_extrapolated_differences(name: str, engine: Any) -> None:
    """Central differences of step 1e-4 extrapolated once: error O(h⁴) ~ 1e-14 and rounding 1e-16 / 1e-4 = 1e-11."""
    robot = arm(name)
    dynamics, (q, v, a) = engine(robot), general(robot, 4)
    by_q, by_v, by_a = dynamics.inverse_dynamics_derivatives(q, v, a)

    def slope(x: np.ndarray, of: int) -> np.ndarray:
        def one(h: float) -> np.ndarray:
            columns = []
            for step in h * np.eye(robot.n):
                up, down = [q, v, a], [q, v, a]
                up[of], down[of] = x + step, x - step
                columns.append((robot.inverse_dynamics(*up) - robot.inverse_dynamics(*down)) / (2 * h))
            return np.array(columns).T

        return (4 * one(1e-3) - one(2e-3)) / 3

    size = np.abs(by_q).max() + np.abs(by_v).max()
    np.testing.assert_allclose(by_q, slope(q, 0), rtol=0, atol=1e-10 * size)
    np.testing.assert_allclose(by_v, slope(v, 1), rtol=0, atol=1e-10 * size)
    np.testing.assert_allclose(by_v, 2 * robot.C(q, v), rtol=0, atol=1e-12 * size)
    np.testing.assert_allclose(by_a, robot.M(q), rtol=0, atol=1e-12 * np.abs(by_a).max())


def test_derivatives_of_inverse_dynamics_are_pinocchios() -> None:
    robot = arm("ur5")
    q, v, a = general(robot, 5)
    data = robot.model.createData()
    by_q, by_v, M = pin.computeRNEADerivatives(robot.model, data, q, v, a)
    ours = robot.inverse_dynamics_derivatives(q, v, a)
    for one, two in zip(ours, (by_q, by_v, np.triu(M) + np.triu(M, 1).T), strict=True):
        np.testing.assert_allclose(one, two, rtol=0, atol=1e-12 * np.abs(two).max())


@pytest.mark.parametrize("engine", ENGINES)
def test_centre_of_mass_of_the_planar_2r_is_its_closed_form(engine: Any) -> None:
    robot = rd.load("planar_2r")
    dynamics, (q, v, _) = engine(robot), general(robot, 6)
    (m1, c1), (m2, c2) = ((body.mass, body.lever) for body in robot.model.inertias[1:])
    elbow = robot.placement(np.zeros(2), robot.joint_names[1])[:3, 3]
    home = robot.placement(np.zeros(2), robot.joint_names[0])[:3, :3]
    axis = home @ robot.jacobian(np.zeros(2), robot.joint_names[0], expressed_in="body")[3:, 0]

    def turned(angle: float) -> np.ndarray:
        return pin.AngleAxis(angle, axis).matrix()

    placed = turned(q[0]) @ home @ c1, turned(q[0]) @ elbow + turned(q.sum()) @ home @ c2
    c = (m1 * placed[0] + m2 * placed[1]) / (m1 + m2)
    np.testing.assert_allclose(dynamics.centre_of_mass(q), c, rtol=0, atol=1e-12)
    arm_2 = m2 * np.cross(axis, turned(q.sum()) @ home @ c2) / (m1 + m2)
    J = np.array([np.cross(axis, c), arm_2]).T
    np.testing.assert_allclose(dynamics.centre_of_mass_jacobian(q), J, rtol=0, atol=1e-12)
    rate_2 = np.cross(v.sum() * axis, arm_2)
    rate = np.array([np.cross(axis, J @ v), rate_2]).T
    np.testing.assert_allclose(dynamics.centre_of_mass_jacobian_rate(q, v), rate, rtol=0, atol=1e-12)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ARMS)
def test_linear_momentum_is_mass_times_velocity_of_the_centre(name: str, engine: Any) -> None:
    """h_G = A_G v: m ċ and, about c, the sum of Pinocchio's bodies; V = −m gᵀ c. 1e-12 of the largest entry."""
    robot = arm(name)
    dynamics, (q, v, _) = engine(robot), general(robot, 7)
    m = sum(body.mass for body in robot.model.inertias[1:])
    c, J, A = dynamics.centre_of_mass(q), dynamics.centre_of_mass_jacobian(q), dynamics.centroidal_momentum_matrix(q)
    np.testing.assert_allclose(A[:3], m * J, rtol=0, atol=1e-12 * np.abs(A).max())
    np.testing.assert_allclose(robot.potential_energy(q), -m * robot.gravity @ c, rtol=1e-12)
    data = robot.model.createData()
    h = pin.computeCentroidalMomentum(robot.model, data, robot.couplings.position(q), robot.couplings.velocity(v))
    np.testing.assert_allclose(A @ v, h.vector, rtol=0, atol=1e-12 * np.abs(A).max())
    ahead, back = (dynamics.centre_of_mass_jacobian(q + step * v) for step in (1e-5, -1e-5))
    rate = dynamics.centre_of_mass_jacobian_rate(q, v)
    np.testing.assert_allclose(rate, (ahead - back) / 2e-5, rtol=0, atol=1e-9)  # h = 1e-5: O(h²) and u / h


@pytest.mark.parametrize("engine", [*ENGINES, lambda robot: rd.compiled(robot, cache=False)])
@pytest.mark.parametrize("name", ["skew_tree", "mimic"])
def test_regressor_with_a_reference_velocity_is_that_of_slotine_and_li(name: str, engine: Any) -> None:
    """Y θ = M a + C v_r + N with C of Ṁ = C + Cᵀ, single or in a batch; 1e-12 of the torque."""
    robot = arm(name)
    dynamics, rng = engine(robot), np.random.default_rng(8)
    q, v, a, v_r = rng.uniform(-1, 1, (4, 3, robot.n))
    Y = dynamics.regressor(q, v, a, v_r)
    np.testing.assert_allclose(dynamics.regressor(q[0], v[0], a[0], v_r[0]), Y[0], rtol=0, atol=1e-12 * np.abs(Y).max())
    weightless = robot.with_(armature=np.zeros(robot.n))
    tau = np.einsum("kij,kj->ki", weightless.M(q), a) + weightless.N(q)
    tau += np.einsum("kij,kj->ki", weightless.C(q, v), v_r)
    np.testing.assert_allclose(Y @ robot.inertial_parameters, tau, rtol=0, atol=1e-12 * np.abs(tau).max())
    s = np.einsum("ki,kij,kj->k", v, dynamics.regressor(q, v, 0 * a, v), robot.inertial_parameters[None])
    power = np.einsum("ki,ki->k", v, robot.coriolis_torque(q, v) + robot.N(q))
    np.testing.assert_allclose(s, power, rtol=0, atol=1e-12 * np.abs(power).max())


def test_regressor_with_a_reference_velocity_encloses_the_truth() -> None:
    robot = rd.load("planar_2r")
    q, v, a = general(robot, 9)
    Y = rd.Lagrangian(robot, rd.accuracy.Ball(200)).regressor(q, v, a, a)
    np.testing.assert_allclose(rd.accuracy.midpoint(Y), robot.regressor(q, v, a, a), rtol=0, atol=1e-13)
    assert np.max(rd.accuracy.radius(Y)) < 1e-50


@dataclass(frozen=True, eq=False)
class SlotineLi(rd.control.Controller):
    """τ = Y(q, v, v_r, a_r) θ − K (v − v_r), v_r = −2 q."""

    model: rd.Robot
    theta: np.ndarray
    n: int = 2  # pyright: ignore[reportIncompatibleMethodOverride]
    state_size: int = 0  # pyright: ignore[reportIncompatibleMethodOverride]

    def thresholds(self) -> tuple[()]:
        return ()

    def torque(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        return self.model.regressor(q, v, -2 * v, -2 * q) @ self.theta - 5 * (v + 2 * q)


def test_a_controller_with_the_regressor_of_slotine_and_li_compiles() -> None:
    """Both loops take the same fixed steps: 1e-12 for 50 of them."""
    robot = rd.load("planar_2r")
    law, fixed = SlotineLi(robot, robot.inertial_parameters), {"method": "RK4", "step_s": 0.01, "duration_s": 0.5}
    loops = ("compiled", "interpreted")
    ends = [rd.simulate(robot, [0.3, -0.8], controller=law, engine=loop, **fixed).q[-1] for loop in loops]
    np.testing.assert_allclose(*ends, rtol=0, atol=1e-12)
    assert np.abs(ends[0]).max() < 0.4


def test_reference_velocity_of_another_shape_is_refused() -> None:
    robot = rd.load("planar_2r")
    q, v, a = general(robot, 9)
    with pytest.raises(QueryError, match="v_r"):
        robot.regressor(q, v, a, [1.0])
    with pytest.raises(QueryError):
        robot.regressor(q, np.ones((3, 2)), a, np.ones((2, 2)))


def test_an_arm_without_mass_has_no_centre_of_mass() -> None:
    massless = rd.load("planar_2r").with_(armature=[1.0, 1.0], mass_scale=1e-300)
    assert np.isfinite(massless.centre_of_mass(np.ones(2))).all()
    text = '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous"><parent link="a"/>'
    robot = rd.Robot(check((text + '<child link="b"/><axis xyz="0 0 1"/></joint></robot>').encode(), "r"))
    for ask in (robot.centre_of_mass, robot.centroidal_momentum_matrix):
        with pytest.raises(QueryError):
            ask([0.0])
