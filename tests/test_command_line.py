"""The command line, run as a user runs it: in a process of its own, by what it prints and how it exits."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd

ROOT = Path(__file__).parents[1]
MAIN = "from robot_dyn.cli import main; main()"
COMMANDS = ("list", "info", "query", "compare", "demo")
Q, V, A = "-0.1,0.7,-0.4,0.3,0.9,-0.6", "0.2,-0.3,0.4,0.5,-0.6,0.7", "1.1,-1.2,1.3,0.4,0.5,-0.6"
PENDULUM = str(ROOT / "urdf" / "pendulum.urdf")


def run(*args: str | Path, code: str = MAIN, **environment: str) -> subprocess.CompletedProcess[str]:
    """The command with these arguments, its output in pipes."""
    return subprocess.run(
        [sys.executable, "-c", code, *map(str, args)],
        capture_output=True,
        encoding="utf-8",
        timeout=60,
        env=os.environ | environment,
    )


def said(*args: str | Path) -> str:
    """Standard output of a command that succeeds in silence."""
    done = run(*args)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def document(*args: str | Path) -> Any:
    return json.loads(said(*args, "--json"))


def refusal(*args: str | Path) -> str:
    """The one line of a command that is refused."""
    done = run(*args)
    assert (done.returncode, done.stdout) == (2, ""), done
    assert done.stderr.startswith("robot-dyn: error: ") and done.stderr.count("\n") == 1, done.stderr
    return done.stderr.removeprefix("robot-dyn: error: ").rstrip()


def numbers(text: str) -> list[float]:
    return [float(word) for word in text.split(",")]


# --- the keys that docs/json.md promises


def promised(command: str) -> dict[str, str]:
    """Meaning by key, of the table under a command's heading."""
    section = (ROOT / "docs" / "json.md").read_text().split(f"## `robot-dyn {command}")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ", 1) for line in section.splitlines() if line.startswith("| `")]
    return {key: meaning for keys, meaning in rows for key in names(keys)}


def names(text: str) -> set[str]:
    """Words in backticks, outside brackets."""
    return set(re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", text)))


def test_list_prints_every_name_and_its_document_has_the_promised_keys():
    assert said("list").split() == list(rd.list_robots())
    listed = document("list")
    assert listed.keys() == promised("list").keys()
    assert tuple(listed["robots"]) == rd.list_robots()


def test_info_has_exactly_the_promised_keys():
    keys = promised("info")
    panda = document("info", "panda", "--lock", "panda_joint2=0.25")
    assert panda.keys() == keys.keys()
    for joint in panda["joints"]:
        assert joint.keys() == names(keys["joints"])
        assert joint["kind"] in ("revolute", "continuous", "prismatic")
    assert [tie.keys() for tie in panda["ties"]] == [names(keys["ties"])]
    assert panda["locked"] == {"panda_joint2": 0.25}
    robot = rd.load("panda")
    assert (panda["n"], panda["links"]) == (7, list(robot.frame_names))
    assert panda["total_mass"] == pytest.approx(robot.total_mass, rel=1e-14)
    assert [joint["upper"] for joint in document("info", "ur5")["joints"]] == rd.load("ur5").upper.tolist()
    assert [document("info", "pendulum")["joints"][0][key] for key in ("lower", "upper", "effort_limit")] == [None] * 3


def test_query_has_exactly_the_promised_keys():
    keys = promised("query")
    ur5 = document("query", "ur5", "--q", Q)
    assert ur5.keys() == keys.keys() - {"why"}
    why = document("query", "ur5", "--q", Q, "--why", "elbow_joint")
    assert why.keys() == keys.keys()
    own, _, _ = keys["why"].partition(";")
    assert why["why"].keys() == names(own.partition(":")[2])
    (inside,) = re.findall(r"`shares` \(([^)]*)\)", own)
    assert {key for share in why["why"]["shares"] for key in share} == set(re.findall(r"`(\w+)`", inside))


def test_compare_has_exactly_the_promised_keys():
    keys = promised("compare")
    both = document("compare", "pendulum", "mimic_chain", "--samples", "2")
    assert both.keys() == keys.keys()
    assert both["ok"] is True and both["refused"] == {} and list(both["robots"]) == ["pendulum", "mimic_chain"]
    (paragraph,) = re.findall(r"Each of `quantities`, by name:(.*?)\n\n", (ROOT / "docs/json.md").read_text(), re.S)
    for robot in both["robots"].values():
        assert robot.keys() == names(keys["robots"]) and robot["samples"] == 2
        for quantity in robot["quantities"].values():
            assert quantity.keys() == names(paragraph)
            assert quantity["state"].keys() == {"q", "v", "a", "tau"}


# --- help


@pytest.mark.parametrize("command", ["", *COMMANDS])
def test_help(command: str):
    text = said(*command.split(), "--help")
    assert "Usage:" in text and said(*command.split(), "-h") == text
    if not command:
        assert all(each in text for each in COMMANDS)


def test_no_arguments_shows_the_help():
    done = run()
    assert done.returncode in (0, 2) and "Usage:" in done.stdout + done.stderr


# --- info


def test_info_shows_joints_ties_and_locks():
    text = said("info", "panda", "--lock", "panda_joint2=0.25")
    robot = rd.load("panda")
    for name in set(robot.joint_names) - {"panda_joint2"}:
        assert re.search(rf"^{name} +(revolute|prismatic) ", text, re.M)
    assert re.search(r"^tied: panda_finger_joint2 = 1 · panda_finger_joint1 \+ 0$", text, re.M)
    assert re.search(r"^locked: panda_joint2 = 0\.25$", text, re.M)
    assert robot.description.source in text.splitlines()


def test_tie_of_ratio_zero_names_the_joint_it_follows(tmp_path: Path):
    text = (ROOT / "urdf" / "mimic_chain.urdf").read_text()
    still = text.replace('<mimic joint="flex_1" multiplier="-0.75"', '<mimic joint="twist" multiplier="0"')
    (tmp_path / "still.urdf").write_text(still)
    ties = {tie["joint"]: tie["source"] for tie in document("info", tmp_path / "still.urdf")["ties"]}
    assert ties == {"flex_1": "spread", "flex_2": "twist"}


@pytest.mark.parametrize("name", ["[red]x[/red]", "[/]", ":smile:"])
def test_names_with_markup_are_shown_as_they_are(name: str, tmp_path: Path):
    (tmp_path / "odd.urdf").write_text(Path(PENDULUM).read_text().replace('"pivot"', f'"{name}"'))
    for command in (("info",), ("query", "--why", name), ("compare", "--samples", "2")):
        assert name in said(command[0], tmp_path / "odd.urdf", *command[1:])


def test_odd_bodies_are_a_warning_on_stderr():
    done = run("info", "massless_tip", "--json")
    assert done.returncode == 0 and json.loads(done.stdout)["findings"]
    assert re.fullmatch(r"robot-dyn: warning: massless_tip: link 'pointer' moves but has no mass; .*\n", done.stderr)


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


def test_numbers_may_be_named_or_separated_by_blanks():
    named = document("query", "ur5", "--q", "elbow_joint=-0.4,shoulder_pan_joint = -0.1".replace(" = ", "="))
    assert named["q"] == [-0.1, 0, -0.4, 0, 0, 0]
    assert document("query", "ur5", "--q", Q.replace(",", " "))["q"] == numbers(Q)
    assert document("query", "ur5", "--q", Q.replace(",", ", "))["q"] == numbers(Q)
    assert document("query", "ur5")["q"] == [0] * 6


def test_stated_friction_acts_with_effects_urdf():
    robot = rd.load("cart_pole")
    state = ("--q", "-0.2,0.7", "--v", "0.3,-0.4", "--a", "0.5,0.6")
    plain, rubbed = document("query", "cart_pole", *state), document("query", "cart_pole", *state, "--effects", "urdf")
    assert plain["effects"] == {} and set(rubbed["effects"]) == {"ViscousFriction", "RegularisedCoulombFriction"}
    torque = sum(np.array(each) for each in rubbed["effects"].values())
    v = np.array([0.3, -0.4])
    expected = -robot.damping * v - robot.friction * np.tanh(v / 0.01)
    np.testing.assert_allclose(torque, expected, rtol=1e-14)
    np.testing.assert_allclose(rubbed["tau"], plain["tau"] - expected, rtol=1e-14)
    np.testing.assert_allclose(rubbed["N"], plain["N"] - expected, rtol=1e-14)


@pytest.mark.parametrize("given", ["--a", "--tau"])
def test_why_adds_up(given: str):
    """Shares of the links and effects add up to τ, 1e-9 of a torque of about 10."""
    state = ("--q", "-0.2,0.7", "--v", "0.3,-0.4", given, "0.5,0.6", "--effects", "urdf")
    for joint in ("slide", "hinge"):
        answer = document("query", "cart_pole", *state, "--why", joint)
        why = answer["why"]
        shares = [share[cause] for share in why["shares"] for cause in ("inertia", "coriolis", "gravity")]
        assert sum(shares) + sum(why["effects"].values()) == pytest.approx(why["tau"], rel=0, abs=1e-9)
        assert why["tau"] == answer["tau"][answer["joints"].index(joint)]
        assert {share["source"] for share in why["shares"]} == {"cart", "pole"}


def test_query_and_why_as_text():
    text = said("query", "ur5", "--q", Q, "--why", "elbow_joint", "--effects", "urdf")
    for part in ("M, mass matrix:", "C, Coriolis matrix:", "N, gravity and effects:", "why elbow_joint needs"):
        assert part in text
    assert re.search(r"^sum ", text, re.M)


# --- what is refused


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["info", "ur6"], r"no robot 'ur6'; nearest: ur5.*"),
        (["query", "pandas"], r"no robot 'pandas'; nearest: panda.*"),
        (["info", "nowhere/arm.urdf"], r"no file nowhere/arm\.urdf; looked for /.*"),
        (["info", "package://legs/leg.urdf"], r"no file for package://legs/leg\.urdf; tried in .*"),
        (["info", "/"], r"/: is a folder; .*"),
        (["info", __file__], r".*test_command_line\.py: is not well-formed XML: .*"),
        (["info", "hector"], r".*: no joint moves.*"),
        (["info", "ur5", "--lock", "elbow=0"], r"lock: no joint 'elbow' .*nearest: elbow_joint"),
        (["info", "ur5", "--lock", "elbow_joint"], r"--lock must be JOINT=VALUE, got 'elbow_joint'"),
        (["info", "ur5", "--lock", "elbow_joint=bent"], r"--lock: 'bent' is not a number"),
        (["info", "ur5", "--lock", "elbow_joint=nan"], r"lock of 'elbow_joint' must be finite.*"),
        (["info", "ur5", "--lock", "elbow_joint=1", "--lock", "elbow_joint=2"], r".*lock.*elbow_joint.*"),
        (["info", "pendulum", "--lock", "pivot=0"], r"lock: no joint is left to move.*"),
        (["query", "ur5", "--a", A, "--tau", A], r"give --a or --tau, not both.*"),
        (["query", "ur5", "--q", "0.1,0.2"], r"--q needs 6 numbers, got 2: shoulder_pan_joint, .*wrist_3_joint"),
        (["query", "ur5", "--q", ""], r"--q needs 6 numbers, got 0: .*"),
        (["query", "ur5", "--v", V + ",1"], r"--v needs 6 numbers, got 7: .*"),
        (["query", "ur5", "--tau", "1,2,3,4,5,six"], r"--tau: 'six' is not a number"),
        (["query", "ur5", "--q", "elbow=1"], r"--q: no joint 'elbow'; nearest: elbow_joint"),
        (["query", "ur5", "--q", "elbow_joint=1,2"], r"--q must be JOINT=VALUE, got '2'"),
        (["query", "ur5", "--q", "elbow_joint=1,elbow_joint=2"], r"--q.*elbow_joint.*"),
        (
            ["query", "ur5", "--q", Q.replace("-0.1", "nan")],
            r"q must be finite, got nan for joint 'shoulder_pan_joint'",
        ),
        (["query", "ur5", "--v", V.replace("0.7", "-inf")], r"v must be finite, got -inf for joint 'wrist_3_joint'"),
        (["query", "ur5", "--a", "elbow_joint=1e999"], r"a must be finite, got inf for joint 'elbow_joint'"),
        (["query", "ur5", "--tau", "elbow_joint=nan"], r"tau must be finite, got nan for joint 'elbow_joint'"),
        (["query", "ur5", "--v", "elbow_joint=1e200"], r"q, v.* are so large that the result overflows"),
        (["query", "ur5", "--why", "elbow"], r"--why: no joint 'elbow'; nearest: elbow_joint"),
        (["query", "ur5", "--effects", "friction"], r"effects='friction'; give effects, or 'urdf'.*"),
        (["compare"], r"name the robots to compare, or give --all, not both"),
        (["compare", "ur5", "--all"], r"name the robots to compare, or give --all, not both"),
        (["compare", "ur5", "ur6"], r"no robot 'ur6'; nearest: ur5.*"),
    ],
)
def test_refused_in_one_line(args: list[str], message: str):
    assert re.fullmatch(message, refusal(*args))


@pytest.mark.parametrize(
    "args",
    [["lst"], ["--colour"], ["info"], ["info", "ur5", "--colour"], ["info", "ur5", "ur10"], ["query", "ur5", "--q"]]
    + [["compare", "ur5", "--samples", value] for value in ("0", "many")],
)
def test_usage_error(args: list[str]):
    done = run(*args)
    assert (done.returncode, done.stdout) == (2, "")
    assert re.search(r"Usage:|requires an argument", done.stderr) and "Traceback" not in done.stderr


def test_query_without_forward_dynamics_names_the_joint():
    done = run("query", "massless_tip", "--tau", "0.1,0.2")
    assert (done.returncode, done.stdout) == (2, "")
    warning, error = done.stderr.splitlines()
    assert warning.startswith("robot-dyn: warning: ")
    assert re.match(r"robot-dyn: error: no forward dynamics: joint 'pointer_joint' carries no inertia", error)


def test_message_in_a_folder_that_is_gone(tmp_path: Path):
    """A name of the catalog needs no working directory; a missing file is still told in one line."""
    gone = (
        f"import os; os.mkdir({str(tmp_path / 'x')!r}); os.chdir({str(tmp_path / 'x')!r}); os.rmdir('.' * 2 + '/x')\n"
    )
    done = run("info", "ur5", code=gone + MAIN)
    assert (done.returncode, done.stderr) == (0, "")


# --- compare and demo


def test_compare_agrees():
    text = said("compare", "ur5")
    assert "1 of 1 agree" in text and "DISAGREE" not in text
    assert "2 of 2 agree" in said("compare", "pendulum", PENDULUM, "--samples", "3", "--seed", "5")


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


DISAGREE = """
from robot_dyn.lagrange.manipulator import Lagrangian
exact = Lagrangian.N
Lagrangian.N = lambda self, q: exact(self, q) + {by}
"""


def test_compare_exits_with_1_when_the_roads_disagree():
    snippet = DISAGREE.format(by="1e-9") + MAIN
    done = run("compare", "ur5", "--samples", "2", code=snippet)
    assert (done.returncode, done.stderr) == (1, "")
    assert re.search(r"^N .*DISAGREE", done.stdout, re.M) and "0 of 1 agree" in done.stdout
    done = run("compare", "pendulum", "ur5", "--samples", "2", "--json", code=snippet)
    answer = json.loads(done.stdout)
    assert done.returncode == 1 and answer["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["N"]["ok"] is False
    assert answer["robots"]["ur5"]["quantities"]["M"]["ok"] is True


def test_a_road_that_says_nan_disagrees_in_valid_json():
    done = run("compare", "ur5", "--samples", "1", "--json", code=DISAGREE.format(by="float('nan')") + MAIN)
    assert done.returncode == 1
    assert json.loads(done.stdout, parse_constant=pytest.fail)["robots"]["ur5"]["quantities"]["N"]["error"] is None


def test_demo_ends_with_the_cross_check():
    text = said("demo")
    assert "M, mass matrix:" in text and "tied: " not in text
    assert text.splitlines()[-2] == "1 of 1 agree"


# --- the process


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_interrupted_exits_with_130():
    child = subprocess.Popen(
        [sys.executable, "-c", MAIN, "compare", "--all", "--samples", "500"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        encoding="utf-8",
        start_new_session=True,
    )
    time.sleep(2)  # imports take 0.5 s, the whole some minutes
    assert child.poll() is None
    os.killpg(child.pid, signal.SIGINT)
    out, err = child.communicate(timeout=20)
    assert child.returncode == 130, (child.returncode, err)
    assert out == "" and "Traceback" not in err


@pytest.mark.skipif(os.name != "posix", reason="pipes of POSIX")
@pytest.mark.parametrize("args", [["list"], ["info", "tiago_dual"], ["query", "tiago_dual", "--json"], ["--help"]])
def test_reader_that_leaves_is_no_error(args: list[str]):
    read, write = os.pipe()
    os.close(read)  # nobody will ever read
    with open(write, "wb") as stream:
        done = subprocess.run(
            [sys.executable, "-c", MAIN, *args], stdout=stream, stderr=subprocess.PIPE, encoding="utf-8", timeout=30
        )
    assert done.stderr == "" and done.returncode in (0, 1, 141)


@pytest.mark.skipif(os.name != "posix", reason="a shell of POSIX")
def test_head_takes_the_first_line():
    command = f'set -o pipefail; "{sys.executable}" -c "{MAIN}" query tiago_dual | head -1'
    done = subprocess.run(["bash", "-c", command], capture_output=True, encoding="utf-8", timeout=30)
    assert done.stdout.startswith("q ") and done.stderr == ""
    assert done.returncode in (0, 1, 141)


@pytest.mark.parametrize("encoding", ["ascii", "cp1252", "utf-16"])
def test_output_in_an_encoding_without_mathematical_signs(encoding: str):
    """Windows pipes in cp1252; Ṁ and · are not in it."""
    for args in (["info", "panda"], ["compare", "pendulum", "--samples", "1"], ["info", "ur6"]):
        done = subprocess.run(
            [sys.executable, "-c", MAIN, *args],
            capture_output=True,
            timeout=30,
            env=os.environ | {"PYTHONIOENCODING": encoding},
        )
        assert b"Traceback" not in done.stderr and b"T\0r\0a\0c\0e" not in done.stderr
        assert done.returncode == (2 if "ur6" in args else 0)


LOADED = "import sys; print(*sorted({name.partition('.')[0] for name in sys.modules}))"
HEAVY = {"pinocchio", "yourdfpy", "trimesh", "scipy", "flint", "lxml", "numpy"}


def test_import_is_light():
    loaded = set(run(code=f"import robot_dyn\n{LOADED}").stdout.split())
    assert "robot_dyn" in loaded and not loaded & (HEAVY | {"rich", "typer"})


@pytest.mark.parametrize("args", [["--help"], ["query", "--help"], ["list"]])
def test_help_and_list_are_light(args: list[str]):
    code = f"import sys\ntry:\n    from robot_dyn.cli import main; main()\nexcept SystemExit:\n    pass\n{LOADED}"
    loaded = set(run(*args, code=code).stdout.splitlines()[-1].split())
    assert "robot_dyn" in loaded and not loaded & HEAVY
