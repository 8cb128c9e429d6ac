"""What `info`, `query`, `compare` and `cache` answer: the numbers of the library, as they are stated and kept."""

from __future__ import annotations

import json
import os
import re
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Lagrangian
from robot_dyn.queries import QUANTITIES, without_rounding
from tests.command import MAIN, ROOT, document, run, said, spawn

Q, V, A = "-0.1,0.7,-0.4,0.3,0.9,-0.6", "0.2,-0.3,0.4,0.5,-0.6,0.7", "1.1,-1.2,1.3,0.4,0.5,-0.6"


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split(",")]


# --- info


def test_info_shows_joints_couplings_and_locks():
    text = said("info", "panda", "--lock", "panda_joint2=0.25")
    robot = rd.load("panda")
    for name in set(robot.joint_names) - {"panda_joint2"}:
        assert re.search(rf"^{name} +(revolute|prismatic) ", text, re.M)
    assert re.search(r"^coupled: panda_finger_joint2 = 1 · panda_finger_joint1 \+ 0$", text, re.M)
    assert re.search(r"^locked: panda_joint2 = 0\.25$", text, re.M)
    (short,) = (line for line in text.splitlines() if line.endswith(".urdf"))
    assert short.startswith("example-robot-data/robots/") and robot.description.source.endswith(short)


def test_couplings_are_those_that_the_file_states(tmp_path: Path):
    """Each with the joint it names, not composed; a ratio of 0 and the defaults of URDF included."""
    keys = ("joint", "source", "multiplier", "offset")
    stated = [tuple(coupling[key] for key in keys) for coupling in document("info", "mimic_chain")["couplings"]]
    assert stated == [("flex_1", "spread", 0.5, 0.1), ("flex_2", "flex_1", -0.75, 0.2)]
    text = (ROOT / "urdf" / "mimic_chain.urdf").read_text()
    text = text.replace('<mimic joint="flex_1" multiplier="-0.75"', '<mimic joint="twist" multiplier="0"')
    text = text.replace('<mimic joint="spread" multiplier="0.5" offset="0.1"', '<mimic joint="spread"')
    (tmp_path / "other.urdf").write_text(text)
    couplings = [
        tuple(coupling[key] for key in keys) for coupling in document("info", tmp_path / "other.urdf")["couplings"]
    ]
    assert couplings == [("flex_1", "spread", 1, 0), ("flex_2", "twist", 0, 0.2)]
    assert document("info", "mimic_chain", "--lock", "spread=0.1")["couplings"] == []  # what follows it is held too


@pytest.mark.parametrize("name", ["[red]x[/red]", "[/]", ":smile:"])
def test_names_with_markup_are_shown_as_they_are(name: str, tmp_path: Path):
    text = (ROOT / "urdf" / "pendulum.urdf").read_text()
    (tmp_path / "odd.urdf").write_text(text.replace('"pivot"', f'"{name}"'))
    for command in (("info",), ("query", "--why", name), ("compare", "--samples", "2")):
        assert name in said(command[0], tmp_path / "odd.urdf", *command[1:])


def test_findings_are_listed_by_info_and_warned_of_in_one_line_by_other_commands():
    with pytest.warns(rd.ModelWarning):
        findings = rd.load("iris").findings
    assert len(findings) == 3
    assert document("info", "iris")["findings"] == list(findings)
    shown = said("info", "iris")
    assert [line for line in shown.splitlines() if line.startswith("finding: ")] == [f"finding: {x}" for x in findings]
    done = run("query", "iris", "--json")
    assert done.returncode == 0
    assert re.fullmatch(
        r"robot-dyn: warning: iris: link .* \(the first of 3 findings; .*robot-dyn info for all\)\n", done.stderr
    )


# --- query


def test_numbers_are_those_of_the_library():
    robot = rd.load("ur5")
    q, v, a = (np.array(numbers(text)) for text in (Q, V, A))
    answer = document("query", "ur5", "--q", Q, "--v", V, "--a", A)
    expected = {"M": robot.M(q), "C": robot.C(q, v), "N": robot.N(q), "tau": robot.inverse_dynamics(q, v, a)}
    expected |= {"q": q, "v": v, "a": a}
    for key, value in expected.items():
        assert answer[key] == value.tolist(), key
    back = document("query", "ur5", "--q", Q, "--v", V, f"--tau={','.join(map(repr, answer['tau']))}")
    assert back["a"] == robot.forward_dynamics(q, v, expected["tau"]).tolist()
    assert back["tau"] == answer["tau"]


def test_every_query_of_the_table_is_answered_at_the_state():
    robot = rd.load("ur5")
    state = {key: np.array(numbers(text)) for key, text in (("q", Q), ("v", V), ("a", A))}
    state["tau"] = robot.inverse_dynamics(*state.values())
    asked = [part for name in QUANTITIES for part in ("--quantity", name)]
    given = ("query", "ur5", "--q", Q, "--v", V, "--a", A, *asked, "--frame", "tool0")
    answers = document(*given)["quantities"]
    for name, quantity in QUANTITIES.items():
        expected = quantity.evaluate(robot, state, *["tool0"] * quantity.framed)
        assert answers[name] == np.asarray(expected).tolist()
    printed = said(*given)
    assert all(f"{name}, " in printed for name in QUANTITIES)


def test_numbers_may_be_named_or_separated_by_blanks():
    assert document("query", "ur5", "--q", "elbow_joint=-0.4,shoulder_pan_joint=-0.1")["q"] == [-0.1, 0, -0.4, 0, 0, 0]
    assert document("query", "ur5", "--q", Q.replace(",", " "))["q"] == numbers(Q)
    assert document("query", "ur5", "--q", Q.replace(",", ", "))["q"] == numbers(Q)
    assert document("query", "ur5")["q"] == [0] * 6


def test_stated_friction_acts_with_effects_urdf():
    robot = rd.load("cart_pole")
    state = ("--q", "-0.2,0.7", "--v", "0.3,-0.4", "--a", "0.5,0.6")
    plain, rubbed = document("query", "cart_pole", *state), document("query", "cart_pole", *state, "--effects", "urdf")
    assert plain["effects"] == {} and set(rubbed["effects"]) == {"viscous_friction", "regularised_coulomb_friction"}
    torque = sum(np.array(each) for each in rubbed["effects"].values())
    v = np.array([0.3, -0.4])
    expected = -robot.damping * v - robot.friction * np.tanh(v / 0.01)
    np.testing.assert_allclose(torque, expected, rtol=1e-14)
    np.testing.assert_allclose(rubbed["tau"], plain["tau"] - expected, rtol=1e-14)
    np.testing.assert_allclose(rubbed["N"], plain["N"] - expected, rtol=1e-14)


COEFFICIENTS = {
    "slide": ("b = 0.8 N s/m", "f = 1.5 N", "v_s = 0.01 m/s"),
    "hinge": ("b = 0.02 N m s/rad", "f = 0.01 N m", "v_s = 0.01 rad/s"),
}


@pytest.mark.parametrize("joint", COEFFICIENTS)
def test_why_has_the_torque_of_the_answer_its_links_and_coefficients(joint: str):
    for given in ("--a", "--tau"):
        state = ("--q", "-0.2,0.7", "--v", "0.3,-0.4", given, "0.5,0.6", "--effects", "urdf")
        answer = document("query", "cart_pole", *state, "--why", joint)
        why = answer["why"]
        assert why["tau"] == answer["tau"][answer["joints"].index(joint)]
        assert {share["source"] for share in why["shares"]} == {"cart", "pole"}
        viscous, *dry = COEFFICIENTS[joint]
        assert why["coefficients"] == {"viscous_friction": [viscous], "regularised_coulomb_friction": dry}


def test_a_payload_is_that_of_the_library():
    """With units or without; several of them; the centre of mass is the origin of the link unless given."""
    arm = rd.load("ur5").with_(payload=rd.Payload("tool0", 5.0, (0.1, 0.0, -0.2)))
    arm = arm.with_(payload=rd.Payload("forearm_link", 1.0))
    q = np.array(numbers(Q))
    for body in ("tool0=5kg@0.1,0,-0.2", "tool0=5@0.1,0,-0.2", "tool0 = 5 kg @ 0.1, 0, -0.2 m"):
        answer = document("query", "ur5", "--q", Q, "--payload", body, "--payload", "forearm_link=1")
        assert answer["M"] == arm.M(q).tolist() and answer["N"] == arm.N(q).tolist()


HELD = """robot = "planar_2r"
duration_s = 1.0
[start]
q = [0.3, 0.4]
[[effect]]
kind = "gravity"
[[effect]]
kind = "dry_friction"
coulomb_N_m = 3.0
static_N_m = {joint_1 = 4.0, joint_2 = 20.0}
[[effect]]
kind = "rigid_stops"
lower_rad = {joint_1 = 0.3, joint_2 = -1.0}
upper_rad = 1.0
[control]
kind = "pd"
kp = 10.0
kd = 1.0
[reference]
kind = "hold"
q = [0.3, 0.5]
"""


def test_a_scene_is_asked_at_its_start_for_what_is_held_and_how_firmly(tmp_path: Path):
    """Joint 1 lies on its stop and joint 2 sticks: λ = N − u, of which joint 2 could bear f_s either way."""
    scene = tmp_path / "held.toml"
    scene.write_text(HELD)
    setup, robot = rd.read_scene(scene), rd.load("planar_2r")
    u, N = np.array([0.0, 1.0]), robot.N([0.3, 0.4])
    answer = document("query", scene, "--why", "joint_2")
    assert answer["q"] == [0.3, 0.4]
    assert answer["tau"] == pytest.approx(u, rel=1e-14)
    assert answer["a"] == [0, 0]
    one, two = answer["held_joints"]
    assert (one["joint"], one["by"]) == ("joint_1", ["dry_friction", "rigid_stops"])
    assert (two["joint"], two["by"]) == ("joint_2", ["dry_friction"])
    assert (one["load"], two["load"]) == pytest.approx(u - N, rel=1e-13)
    assert (one["lower_breakaway"], one["upper_breakaway"]) == (None, 4.0)
    assert (two["lower_breakaway"], two["upper_breakaway"]) == (-20.0, 20.0)
    assert one["margin"] == pytest.approx(4.0 - one["load"])
    assert two["margin"] == pytest.approx(20.0 - abs(two["load"]))
    why = answer["why"]
    assert why["at_rest"] == pytest.approx(two["load"], rel=1e-13)
    shares = [share[cause] for share in why["shares"] for cause in ("inertia", "coriolis", "gravity")]
    assert sum(shares) + sum(why["effects"].values()) + why["at_rest"] == pytest.approx(1.0, abs=1e-12)
    text = said("query", scene, "--why", "joint_2")
    assert re.search(r"^joint_2 +dry_friction +-\d\S+ +-20 +20 ", text, re.M)
    assert re.search(r"^dry friction and stops, at rest ", text, re.M)
    assert [(each.joint, each.load) for each in setup.plant.held_joints(setup.q0, setup.v0, u, t=0.0)] == [
        ("joint_1", one["load"]), ("joint_2", two["load"])
    ]  # fmt: skip


def test_of_a_joint_that_breaks_away_the_friction_of_sliding_is_a_share(tmp_path: Path):
    """Beside one that slides; their shares add up to u too."""
    scene = tmp_path / "held.toml"
    scene.write_text(HELD.replace("joint_2 = 20.0", "joint_2 = 3.0").replace("joint_1 = 0.3, joint_2", "joint_2"))
    for joint, v in (("joint_1", "joint_2=0.2"), ("joint_1", "joint_2=-0.1")):
        answer = document("query", scene, "--v", v, "--why", joint)
        why = answer["why"]
        shares = [share[cause] for share in why["shares"] for cause in ("inertia", "coriolis", "gravity")]
        assert sum(shares) + sum(why["effects"].values()) + why["at_rest"] == pytest.approx(why["tau"], abs=1e-10)
        assert abs(why["at_rest"]) == pytest.approx(3.0, rel=1e-10)


def test_query_and_why_as_text():
    text = said("query", "ur5", "--q", Q, "--why", "elbow_joint", "--effects", "urdf")
    for part in (
        "M, mass matrix [kg m²]:",
        "C, Coriolis matrix [N m s/rad]:",
        "N, gravity and effects [N m]:",
    ):
        assert part in text
    assert re.search(r"^sum ", text, re.M)
    assert re.search(r"^why elbow_joint needs \S+ N m:$", text, re.M)


def test_units_are_those_of_the_joints():
    """cart_pole slides and turns, ur5 only turns."""
    assert "[rad/s]" in said("query", "ur5") and "[m or rad]" in said("query", "cart_pole")
    why = said("query", "cart_pole", "--why", "slide", "--effects", "urdf")
    assert "why slide needs 0 N:" in why and "viscous_friction" in why


def test_query_without_forward_dynamics_names_the_joint():
    done = run("query", "massless_tip", "--tau", "0.1,0.2")
    assert (done.returncode, done.stdout) == (2, "")
    warning, error = done.stderr.splitlines()
    assert warning.startswith("robot-dyn: warning: ")
    assert re.match(r"robot-dyn: error: no forward dynamics: joint 'pointer_joint' carries no inertia", error)


def test_what_rounding_leaves_of_a_vector_is_shown_as_0_and_kept_in_json() -> None:
    """UR5 stretched out: 1e-16 N m beside 60; a rest of 2e-12 of the largest is shown."""
    args = ("query", "ur5", "--q", "shoulder_lift_joint=0.1")
    kept = np.abs(document(*args)["tau"])
    assert any(0 < x < 1e-12 * kept.max() for x in kept)
    text = said(*args)
    assert not re.search(r"e-1[3-9]|(?<![\d.])-0(?![\d.])", text)
    shown = without_rounding([-0.0, 1e-16, -2e-11, 10.0, np.inf, np.nan])
    assert [f"{x:g}" for x in shown] == ["0", "0", "-2e-11", "10", "inf", "nan"]
    assert without_rounding([]).tolist() == []


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROBOT_DYN_CACHE", str(tmp_path / "kernels"))
    return tmp_path / "kernels"


def test_info_names_the_formulation_of_the_fewest_instructions() -> None:
    answer = document("info", "planar_2r", "--compiled")["compiled"]
    assert set(answer) >= {"M", "C", "N", "inverse_dynamics", "forward_dynamics"}
    for row in answer.values():
        counts = row["instructions"]
        assert counts[row["served_by"]] == min(counts.values())
    assert min(answer["forward_dynamics"]["instructions"].values()) > 20  # M⁻¹ of two joints
    text = said("info", "planar_2r", "--compiled")
    assert f"{min(answer['M']['instructions'].values())}" in text and "forward_dynamics" in text
    assert "compiled" not in document("info", "planar_2r")


def test_the_cache_is_listed_and_cleared(folder: Path) -> None:
    assert "0 kernels" in said("cache")
    rd.compiled(rd.load("pendulum")).M(np.array([0.3]))
    listed = document("cache")
    assert (listed["folder"], len(listed["kernels"])) == (str(folder), 1)
    assert listed["bytes"] == listed["kernels"][0]["size"] > 1000
    assert listed["kernels"][0]["key"][:12] in said("cache")
    cleared = document("cache", "--clear")
    assert (cleared["removed"], cleared["kernels"], list(folder.iterdir())) == (1, [], [])


def test_a_cache_that_is_off_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    assert document("cache")["folder"] is None
    assert "no cache" in said("cache")


@pytest.mark.skipif(os.name != "posix", reason="modes are those of POSIX")
def test_a_folder_that_others_can_enter_is_told_and_not_used(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    done = run("cache")
    assert done.returncode == 0
    assert "no cache" in done.stdout and "is not yours alone" in done.stderr


def test_explain_counts_instructions_by_effect(tmp_path: Path) -> None:
    from robot_dyn.scene import starter

    scene = tmp_path / "scene.toml"
    scene.write_text(starter("cart_pole"), encoding="utf-8")
    line = next(line for line in said("explain", scene).splitlines() if line.startswith("machine code"))
    assert "instructions; of effects:" in line and "spring" in line


def test_compare_agrees():
    text = said("compare", "ur5", "--samples", "5")
    assert "1 of 1 agree" in text and "DISAGREE" not in text
    pendulum = ROOT / "urdf" / "pendulum.urdf"
    assert "2 of 2 agree" in said("compare", "pendulum", pendulum, "--samples", "3", "--seed", "5")


def test_compare_of_a_locked_robot():
    locked = document("compare", "panda", "--lock", "panda_finger_joint1=0.01", "--samples", "1")
    assert len(locked["robots"]["panda"]["quantities"]["N"]["state"]["q"]) == 7


def test_same_seed_same_states():
    first, again, other = (document("compare", "pendulum", "--samples", "2", "--seed", s) for s in ("3", "3", "4"))
    assert first == again != other


def test_piped_tables_are_whole():
    """A pipe has no width: no name is cut or wrapped."""
    text = said("compare", "panda", "--samples", "2")
    rows = [line for line in text.splitlines() if re.match(r"[MCN] +\d", line)]
    assert len(rows) == 3 and all(re.search(r"panda_(finger_)?joint\d", row) for row in rows)
    assert "…" not in text


def err_by(monkeypatch: pytest.MonkeyPatch, error: float) -> None:
    """Let the library's own implementation say a wrong N."""
    exact = Lagrangian.N
    monkeypatch.setattr(Lagrangian, "N", lambda self, q: exact(self, q) + error)


def test_compare_says_where_the_implementations_disagree(monkeypatch: pytest.MonkeyPatch):
    err_by(monkeypatch, 1e-9)
    done = run("compare", "ur5", "--samples", "2")
    assert (done.returncode, done.stderr) == (1, "")
    assert re.search(r"^N .*DISAGREE", done.stdout, re.M) and "0 of 1 agree" in done.stdout
    done = run("compare", "pendulum", "ur5", "--samples", "2", "--json")
    answer = json.loads(done.stdout)
    assert done.returncode == 1 and answer["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["N"]["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["M"]["ok"] is True


def test_a_process_of_compare_exits_with_1_when_the_implementations_disagree():
    wrong = "from robot_dyn.lagrange.lagrangian import Lagrangian as L; N = L.N; L.N = lambda self, q: N(self, q) + 1"
    done = spawn("compare", "pendulum", "--samples", "1", code=f"{wrong}\n{MAIN}")
    assert (done.returncode, done.stderr) == (1, b"") and b"DISAGREE" in done.stdout


def test_a_implementation_that_says_nan_disagrees_in_valid_json(monkeypatch: pytest.MonkeyPatch):
    err_by(monkeypatch, float("nan"))
    done = run("compare", "ur5", "--samples", "1", "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout, parse_constant=pytest.fail)["robots"]["ur5"]["quantities"]["N"]["error"] is None
