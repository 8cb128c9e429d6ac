"""What would be accepted and then have no effect is refused, with the place, the value and the remedy."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import Active, Effect
from robot_dyn.foundations import CatalogError, ControlError, EditError, EffectError, QueryError, SceneError

ARM = rd.load("planar_2r")
UR5 = rd.load("ur5")


# --- effects


def test_an_effect_that_is_neither_a_torque_nor_a_bound_is_never_evaluated_and_so_refused() -> None:
    class Wind(Effect):
        def torque(self, dynamics, t, q, v):
            return np.full_like(v, 7.0)

    with pytest.raises(EffectError, match="neither a Force nor a Bound and would never be evaluated; subclass"):
        rd.Plant(ARM, [Wind()])

    class Gust(Active):
        def torque(self, dynamics, t, q, v):
            return np.full_like(v, 7.0)

    q = np.array([0.3, -0.4])
    np.testing.assert_allclose(rd.Plant(ARM, [Gust()]).torque(q, q, t=0.0), 7.0)


@pytest.mark.parametrize("start_s", [0.0, 0.05, 99.0])
def test_a_wrench_on_an_unknown_link_is_refused_also_where_its_window_is_not_open_yet(start_s: float) -> None:
    wrench = rd.effects.ExternalWrench("tipp", [1.0, 0, 0, 0, 0, 0], start_s=start_s)
    for dynamics in (ARM, rd.Lagrangian(ARM)):
        with pytest.raises(EffectError, match=r"external_wrench: .*'tipp'; nearest: tip"):
            rd.Plant(dynamics, [wrench])


@pytest.mark.parametrize(
    ("robot", "effect", "message"),
    [
        (UR5, rd.effects.ViscousFriction("urdf"), "viscous='urdf' has no effect: the file of ur5 states no value"),
        (UR5, rd.effects.RegularisedCoulombFriction("urdf"), "coulomb='urdf' has no effect"),
        (rd.load("pendulum"), rd.effects.EffortLimit("urdf"), "limit='urdf' has no effect"),
        (rd.load("pendulum"), rd.effects.JointStopSpring("urdf", "urdf", 1e4), "lower='urdf' has no effect"),
    ],
)
def test_a_coefficient_that_the_file_does_not_state_is_no_effect(robot, effect, message: str) -> None:
    with pytest.raises(EffectError, match=f"{message}.*; give numbers, or remove the effect"):
        rd.Plant(robot, [effect])


# --- edits


@pytest.mark.parametrize("name", ["mass_scal", "gravitiy", "locks"])
def test_an_unknown_edit_is_answered_with_the_nearest(name: str) -> None:
    with pytest.raises(EditError, match=rf"no edit '{name}'; nearest: {name[:4]}"):
        ARM.with_(**{name: 1.2})


@pytest.mark.parametrize("name", ["gravity", "lock", "payload", "armature", "mass_scale"])
def test_an_edit_of_none_is_refused(name: str) -> None:
    """gravity=None does not mean that there is none."""
    with pytest.raises(EditError, match=rf"{name} must"):
        ARM.with_(**{name: None})


# --- files


def test_folders_of_packages_that_are_none_are_refused(tmp_path) -> None:
    with pytest.raises(CatalogError, match=r"package_dirs must be a list of folders, for example \['/opt/arms'\]"):
        rd.load("ur5", package_dirs="/opt/arms")
    with pytest.raises(CatalogError, match=r"package_dirs: there is no folder .*/arm; correct or remove it"):
        rd.load("ur5", package_dirs=[tmp_path, tmp_path / "arm"])
    assert rd.load("ur5", package_dirs=[tmp_path]).n == 6


# --- runs


def test_a_controller_whose_model_has_other_joints_than_the_plant_is_refused() -> None:
    """Two arms of six of the UR5's joints each, as many as the plant has, but not the same ones."""
    plant, model = (UR5.with_(lock={name: 0.3}) for name in ("wrist_3_joint", "shoulder_pan_joint"))
    law = rd.control.ComputedTorque(model, rd.control.hold(np.zeros(5)), kp=100.0, kd=20.0)
    with pytest.raises(QueryError, match="model has the joint 'shoulder_lift_joint' where the plant has 'shoulder_pan"):
        rd.Setup(rd.Plant(plant), np.zeros(5), controller=law)


def test_a_frame_under_control_that_the_plant_lacks_is_told_before_the_run(tmp_path) -> None:
    text = ARM.description.text.replace(b'"tip"', b'"hand"')
    (tmp_path / "arm.urdf").write_bytes(text)
    plant = rd.Plant(rd.load(tmp_path / "arm.urdf"))
    q0 = np.array([0.3, 0.9])
    p = ARM.placement(q0, "tip")[:3, 3]
    law = rd.control.OperationalSpace(ARM, "tip", rd.control.line(p, p, 1.0), kp=100.0, kd=20.0, rows=(0, 2))
    with pytest.raises(QueryError, match="'tip'"):
        rd.Setup(plant, q0, controller=law)


def test_anti_windup_without_a_limit_is_refused() -> None:
    with pytest.raises(ControlError, match="tracking_time_s has no effect without an effort_limit"):
        rd.control.PID(rd.control.hold([0.0]), kp=1.0, ki=1.0, kd=1.0, tracking_time_s=0.3)


# --- scenes

SCENE = 'robot = "planar_2r"\nduration_s = 0.1\n'
GRAVITY = '[[effect]]\nkind = "gravity"\n'
CONTROL = '[control]\nkind = "{}"\nbandwidth_rad_s = 10.0\n'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SCENE + "step_s = 0.001\n", "step_s: has no effect because auto chooses its own step; remove it, or name"),
        (SCENE + 'method = "RK4"\nrtol = 1e-8\n', "rtol: has no effect because RK4 has a fixed step"),
        (
            SCENE + 'method = "GaussLegendre6"\natol = 1e-8\n',
            "atol: has no effect because GaussLegendre6 has a fixed step",
        ),
        (SCENE + 2 * GRAVITY, "effect: gravity appears 2 times, but only the last would act; keep one"),
        (
            SCENE + 2 * '[[effect]]\nkind = "armature"\ninertia_kg_m2 = {joint_1 = 0.1}\n',
            "effect: armature appears 2 times, but only the last would act",
        ),
        (
            SCENE + CONTROL.format("pd_gravity") + 'model = {effects = [{kind = "gravity"}, {kind = "gravity"}]}\n',
            "control.model.effects: gravity appears 2 times",
        ),
        (
            SCENE + CONTROL.format("pd") + "integral_rate_per_s = 2.0\n",
            "control.integral_rate_per_s: has no effect on pd",
        ),
        (SCENE + CONTROL.format("pd") + "effort_limit_N_m = 2.0\n", "control.effort_limit_N_m: has no effect on pd"),
        (SCENE + CONTROL.format("pid") + 'frame = "tip"\n', "control.frame: has no effect on pid, only on operational"),
        (
            SCENE + '[[effect]]\nkind = "external_wrench"\nframe = "tip"\n',
            "'tip' has no effect; give force_N or torque",
        ),
        (
            SCENE + '[[effect]]\nkind = "external_wrench"\nframe = "tipp"\nforce_N = [1, 0, 0]\nstart_s = 0.05\n',
            "no frame 'tipp'; nearest: tip",
        ),
        (SCENE + '[[effect]]\nkind = "viscous_friction"\n', 'viscous_N_m_s_per_rad = "urdf" has no effect'),
        (SCENE.replace("0.1", "true"), "duration_s: .*, got True"),
        (SCENE.replace("0.1", '"0.1"'), "duration_s: .*, got '0.1'"),
        (SCENE + "estimate_error = 0\n", "estimate_error: .*, got 0"),
        (SCENE + "[start]\nq = [true, 0.1]\n", r"start.q: must be a finite number, .*, got \[True, 0.1\]"),
    ],
)
def test_what_a_scene_states_and_no_run_would_heed_is_refused(text: str, message: str, tmp_path) -> None:
    (tmp_path / "scene.toml").write_text(text)
    with pytest.raises(SceneError, match=f"scene.toml: .*{message}"):
        rd.read_scene(tmp_path / "scene.toml")


def test_two_frictions_of_a_scene_add_up(tmp_path) -> None:
    friction = '[[effect]]\nkind = "viscous_friction"\nviscous_N_m_s_per_rad = 0.3\n'
    (tmp_path / "scene.toml").write_text(SCENE + 2 * friction)
    plant = rd.read_scene(tmp_path / "scene.toml").plant
    np.testing.assert_allclose(plant.torque(np.ones(2), np.ones(2), t=0.0), -0.6)


def test_a_pid_of_a_scene_is_cut_at_the_limits_of_the_scene(tmp_path) -> None:
    text = SCENE + CONTROL.format("pid") + "effort_limit_N_m = {joint_2 = 3.5}\n"
    (tmp_path / "scene.toml").write_text(text)
    assert rd.read_scene(tmp_path / "scene.toml").controller.effort_limit.tolist() == [np.inf, 3.5]
