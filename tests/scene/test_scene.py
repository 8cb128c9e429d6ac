"""Scenes: every starter runs, what a scene does not name does not act, and a mistake is told by file, key and value."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene_reference

import robot_dyn as rd
from robot_dyn.foundations import SceneError
from robot_dyn.scene import (
    BY_KIND,
    Part,
    control,
    effects,
    of_scene,
    parse_scene,
    read_both,
    references,
    scene,
    starter,
    starter_names,
)
from tests.command import run
from tests.effect_examples import arguments
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
bandwidth_rad_s = 10.0
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
    np.testing.assert_array_equal(setup.plant.N([0.3, 0.4], [1.0, 2.0], t=0.0), [0.0, 0.0])
    run = rd.simulate(setup)
    np.testing.assert_allclose(run.ledger.energy, run.ledger.energy[0], rtol=1e-9)


def test_start_is_by_joint_or_in_order(write) -> None:
    setup = rd.read_scene(write(SCENE))
    np.testing.assert_array_equal(setup.q0, [0.3, -0.4])
    np.testing.assert_array_equal(setup.v0, [0.0, 0.5])


ARM = rd.load("planar_2r").with_(gravity=(0, 0, 0))
WRITTEN = {  # kinds whose keys are not the coefficients of a class, and the plants that they are
    "gravity": ("", lambda: rd.Plant(rd.load("planar_2r"))),
    "lock": ("joints = {joint_1 = 0.2}", lambda: rd.Plant(ARM.with_(lock={"joint_1": 0.2}))),
    "payload": ('frame = "tip"\nmass_kg = 0.5', lambda: rd.Plant(ARM.with_(payload=rd.Payload("tip", 0.5)))),
    "mass_scales": ("factors = {bar_2 = 1.7}", lambda: rd.Plant(ARM.with_(mass_scales={"bar_2": 1.7}))),
    "armature": (
        "inertia_kg_m2 = {joint_1 = 0.002, joint_2 = 0.001}\ngear_ratio = {joint_1 = 9.0}",
        lambda: rd.Plant(ARM.with_(armature=[0.002 * 81.0, 0.001])),
    ),
    "carried_payload": (
        'frame = "tip"\nmass_kg = 0.5\nend_s = 0.07\nat_rest = false',
        lambda: rd.Plant(ARM, [rd.effects.CarriedPayload(rd.Payload("tip", 0.5), end_s=0.07, at_rest=False)]),
    ),
    "external_wrench": (
        'frame = "tip"\nforce_N = [1.0, 0.0, 0.0]',
        lambda: rd.Plant(ARM, [rd.effects.ExternalWrench("tip", [1, 0, 0, 0, 0, 0])]),
    ),
}
DECLARED: dict[str, Any] = {kind: part for kind, part in BY_KIND.items() if kind not in WRITTEN}


def stated(value: Any, known: Any, form: str) -> tuple[str, Any]:
    """A value of an example in TOML: as it is, or by joint, some joints left out; and the value that this means."""
    if form == "as it is" or not isinstance(value, list) or not known.is_per_joint:
        return json.dumps(value), value
    required = known.exclusive_minimum is not None and known.fill_value <= known.exclusive_minimum
    joints = [0, 1] if required or form == "by joint" else [int(np.argmax(np.abs(value)))]
    table = ", ".join(f"joint_{i + 1} = {value[i]}" for i in joints)
    return f"{{{table}}}", [value[i] if i in joints else known.fill_value for i in (0, 1)]


@pytest.mark.parametrize("form", ["as it is", "by joint", "joints left out"])
@pytest.mark.parametrize("kind", DECLARED)
def test_a_declared_effect_of_a_scene_is_that_of_python(write, kind: str, form: str) -> None:
    """The example in the docstring of its class, written as a table."""
    part = DECLARED[kind]
    given = arguments(part.factory)
    texts = {key: (name, *stated(given[name], known, form)) for key, (name, known) in part.keys.items()}
    made = part.factory(**{name: value for name, _, value in texts.values()})
    text = "\n".join(f"{key} = {written}" for key, (_, written, _) in texts.items())
    same_motion(write, kind, text, rd.Plant(ARM, made if isinstance(made, tuple) else [made]))


@pytest.mark.parametrize("kind", WRITTEN)
def test_effect_of_a_scene_is_that_of_python(write, kind: str) -> None:
    text, by_hand = WRITTEN[kind]
    same_motion(write, kind, text, by_hand())


def same_motion(write, kind: str, text: str, by_hand: rd.Plant) -> None:
    """The kind read from a file changes the motion as the object made by hand."""
    path = write(f'robot = "planar_2r"\nduration_s = 0.1\n[[effect]]\nkind = "{kind}"\n{text}\n')
    plant = rd.read_scene(path).plant
    assert [type(each) for each in plant.effects] == [type(each) for each in by_hand.effects]
    q, v, u = np.random.default_rng(3).uniform(1.0, 4.0, (3, plant.dynamics.n))
    expected = by_hand.forward_dynamics(q, v, u, t=0.05)
    np.testing.assert_array_equal(plant.forward_dynamics(q, v, u, t=0.05), expected)


@pytest.mark.parametrize("kind", ["pid", "computed_torque", *long(["pd", "pd_gravity", "feed_forward"])])
def test_every_joint_controller_follows_its_plan(write, kind: str) -> None:
    """In zero gravity all end within 5 % of the way; the gains are those of the frequency."""
    text = SCENE.replace("0.1", "1.0", 1) + PD.replace('"pd"', f'"{kind}"')
    run = rd.simulate(rd.read_scene(write(text)))
    np.testing.assert_allclose(run.q[-1], [1.0, 0.5], atol=0.05)
    assert run.rms_tracking_error is not None


def test_explanation_names_each_term_and_its_source(write) -> None:
    text = repr(of_scene(*read_both(write(starter("panda_payload")))))
    for said in ("N = ∂V/∂q", "mass_kg = 1.5  (scene)", "limit_N_m = urdf  (the robot's file)", "not simulated"):
        assert said in text
    assert "resolved: u_max = 87 N m, 87 N m, 87 N m, 87 N m, 12 N m, 12 N m, 12 N m" in text

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
viscous_N_m_s_per_rad = 0.3
[[effect]]
kind = "line_spring_damper"
frame = "pole"
point_m = [0.1, 0.0, 0.2]
stiffness_N_per_m = 30.0
damping_N_s_per_m = 2.0
length_m = 0.7
"""
    said = [line.strip() for line in repr(of_scene(*read_both(write(text)))).splitlines() if "resolved" in line]
    assert said[0] == "resolved: b = 0.8 N s/m, 0.02 N m s/rad"
    assert "Lower stop = -1 m, -1 rad; Upper stop = 1 m, none" in said[1] and "k = 10000 N/m, 10000 N m/rad" in said[1]
    assert said[2] == "resolved: b = 0.3 N s/m, 0.3 N m s/rad"
    assert said[3].startswith("resolved: p = [0.1 0.  0.2] m; p' = [0. 0. 0.] m; k = 30 N/m")
    assert "c = 2 N s/m" in said[3]


def test_a_missing_scene_is_told(tmp_path) -> None:
    with pytest.raises(SceneError, match="there is no such file; run robot-dyn scene"):
        rd.read_scene(tmp_path / "none.toml")
    (tmp_path / "latin.toml").write_bytes(b'robot = "\xe9"')
    with pytest.raises(SceneError, match="is not UTF-8 text"):
        rd.read_scene(tmp_path / "latin.toml")
    run = rd.simulate(rd.load("planar_2r"), [0.1, 0.2], duration_s=0.01).save(tmp_path / "run.npz")
    with pytest.raises(SceneError, match="is a run file"):
        rd.read_scene(run)


def test_a_scene_is_checked_before_its_robot_is_loaded() -> None:
    with pytest.raises(SceneError, match="line 3: x: unknown key"):
        parse_scene('robot = "none"\nduration_s = 1.0\nx = 1', "here")


def test_an_explanation_holds_no_key_that_is_not_read(write) -> None:
    """A PD with kp and kd reads neither frame, integral rate, effort limit nor damping ratio; one joint is one."""
    gains = '[control]\nkind = "pd"\nkp = 3.0\nkd = 1.0\n'
    text = repr(of_scene(*read_both(write(f'robot = "pendulum"\nduration_s = 0.1\n{gains}'))))
    assert "None" not in text
    for key in ("frame =", "integral_rate", "effort_limit_N_m", "damping_ratio", "frequency"):
        assert key not in text
    assert "kp = 3.0  (scene)" in text and "pendulum: 1 joint, " in text


PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenes.md"
PARTS = [
    each
    for module in (scene, control, effects, references)
    for each in vars(module).values()
    if isinstance(each, type) and issubclass(each, Part) and each is not Part
]


def test_the_page_is_that_of_the_schema() -> None:
    command = "python scripts/scene_reference.py > docs/reference/scenes.md"
    assert PAGE.read_text(encoding="utf-8") == scene_reference.page(), f"the page is out of date; write it by {command}"


@pytest.mark.parametrize("part", PARTS, ids=lambda each: each.__name__)
def test_every_key_is_explained(part: type[Part]) -> None:
    assert part.__doc__
    assert [key for key, field in part.model_fields.items() if not field.description and key != "kind"] == []


def test_every_kind_and_every_key_of_the_starters_is_on_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert all(f'### `kind = "{kind}"`' in page for kind in BY_KIND)
    text = "\n".join(starter(name) for name in starter_names())
    stated = {line.partition("=")[0].strip() for line in text.splitlines() if "=" in line and line[0] not in "#["}
    assert stated and all(f"`{key}`" in page or key == "kind" for key in stated)


GAINS = """
robot = "planar_2r"
duration_s = 0.1
[start]
q = [0.3, -0.4]
[[effect]]
kind = "gravity"
[control]
kind = "{kind}"
{gains}
"""
JOINT = ["pd", "pid", "pd_gravity", "feed_forward", "computed_torque"]


def built(write, kind: str, gains: str):
    return rd.read_scene(write(GAINS.format(kind=kind, gains=gains))).controller


@pytest.mark.parametrize("kind", JOINT)
def test_kp_and_kd_are_the_gains(write, kind: str) -> None:
    law = built(write, kind, "kp = [30.0, 20.0]\nkd = {joint_1 = 4.0}")
    np.testing.assert_array_equal(law.kp, [30.0, 20.0])
    np.testing.assert_array_equal(law.kd, [4.0, 0.0])
    if kind == "pid":
        np.testing.assert_array_equal(law.ki, [30.0, 20.0])


@pytest.mark.parametrize("kind", JOINT)
def test_frequency_and_damping_ratio_are_kp_and_kd(write, kind: str) -> None:
    """ω² and 2 ζ ω, times the diagonal of M without a model in the loop."""
    law = built(write, kind, "bandwidth_rad_s = 7.0\ndamping_ratio = 0.6")
    inertia = 1.0 if kind == "computed_torque" else np.diag(rd.load("planar_2r").M([0.3, -0.4]))
    np.testing.assert_allclose(law.kp, 49.0 * inertia * np.ones(2), rtol=1e-15)
    np.testing.assert_allclose(law.kd, 8.4 * inertia * np.ones(2), rtol=1e-15)


def test_operational_space_takes_gains_of_the_frame(write) -> None:
    circle = 'frame = "tip"\n[reference]\nkind = "circle"\nradius_m = 0.1\nperiod_s = 1.0\nnormal = [0.0, 1.0, 0.0]'
    circle += "\nto_centre = [1.0, 0.0, 0.0]"
    law = built(write, "operational_space", f"kp = 100.0\nkd = 20.0\n{circle}")
    assert (law.kp, law.kd, law.posture_kp) == (100.0, 20.0, 10.0)


HEAD = """robot = "planar_2r"
duration_s = 0.1
method = "RK4"
step_s = 1e-3
estimate_error = false
engine = "interpreted"
[start]
q = [0.3, -0.4]
[[effect]]
kind = "gravity"
"""
LOOP = """[control]
kind = "pd"
kp = 50.0
kd = [5.0, 4.0]
period_s = 0.004
measurement_delay_periods = 1.0
actuation_delay_periods = 0.4
noise_seed = 5
[[control.position]]
kind = "noise"
deviation_rad = 1e-3
[[control.position]]
kind = "quantisation"
resolution_rad = {joint_1 = 1e-4, joint_2 = 2e-4}
[[control.velocity]]
kind = "differences"
[[control.velocity]]
kind = "low_pass"
cutoff_rad_s = 300.0
order = 1
[[control.actuation]]
kind = "low_pass"
cutoff_rad_s = 400.0
[[control.actuation]]
kind = "quantisation"
resolution_N_m = 0.01
[[control.actuation]]
kind = "rate_limit"
rate_N_m_per_s = 2000.0
[reference]
kind = "hold"
q = [0.5, 0.1]
"""


def by_hand() -> rd.control.Loop:
    q = rd.control.hold([0.5, 0.1])
    return rd.control.Loop(
        rd.control.PD(q, kp=50.0, kd=[5.0, 4.0], period_s=0.004),
        [rd.control.Noise(1e-3), rd.control.Quantisation([1e-4, 2e-4])],
        [rd.control.Differences(), rd.control.LowPass(300.0, 1)],
        [rd.control.LowPass(400.0), rd.control.Quantisation(0.01), rd.control.RateLimit(2000.0)], 1.0, 0.4, 5,
    )  # fmt: skip


def test_a_loop_of_a_scene_is_that_of_python(write, tmp_path: Path) -> None:
    setup = rd.read_scene(write(HEAD + LOOP))
    one, two = rd.simulate(setup), rd.simulate(setup, controller=by_hand())
    np.testing.assert_array_equal(one.q, two.q)
    np.testing.assert_array_equal(one.controller_states, two.controller_states)
    saved = rd.read(one.save(tmp_path / "run"))
    np.testing.assert_array_equal(saved.controller_states, one.controller_states)


def test_explain_says_what_stands_in_the_loop_and_what_it_takes(write) -> None:
    said = run("explain", write(HEAD + LOOP)).stdout
    for line in (
        "u = kp (q_d − q) + kd (v_d − v)",
        "measurement_delay_periods = 1.0  (scene)",
        "position: quantisation, y = Δ ⌊x/Δ + ½⌋",
        "resolution_rad = {'joint_1': 0.0001, 'joint_2': 0.0002}  (scene)",
        "order = 2  (default)",
        "machine code of a tick of the control: ",
        "; pd alone takes 8",
    ):
        assert line in said, line
    assert "of the control" not in said.partition("\ncontrol: ")[0]  # nothing is left out
    said = run("explain", write(HEAD + LOOP.partition("measurement_delay_periods")[0])).stdout
    delays, blocks = "measurement_delay_periods, actuation_delay_periods", "noise, quantisation, low_pass, differences"
    assert f"of the control: {delays}, {blocks}, rate_limit" in said
    assert "machine code of a tick of the control: 8 instructions\n" in said
