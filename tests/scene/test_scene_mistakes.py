"""What is said of a mistake in a scene: its line, the key as people count, what it must be, and the keys there are.

Mistakes and messages are tests/snapshots/scene_mistakes.json, scenes after the two lines BASE unless they name a robot.
"""

from __future__ import annotations

import json
import os
import re
import sys
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.cli import terminal
from robot_dyn.foundations import SceneError, Table, escaped
from robot_dyn.foundations.answer import html_of
from tests.command import refusal, spawn
from tests.scene.test_scene_loading import MJCF, URDF
from tests.snapshots import FOLDER, assert_text

BASE = 'robot = "cart_pole"\nduration_s = 1.0\n'

OF_MANY_KEYS_OR_OF_TOMLLIB = {  # texts that grow with the library, or are of Python's version
    '[[effect]]\nkin = "gravity"\n': "line 3: effect 1.kind: is missing; give one of gravity, lock, .*viscous_friction",
    "color = 3\n": "line 3: color: unknown key; nearest: control",
    "x = \ny = 3": "line 3, column 5: is not valid TOML: .*",
    "x = [1, 2": "is not valid TOML: Unclosed array .*",
    "x = " + "9" * 5000: "is not valid TOML: .*",
    "x = " + "[" * 5000: ".*nested too deeply; correct the file",
    "x = " + "[" * 90 + "]" * 90: "line 3: x: unknown key; .*",
    "'\x1b[31m' = 3\n": "line 3, column 2: is not valid TOML: .*",
    '"\\u001b[31m\\u202e" = 3\n': r"\\+x1b\[31m\\+u202e: unknown key; .*",
}


UNUSED = 'noise_seed = 1\nframe = "tool0"\ndamping_ratio = 0.7\neffort_limit_N_m = 3.0\nintegral_rate_per_s = 2.0\n'
HEAD, ROWS = "t [s],q hinge [rad],q slide [m]\n", "0.5,0.4,0.1\n0.9,-0.2,0.3\n1.6,0.7,0.2\n"
FILES = {
    "rig.urdf": URDF, "rig.xml": MJCF, "way.csv": HEAD + ROWS, "text.csv": f"{HEAD}0.5,0.4,x\n",
    "short.csv": f"{HEAD}\n0.5,0.4\n", "nan.csv": f"{HEAD}0.5,0.4,nan\n", "back.csv": f"{HEAD}{ROWS}0.2,1,1\n",
    "early.csv": f"{HEAD}-1,0.4,1\n", "empty.csv": HEAD, "lacking.csv": "t,q hinge\n0.5,1\n0.6,1\n",
    "speeds.csv": "t,q hinge,q slide,v hinge,v slide\n1,1,1,1,1\n2,2,2,1,1\n",
    "long.csv": HEAD + "".join(f"{k},0,0\n" for k in range(1, 3001)),
}  # fmt: skip
MISTAKES = json.loads((FOLDER / "scene_mistakes.json").read_text(encoding="utf-8"))


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("mistake", [*MISTAKES, *OF_MANY_KEYS_OR_OF_TOMLLIB])
def test_a_mistake_is_told_as_people_count(tmp_path: Path, mistake: str) -> None:
    """By the file, the line of the key or table at the top if it is there, key, value and remedy."""
    for name, text in FILES.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    scene = mistake if "robot" in mistake else BASE + mistake
    (tmp_path / "scene.toml").write_text(scene, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        rd.read_scene(tmp_path / "scene.toml")
    told = str(caught.value)
    assert told.isprintable() and len(told) < 500
    if message := OF_MANY_KEYS_OR_OF_TOMLLIB.get(mistake):
        assert re.fullmatch(f".*/scene.toml: (?:{message})", told), told
    else:
        assert_text("scene_mistakes", mistake, told)
    for voice in ("input", "extra", "pydantic", "none is not", "should"):
        assert voice not in told.lower(), told


def test_a_scene_is_read_within_bounds(tmp_path: Path) -> None:
    (tmp_path / "long.toml").write_text("#" * 2**20 + "\n")
    with pytest.raises(SceneError, match="is larger than 1 MiB"):
        rd.read_scene(tmp_path / "long.toml")
    os.mkfifo(tmp_path / "pipe.toml")
    for path in (tmp_path / "pipe.toml", "/dev/zero", tmp_path):
        assert "is a folder" in refusal(["simulate", path]) or "is not a regular file" in refusal(["simulate", path])


def test_a_long_name_of_a_robot_is_cut(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(BASE.replace("cart_pole", "a" * 20_000))
    assert len(refusal(["simulate", tmp_path / "scene.toml"])) < 400
    assert len(refusal(["info", "b" * 20_000])) < 400
    assert len(refusal(["info", "b/" * 20_000])) < 400


def test_of_several_keys_without_effect_the_first_in_the_schema_is_told(tmp_path: Path) -> None:
    """Not one that changes with the hashes of a process."""
    (tmp_path / "scene.toml").write_text(f'{BASE}[control]\nkind = "pd"\nperiod_s = 0.01\nkp = 1\nkd = 1\n{UNUSED}')
    read = f"import robot_dyn as rd; rd.read_scene({str(tmp_path / 'scene.toml')!r})"
    for seed in ("1", "6"):  # their orders differ
        assert b"control.integral_rate_per_s: " in spawn(code=read, PYTHONHASHSEED=seed).stderr


# --- control characters


def test_messages_hold_no_control_characters() -> None:
    """One line, whatever a file put into it; what people write stays as it is."""
    text = "line\nnext\x1b[31m\x9b\x7f\u202e\u2028\ud800\t end"
    assert str(RobotDynError(text)) == escaped(text) == r"line\nnext\x1b[31m\x9b\x7f\u202e\u2028\ud800\t end"
    fine = "Ṁ − 2C, τ ≤ 3 N m, 名前, é\u00a0!"
    assert str(RobotDynError(fine)) == fine


@pytest.mark.parametrize("on_terminal", [False, True])
def test_tables_and_documents_hold_no_control_characters(on_terminal: bool, capsys, monkeypatch) -> None:
    """What a terminal would execute is shown instead, headings too; a document is the same to a program."""
    evil = "x\x1b[31m\x9b\x07\x7f\u202e\U000e0001"
    shown = r"x\x1b[31m\x9b\x07\x7f\u202e\U000e0001"
    table = Table((evil,), ((evil,),))
    monkeypatch.setattr(sys.stdout, "isatty", lambda: on_terminal)
    monkeypatch.setenv("TERM", "dumb")  # no bold headings
    terminal.say(table, evil, "τ", table)
    terminal.say_json({evil: [evil, "τ"]})
    terminal.to_stderr(evil + "\n")
    out, err = capsys.readouterr()
    assert all(letter.isprintable() or letter == "\n" for letter in out + err)
    assert out.count(shown) == out.count(r"x\x1b") == 5 and err == shown + r"\n" + "\n" and out.count("τ") == 2
    assert json.loads(out[out.index("{") :]) == {evil: [evil, "τ"]}
    assert "".join(html_of([table])).count(shown) == 2


def test_a_name_of_a_file_is_told_escaped(tmp_path: Path) -> None:
    """XML cannot hold ESC, but C1 controls, which are CSI in one character, and marks that turn the text around."""
    text = (Path(__file__).parents[2] / "urdf" / "pendulum.urdf").read_text(encoding="utf-8")
    (tmp_path / "arm.urdf").write_text(text.replace('name="pivot"', 'name="x\x9b\u202e"'), encoding="utf-8")
    assert refusal(["info", tmp_path / "arm.urdf"]).isprintable()


CONTROLLED = '[control]\nkind = "{}"\nbandwidth_rad_s = 5.0\n'
OF_EFFECTS = {  # an effect with a wrong value, and the keys at fault
    'kind = "viscous_friction"': ("viscous_N_m_s_per_rad",),
    'kind = "viscous_friction"\nviscous_N_m_s_per_rad = -1.0': ("viscous_N_m_s_per_rad",),
    'kind = "viscous_friction"\nviscous_N_m_s_per_rad = {elbow = 1.0}': ("viscous_N_m_s_per_rad",),
    'kind = "viscous_friction"\nviscous_N_m_s_per_rad = [1.0, 2.0, 3.0]': ("viscous_N_m_s_per_rad",),
    'kind = "regularised_coulomb_friction"\ncoulomb_N_m = 1.0\nvelocity_scale_rad_s = 0.0': ("velocity_scale_rad_s",),
    'kind = "dry_friction"\ncoulomb_N_m = 2.0\nstatic_N_m = 1.0': ("coulomb_N_m", "static_N_m"),
    'kind = "dry_friction"\ncoulomb_N_m = 2.0\nstribeck_velocity_rad_s = 0.1': (
        "stribeck_velocity_rad_s",
        "static_N_m",
    ),
    'kind = "rigid_backlash"\nhalf_gap_rad = 0.0\ninertia_kg_m2 = 0.1': ("half_gap_rad",),
    'kind = "rigid_stops"\nlower_rad = 1.0\nupper_rad = -1.0': ("lower_rad", "upper_rad"),
    'kind = "joint_stops"\nlower_rad = 1.0\nupper_rad = -1.0': ("lower_rad", "upper_rad"),
    'kind = "effort_limit"\nlimit_N_m = -1.0': ("limit_N_m",),
    'kind = "armature"\ninertia_kg_m2 = -1.0': ("inertia_kg_m2",),
    'kind = "payload"\nframe = "tip"\nmass_kg = 1.0\ninertia_kg_m2 = [[1, 2, 0], [0, 1, 0], [0, 0, 1]]': (
        "inertia_kg_m2",
    ),
}
OF_CONTROL = {
    CONTROLLED.format("pid") + "effort_limit_N_m = -1.0": ("effort_limit_N_m",),
    CONTROLLED.format("pd") + "damping_ratio = -1.0": ("damping_ratio",),
    CONTROLLED.format("pd").replace("5.0", "-5.0"): ("bandwidth_rad_s",),
    CONTROLLED.format("pd") + 'period_s = 0.01\n[[control.velocity]]\nkind = "noise"\ndeviation_rad_s = -1.0': (
        "deviation_rad_s",
    ),
    CONTROLLED.format("pd") + 'period_s = 0.01\n[[control.velocity]]\nkind = "low_pass"\ncutoff_rad_s = 400.0': (
        "cutoff_rad_s",
    ),
}


@pytest.mark.parametrize(
    ("table", "keys"),
    [("[[effect]]\n" + text, keys) for text, keys in OF_EFFECTS.items()] + list(OF_CONTROL.items()),
)
def test_errors_name_the_keys_of_the_file(table: str, keys: tuple[str, ...], tmp_path: Path) -> None:
    """Not the arguments of the Python class, whose names lack the unit."""
    scene = tmp_path / "scene.toml"
    scene.write_text('robot = "planar_2r"\nduration_s = 0.1\n' + table, encoding="utf-8")
    with pytest.raises(SceneError) as error:
        rd.read_scene(scene)
    for key in keys:
        assert re.search(rf"\b{key}\b", str(error.value)), str(error.value)
