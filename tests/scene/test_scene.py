"""Scenes: every starter runs, what a scene does not name does not act, and a mistake is told by file, key and value."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import SceneError
from robot_dyn.scene import BY_KIND, of_scene, parse_scene, read_both, starter, starter_names
from tests.long import long

SCENE = """
robot = "planar_2r"
duration_s = 0.1
[start]
q = [0.3, -0.4]
v = {joint_2 = 0.5}
"""
PD = """
[control]
kind = "pd"
frequency_rad_per_s = 10.0
[reference]
kind = "quintic"
q = [1.0, 0.5]
duration_s = 0.5
"""


@pytest.fixture
def write(tmp_path):
    def file(text: str):
        path = tmp_path / "scene.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return file


def test_payload_starter_keeps_its_sampled_damping_below_one_reversal(write) -> None:
    """All along: the largest eigenvalue of M⁻¹ kd T is below 1, from where on torque would reverse at every tick."""
    setup = rd.read_scene(write(starter("panda_payload")))
    run, control = rd.simulate(setup, estimate_error=False), setup.controller
    worst = np.linalg.eigvals(np.linalg.solve(setup.plant.M(run.q), np.diag(control.kd))).real.max()
    assert worst * control.period_s < 0.7
    assert run.remarks == ()


@pytest.mark.parametrize("name", starter_names())
def test_starter_runs_and_closes_its_ledger(write, name: str) -> None:
    """At its own settings, cut to half a second: residual ≤ 1e-9 of the energy exchanged; no remark but of stops."""
    setup = rd.read_scene(write(starter(name)))
    run = rd.simulate(setup, duration_s=min(setup.duration_s, 0.5), estimate_error=False)
    assert run.outcome.ending == "finished"
    assert run.ledger.closure <= 1e-9
    assert {each.kind for each in run.remarks} == ({"joint_stop_reached"} if name == "stops" else set())


def test_what_a_scene_does_not_name_does_not_act(write) -> None:
    """Without gravity and effects the arm keeps its kinetic energy; N is 0 at any state."""
    setup = rd.read_scene(write(SCENE))
    assert setup.plant.effects == ()
    np.testing.assert_array_equal(setup.plant.N(0.0, [0.3, 0.4], [1.0, 2.0]), [0.0, 0.0])
    run = rd.simulate(setup)
    np.testing.assert_allclose(run.ledger.energy, run.ledger.energy[0], rtol=1e-9)


def test_start_is_by_joint_or_in_order(write) -> None:
    setup = rd.read_scene(write(SCENE))
    np.testing.assert_array_equal(setup.q0, [0.3, -0.4])
    np.testing.assert_array_equal(setup.v0, [0.0, 0.5])


EFFECTS = {
    "gravity": "",
    "viscous_friction": "damping_N_m_s_per_rad = 0.3",
    "regularised_coulomb_friction": "friction_N_m = {joint_1 = 0.2}",
    "spring": "stiffness_N_m_per_rad = 2.0\nrest_rad = [0.1, 0.2]",
    "joint_stops": "lower_rad = -1.0\nupper_rad = {joint_1 = 1.0}",
    "line_spring_damper": (
        'frame = "tip"\npoint_m = [0.1, 0.0, 0.2]\nother_point_m = [0.5, 0.0, 0.4]\n'
        "stiffness_N_per_m = 30.0\ndamping_N_s_per_m = 2.0\nlength_m = 0.7"
    ),
    "external_wrench": 'frame = "tip"\nforce_N = [1.0, 0.0, 0.0]',
    "effort_limit": "limit_N_m = 3.0",
    "actuator_lag": "time_constant_s = {joint_1 = 0.02, joint_2 = 0.05}",
    "dry_friction": "level_N_m = {joint_1 = 0.4, joint_2 = 0.2}\nstatic_N_m = 0.6",
    "rigid_stops": "lower_rad = -1.0\nupper_rad = {joint_1 = 1.0}\nrestitution = 0.3",
    "lugre_friction": (
        "bristle_stiffness_N_m_per_rad = 300.0\nbristle_damping_N_m_s_per_rad = 1.0\nviscous_N_m_s_per_rad = 0.4\n"
        "coulomb_N_m = {joint_1 = 0.7}\nbreakaway_N_m = [1.1, 1.2]\nstribeck_velocity_rad_per_s = 0.1"
    ),
    "dahl_friction": "bristle_stiffness_N_m_per_rad = 300.0\ncoulomb_N_m = {joint_1 = 0.7}\nexponent = 1.5",
    "carried_payload": 'frame = "tip"\nmass_kg = 0.5\nend_s = 0.07\npicked_up = "at_speed_of_link"',
    "series_elastic": (
        "stiffness_N_m_per_rad = {joint_2 = 80.0}\ninertia_kg_m2 = 0.02\nratio = 5.0\nbacklash_rad = 0.01"
    ),
    "rigid_backlash": "gap_rad = {joint_2 = 0.01}\ninertia_kg_m2 = 0.02\nratio = 5.0\nrestitution = 0.4",
    "payload": 'frame = "tip"\nmass_kg = 0.5',
    "armature": "inertia_kg_m2 = {joint_1 = 0.002, joint_2 = 0.001}\ngear_ratio = {joint_1 = 9.0}",
    "lock": "joints = {joint_1 = 0.2}",
}


def test_every_kind_of_effect_is_tried() -> None:
    assert set(EFFECTS) == set(BY_KIND)


@pytest.mark.parametrize("kind", EFFECTS)
def test_effect_of_a_scene_is_that_of_python(write, kind: str) -> None:
    """Each kind read from a file changes the motion as the object of the same name made by hand."""
    text = 'robot = "planar_2r"\nduration_s = 0.1\n' + f'[[effect]]\nkind = "{kind}"\n{EFFECTS[kind]}\n'
    robot = rd.load("planar_2r").with_(gravity=(0, 0, 0))
    by_hand = {
        "gravity": lambda: rd.Plant(rd.load("planar_2r")),
        "viscous_friction": lambda: rd.Plant(robot, [rd.effects.ViscousFriction(0.3)]),
        "regularised_coulomb_friction": lambda: rd.Plant(robot, [rd.effects.RegularisedCoulombFriction([0.2, 0.0])]),
        "spring": lambda: rd.Plant(robot, [rd.effects.Spring(2.0, [0.1, 0.2])]),
        "joint_stops": lambda: rd.Plant(robot, rd.effects.joint_stops([-1.0, -1.0], [1.0, 1e9])),
        "line_spring_damper": lambda: rd.Plant(
            robot,
            [
                rd.effects.LineSpringDamper(
                    "tip", None, [0.1, 0, 0.2], [0.5, 0, 0.4], stiffness=30.0, damping=2.0, length=0.7
                )
            ],
        ),
        "external_wrench": lambda: rd.Plant(robot, [rd.effects.ExternalWrench("tip", [1, 0, 0, 0, 0, 0])]),
        "effort_limit": lambda: rd.Plant(robot, [rd.effects.EffortLimit(3.0)]),
        "actuator_lag": lambda: rd.Plant(robot, [rd.effects.ActuatorLag([0.02, 0.05])]),
        "lugre_friction": lambda: rd.Plant(
            robot, [rd.effects.LuGreFriction(300.0, 1.0, 0.4, [0.7, 1.0], [1.1, 1.2], 0.1)]
        ),
        "dahl_friction": lambda: rd.Plant(robot, [rd.effects.DahlFriction(300.0, [0.7, 1.0], 1.5)]),
        "carried_payload": lambda: rd.Plant(
            robot, [rd.effects.CarriedPayload(rd.Payload("tip", 0.5), end_s=0.07, at_rest=False)]
        ),
        "series_elastic": lambda: rd.Plant(robot, [rd.effects.SeriesElastic([0.0, 80.0], 0.02, 5.0, backlash=0.01)]),
        "rigid_backlash": lambda: rd.Plant(robot, [rd.effects.RigidBacklash([0.0, 0.01], 0.02, 5.0, 0.4)]),
        "dry_friction": lambda: rd.Plant(robot, [rd.effects.DryFriction([0.4, 0.2], 0.6)]),
        "rigid_stops": lambda: rd.Plant(robot, [rd.effects.RigidStops(-1.0, [1.0, np.inf], 0.3)]),
        "payload": lambda: rd.Plant(robot.with_(payload=rd.Payload("tip", 0.5))),
        "armature": lambda: rd.Plant(robot.with_(armature=[0.002 * 81.0, 0.001])),
        "lock": lambda: rd.Plant(robot.with_(lock={"joint_1": 0.2})),
    }[kind]()
    plant = rd.read_scene(write(text)).plant
    assert [type(each) for each in plant.effects] == [type(each) for each in by_hand.effects]
    q, v, u = np.random.default_rng(3).uniform(1.0, 4.0, (3, plant.dynamics.n))
    expected = by_hand.forward_dynamics(0.05, q, v, u)
    np.testing.assert_array_equal(plant.forward_dynamics(0.05, q, v, u), expected)


@pytest.mark.parametrize("kind", ["pid", "computed_torque", *long(["pd", "pd_gravity", "feed_forward"])])
def test_every_joint_controller_follows_its_plan(write, kind: str) -> None:
    """In zero gravity all end within 5 % of the way; the gains are those of the frequency."""
    text = SCENE.replace("0.1", "1.0", 1) + PD.replace('"pd"', f'"{kind}"')
    run = rd.simulate(rd.read_scene(write(text)))
    np.testing.assert_allclose(run.q[-1], [1.0, 0.5], atol=0.05)
    assert run.tracking_error is not None


def test_explanation_names_each_term_and_its_source(write) -> None:
    text = repr(of_scene(*read_both(write(starter("panda_payload")))))
    for said in ("N = ∂V/∂q", "mass_kg = 1.5  (scene)", "limit_N_m = urdf  (the robot's file)", "not simulated"):
        assert said in text
    assert "as it acts: u_max = 87 N m, 87 N m, 87 N m, 87 N m, 12 N m, 12 N m, 12 N m" in text

    absent = text.split("not simulated")[1].split("\n\n")[0]
    assert "viscous_friction" in absent
    assert "payload" not in absent.replace("\n", ",").replace(" ", "").split(",")


def test_explanation_has_the_coefficients_of_each_effect_with_units(write) -> None:
    """In the order of their tables, of two of a kind as well; those of a prismatic joint in its own units."""
    text = """robot = "cart_pole"
duration_s = 0.1
[[effect]]
kind = "viscous_friction"
[[effect]]
kind = "joint_stops"
lower_rad = -1.0
upper_rad = {slide = 1.0}
[[effect]]
kind = "viscous_friction"
damping_N_m_s_per_rad = 0.3
[[effect]]
kind = "line_spring_damper"
frame = "pole"
point_m = [0.1, 0.0, 0.2]
stiffness_N_per_m = 30.0
damping_N_s_per_m = 2.0
length_m = 0.7
"""
    said = [line.strip() for line in repr(of_scene(*read_both(write(text)))).splitlines() if "as it acts" in line]
    assert said[0] == "as it acts: b = 0.8 N s/m, 0.02 N m s/rad"
    assert "Lower stop = -1 m, -1 rad; Upper stop = 1 m, none" in said[1] and "k = 10000 N/m, 10000 N m/rad" in said[1]
    assert said[2] == "as it acts: b = 0.3 N s/m, 0.3 N m s/rad"
    assert said[3].startswith("as it acts: p = [0.1 0.  0.2] m; p' = [0. 0. 0.] m; k = 30 N/m")
    assert "c = 2 N s/m" in said[3]


REFERENCE = PD.split("[reference]")
MISTAKES = [  # those of keys and types are in test_scene_mistakes.py
    (SCENE.replace("0.1", "-1.0"), "duration_s: must be greater than 0, got -1.0"),
    (SCENE.replace("0.1", "nan"), "duration_s: .*nan"),
    (SCENE.replace("planar_2r", "planar_3r"), "planar_3r.*nearest: planar_2r"),
    ('method = "rk5"' + SCENE, "method: no method 'rk5'; nearest: rk4"),
    (SCENE + '[[effect]]\nkind = "external_wrench"\nframe = "tipp"\nforce_N = [1, 0, 0]', "tipp.*nearest: tip"),
    (f"{SCENE}[reference]{REFERENCE[1]}", r"reference: .*\[control\]"),
    (
        f'{SCENE}{REFERENCE[0]}[reference]\nkind = "via_points"\ntimes_s = [0.1, 0.2]\npoints = [[1, 2]]',
        "2 times_s for 1 points",
    ),
    (
        SCENE + PD.replace('"pd"', '"operational_space"\nframe = "tip"'),
        "reference.kind: .* line or circle, got 'quintic'",
    ),
]


@pytest.mark.parametrize(("text", "message"), MISTAKES)
def test_a_mistake_is_told_by_file_key_and_value(write, text: str, message: str) -> None:
    with pytest.raises(SceneError, match=f"scene.toml: .*{message}"):
        rd.read_scene(write(text))


def test_a_missing_scene_is_told(tmp_path) -> None:
    with pytest.raises(SceneError, match="there is no such file; see robot-dyn scene"):
        rd.read_scene(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b'robot = "\xe9"')
    with pytest.raises(SceneError, match="is not UTF-8 text"):
        rd.read_scene(tmp_path / "latin.toml")


def test_a_scene_is_checked_before_its_robot_is_loaded() -> None:
    with pytest.raises(SceneError, match="line 3: x: is not a key here"):
        parse_scene('robot = "none"\nduration_s = 1.0\nx = 1', "here")


def test_an_explanation_holds_no_key_that_is_not_read(write) -> None:
    """A PD with kp and kd reads neither frame, integral rate, effort limit nor damping ratio; one joint is one."""
    gains = '[control]\nkind = "pd"\nkp = 3.0\nkd = 1.0\n'
    text = repr(of_scene(*read_both(write(f'robot = "pendulum"\nduration_s = 0.1\n{gains}'))))
    assert "None" not in text
    for key in ("frame =", "integral_rate", "effort_limit_N_m", "damping_ratio", "frequency"):
        assert key not in text
    assert "kp = 3.0  (scene)" in text and "pendulum: 1 joint, " in text
