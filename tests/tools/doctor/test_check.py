"""The doctor of URDF files: each way to break one is named; what the file still says is restored, to M itself."""

from __future__ import annotations

import json
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.shapes import Masses
from robot_dyn.tools.doctor import Severity, check_urdf, checked
from tests.broken_files import BROKEN, LINKS, SOUND
from tests.command import run
from tests.drawings import stl
from tests.long import long, stress
from tests.promised import check_document

Q = np.array([0.3, -0.7, 1.1])


def test_nothing_is_found_in_a_sound_file() -> None:
    made = checked(SOUND.encode(), "rig.urdf")
    assert made.loads
    assert made.ok
    assert made.findings == ()
    assert made.repaired is None


@pytest.mark.parametrize("name", BROKEN)
def test_each_fault_is_named(name: str) -> None:
    """By its kind, and where it is; no other link or joint is blamed."""
    broken = BROKEN[name]
    made = checked(broken.change(SOUND).encode(), "rig.urdf")
    assert (broken.kind, broken.where) in {(each.kind, each.where) for each in made.findings}
    blamed = {each.where for each in made.findings if each.severity is not Severity.NOTE}
    assert blamed <= {broken.where, "file"}
    assert all(each.message and each.remedy for each in made.findings)


@pytest.mark.parametrize("name", [name for name, each in BROKEN.items() if each.restored])
def test_what_the_file_still_says_is_restored(name: str) -> None:
    """M and N are those of the sound file to 1e-12 of their largest entries."""
    repaired = checked(BROKEN[name].change(SOUND).encode(), "rig.urdf", units=True).repaired
    assert repaired is not None
    sound, mended = rd.Robot.from_text(SOUND), rd.Robot.from_text(repaired)
    for quantity in ("M", "N"):
        x, y = getattr(sound, quantity)(Q), getattr(mended, quantity)(Q)
        assert np.abs(x - y).max() <= 1e-12 * np.abs(x).max()
    again = checked(repaired, "rig.urdf")
    assert again.findings == ()


@pytest.mark.parametrize("name", ["kg mm²", "g m²", "mass in grams"])
def test_a_unit_that_is_only_suspected_is_converted_on_request_alone(name: str) -> None:
    """Numbers that nobody measured, as of sensors in the files of the world, look like numbers of other units."""
    made = checked(BROKEN[name].change(SOUND).encode(), "rig.urdf")
    (finding,) = [each for each in made.findings if each.changes]
    assert finding.supposed
    assert made.repaired is None


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")  # that it is estimated
def test_an_inertial_is_estimated_at_a_density() -> None:
    """A box of the density that its stated mass is: the moments of the closed form, and M of the sound file."""
    mass, _, edges = LINKS["hand"]
    text = BROKEN["no inertial"].change(SOUND).encode()
    made = checked(text, "rig.urdf", estimates=Masses({}, density=float(mass / np.prod(edges))))
    assert made.repaired is not None
    x, y = rd.Robot.from_text(SOUND).M(Q), rd.Robot.from_text(made.repaired).M(Q)
    assert np.abs(x - y).max() <= 1e-12 * np.abs(x).max()
    assert checked(text, "rig.urdf").repaired is None
    with pytest.raises(QueryError, match="density"):
        Masses({}, density=-1.0)


@pytest.mark.parametrize("name", ["ns:ha;nd", "o'hand", "ha: nd; x"])
def test_names_may_hold_what_separates_the_parts_of_a_sentence(name: str) -> None:
    made = checked(BROKEN["no inertial"].change(SOUND).replace('"hand"', f'"{name}"').encode(), "rig.urdf")
    assert ("mass_missing", f"link {name!r}") in {(each.kind, each.where) for each in made.findings}


def test_several_faults_are_told_together() -> None:
    text = SOUND
    for name in ("decimal comma", "g mm²", "1.57", "crossed limits"):
        text = BROKEN[name].change(text)
    made = checked(text.encode(), "rig.urdf", units=True)
    kinds = {each.kind for each in made.findings}
    assert kinds == {"decimal_comma", "inertia_shape", "near_right_angle", "limits_crossed"}
    assert not made.loads
    assert made.repaired is not None
    assert np.allclose(rd.Robot.from_text(made.repaired).M(Q), rd.Robot.from_text(SOUND).M(Q), rtol=1e-12)


@pytest.mark.parametrize("word", ["a", "0x10", "", "nan"])
def test_a_refused_number_is_a_finding_at_its_line(word: str) -> None:
    """Also beside a right angle, of which the rest is judged; a finding for the other numbers is one on its own."""
    text = SOUND.replace('xyz="0.3 0 0" rpy="0 0 0.3"', f'xyz="0.3 0 0" rpy="{word} 1.5708 0"')
    line = 1 + text[: text.index("1.5708")].count("\n")
    made = checked(text.encode(), "rig.urdf")
    assert not made.loads
    assert [(each.kind, each.where, each.line) for each in made.findings] == [
        ("refused", "joint 'elbow'", line),
        ("near_right_angle", "joint 'elbow'", line),
    ]


def test_the_line_of_a_refusal_is_that_of_the_inertial_not_of_a_visual() -> None:
    text = SOUND.replace('<link name="hand">', '<link name="hand"><visual><origin xyz="0 0 1"/></visual>')
    text = text.replace('<origin xyz="0.0 0.0 0.06" rpy', '<origin xyz="0.0 0.0 a" rpy')
    (finding,) = checked(text.encode(), "rig.urdf").findings
    assert finding.line == 1 + text[: text.index("0.0 a")].count("\n")


def test_a_closed_surface_without_volume_has_no_density(tmp_path: Path) -> None:
    """A triangle from both sides: nothing is said of the mass of its link, and no warning comes of 0 / 0."""
    corners = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0.1]], dtype="f4")
    data = b"".join(struct.pack("<12fH", 0, 0, 0, *side.ravel(), 0) for side in (corners, corners[::-1]))
    (tmp_path / "flat.stl").write_bytes(b" " * 80 + struct.pack("<I", 2) + data)
    file = tmp_path / "rig.urdf"
    file.write_text(SOUND.replace('<box size="0.05 0.07 0.12"/>', '<mesh filename="flat.stl"/>'))
    with warnings.catch_warnings(record=True) as seen:  # as an error it would be caught with those of the hull
        warnings.simplefilter("always")
        assert {each.kind for each in check_urdf(file).findings} <= {"com_outside"}
    assert [str(each.message) for each in seen] == []


@pytest.mark.parametrize("text", [b"", b"<robot", b"\xff\xfe", b"<html></html>", b"<robot name='x'></robot>"])
def test_what_is_no_urdf_is_a_finding(text: bytes) -> None:
    made = checked(text, "x.urdf")
    assert not made.loads
    assert [(each.kind, each.where) for each in made.findings] == [("refused", "file")]


def test_known_files_of_the_catalog() -> None:
    """UR5's wrists have inertias that their shapes have at no density; kinova's and planar_2r's numbers are sound."""
    found = {(each.kind, each.where) for each in check_urdf("ur5").findings if each.severity is Severity.ERROR}
    assert found == {("inertia_shape", f"link 'wrist_{k}_link'") for k in (1, 2, 3)}
    assert check_urdf("kinova").ok
    assert check_urdf("planar_2r").ok


@pytest.mark.parametrize(
    ("ratio", "severity"), [(1.0, None), (1.5, Severity.WARNING), (2.9, Severity.WARNING), (3.1, Severity.ERROR)]
)
def test_an_inertia_is_an_error_from_three_times_what_its_shape_allows(ratio: float, severity: Severity | None) -> None:
    """½ tr I = ratio · m d², d from the centre of mass to the farthest corner of the box: (0.15, 0.04, 0.03)."""
    mass, _, edges = LINKS["upper"]
    moment = 2 / 3 * ratio * mass * sum((each / 2) ** 2 for each in edges)  # a third of tr I
    start = SOUND.index("<inertia ", SOUND.index('<link name="upper"'))
    stated = f'<inertia ixx="{moment}" ixy="0" ixz="0" iyy="{moment}" iyz="0" izz="{moment}"/>'
    made = checked((SOUND[:start] + stated + SOUND[SOUND.index("/>", start) + 2 :]).encode(), "rig.urdf")
    findings = {finding.kind: finding.severity for finding in made.findings}
    # at ratio 1 all mass lies at two corners, but isotropic moments need more than that along the short edges
    assert findings == ({"inertia_direction": Severity.WARNING} if severity is None else {"inertia_shape": severity})


SMALL, WHOLE = '<box size="0.02 0.02 0.02"/>', '<box size="0.05 0.07 0.12"/>'


@pytest.mark.parametrize(
    ("visual", "kinds"),
    [
        ("", {"com_outside", "mass_density"}),
        (f'<visual><origin xyz="0 0 0.06"/><geometry>{WHOLE}</geometry></visual>', set()),
        (f'<visual><origin xyz="0 0 0.3"/><geometry>{SMALL}</geometry></visual>', {"com_outside", "mass_density"}),
        ('<visual><geometry><box size="50 70 120"/></geometry></visual>', {"com_outside", "mass_density"}),
    ],
    ids=["none", "the whole link", "as far away", "in millimetres"],
)
def test_a_collision_shape_that_is_a_part_of_the_link_is_judged_with_the_visual(visual: str, kinds: set[str]) -> None:
    """The collision box is one of 2 cm beside the centre of mass: by it alone the mass is too dense."""
    start = SOUND.index("<collision>", SOUND.index('<link name="hand"'))
    part = f'<collision><origin xyz="0 0 0.12"/><geometry>{SMALL}</geometry></collision>{visual}'
    made = checked((SOUND[:start] + part + SOUND[SOUND.index("</link>", start) :]).encode(), "rig.urdf")
    assert {each.kind for each in made.findings} == kinds


@pytest.mark.parametrize(("z", "severity"), [(0.59, None), (0.61, Severity.ERROR)])
def test_a_centre_of_mass_farther_than_twice_the_longest_link_is_an_error(z: float, severity: Severity | None) -> None:
    """The longest distance between joints is 0.3 m, of the elbow; that of the base is of no equation: a warning."""
    old = '<origin xyz="0.0 0.0 0.06" rpy="0 0 0"/>'
    text = SOUND.replace(old, old.replace("0.06", str(z)), 1)
    found = [each for each in checked(text.encode(), "rig.urdf").findings if each.kind == "origin_far"]
    assert [(each.where, each.severity) for each in found] == ([("link 'hand'", severity)] if severity else [])
    old = '<origin xyz="0.0 0.0 0.05" rpy="0 0 0"/>'
    text = SOUND.replace(old, old.replace("0.05", str(z)), 1)
    found = [each.severity for each in checked(text.encode(), "rig.urdf").findings if each.kind == "origin_far"]
    assert found == ([Severity.WARNING] if severity else [])


def test_numbers_on_which_no_equation_depends_are_no_errors() -> None:
    """A frame of 1e-8 kg with moments of no body, and the mass of the base, which is fixed to the world."""
    moments = " ".join(f'{key}="1e-8"' for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    frame = f'<link name="frame"><inertial><mass value="1e-8"/><inertia {moments}/></inertial></link>'
    frame += '<joint name="f" type="fixed"><parent link="hand"/><child link="frame"/></joint></robot>'
    made = checked(SOUND.replace("</robot>", frame).encode(), "rig.urdf")
    assert {each.severity for each in made.findings if each.kind == "inertia_impossible"} == {Severity.WARNING}
    assert made.ok
    heavy = frame.replace('"1e-8"', '"0.01"')
    assert not checked(SOUND.replace("</robot>", heavy).encode(), "rig.urdf").ok
    (found,) = checked(SOUND.replace('<mass value="4.0"/>', '<mass value="4e5"/>').encode(), "rig.urdf").findings
    assert (found.kind, found.severity) == ("mass_density", Severity.NOTE)


def test_a_joint_that_cannot_hold_the_arm_is_an_error_of_the_limit_just_below_the_torque_of_gravity() -> None:
    """The elbow carries 1.2 kg at 0.12 m and 0.4 kg at 0.24 + 0.06 m, turned by 0.3 rad: m g r cos 0.3."""
    load = 9.80665 * (1.2 * 0.12 + 0.4 * (0.24 + 0.06)) * np.cos(0.3)
    for factor, kinds in ((0.999, ["effort_gravity"]), (1.001, [])):
        start = SOUND.index("effort=", SOUND.index('<joint name="elbow"'))
        text = SOUND[:start] + SOUND[start:].replace('effort="40"', f'effort="{factor * load}"', 1)
        assert [each.kind for each in checked(text.encode(), "rig.urdf").findings] == kinds


def test_a_misspelt_limit_is_a_warning_since_it_is_not_in_M() -> None:
    (found,) = checked(SOUND.replace("upper=", "uper=", 1).encode(), "rig.urdf").findings
    assert (found.severity, found.kind) == (Severity.WARNING, "unknown_attribute")


def test_findings_of_one_kind_are_one_line_with_their_number_and_the_first_three_places() -> None:
    text = SOUND.replace("1.5707963267948966", "1.5708").replace('rpy="0 0 0.3"', 'rpy="1.5708 0 0.3"')
    text = text.replace(
        "</robot>", text[text.index('<joint name="wrist"') :].replace("wrist", "w2").replace("hand", "h2")
    )
    text = text.replace("</robot>", '<link name="h2"/></robot>').replace('type="revolute"', 'type="fixed"')
    made = checked(text.replace('type="fixed"', 'type="revolute"', 2).encode(), "rig.urdf")
    lines = repr(made).splitlines()
    assert sum(each.kind == "near_right_angle" for each in made.findings) == 4
    (line,) = [line for line in lines if "near_right_angle" in line]
    assert line.startswith("  warning: near_right_angle, 4 times: joint 'shoulder' (line")
    assert line.count("(line ") == 3
    assert json.loads(made.to_json())["findings"][3]["kind"] == "near_right_angle"


def test_the_line_and_the_text_of_a_finding_are_those_of_the_file_though_another_one_is_repaired() -> None:
    text = BROKEN["kg mm²"].change(BROKEN["decimal comma"].change(BROKEN["crossed limits"].change(SOUND)))
    of_kind = {each.kind: each for each in checked(text.encode(), "rig.urdf").findings}
    assert of_kind["inertia_shape"].line == 1 + text[: text.index("<inertial", text.index('"upper"'))].count("\n")
    assert 'lower limit "2.5" is above its upper limit "-2.5"' in of_kind["limits_crossed"].message


def test_what_is_left_is_what_a_check_of_the_repaired_file_finds() -> None:
    text = BROKEN["weak joint"].change(BROKEN["1.57"].change(BROKEN["no axis"].change(SOUND)))
    made = checked(text.encode(), "rig.urdf")
    assert made.repaired is not None
    assert {each.kind for each in made.left} == {"effort_gravity", "axis_missing"}
    again = checked(made.repaired, "rig.urdf").findings
    assert [(each.kind, each.where) for each in again] == [(each.kind, each.where) for each in made.left]


def of_elbow(limit: str) -> bytes:
    start = SOUND.index("<limit", SOUND.index('<joint name="elbow"'))
    end = SOUND.index("/>", start)
    return f'{SOUND[:start]}<limit {limit} effort="40" velocity="3"{SOUND[end:]}'.encode()


@pytest.mark.parametrize(
    ("limit", "repaired"),
    [
        ('lower="135" upper="-95"', (np.deg2rad(-95), np.deg2rad(135))),
        ('lower="-95" upper="135"', (np.deg2rad(-95), np.deg2rad(135))),
        ('lower="135" upper="-5"', (np.deg2rad(-5), np.deg2rad(135))),  # -5 alone could be in radians
        ('lower="0" upper="180"', (0.0, np.pi)),
        ('lower="135.4" upper="-95"', None),  # not whole: neither converted nor exchanged
        ('lower="-1.57" upper="90"', None),  # one of each unit
        ('lower="2.5" upper="-2.5"', (-2.5, 2.5)),
    ],
)
def test_the_limits_of_a_joint_have_one_unit_and_are_repaired_together(
    limit: str, repaired: tuple[float, float] | None
) -> None:
    text = of_elbow(limit)
    made = checked(text, "rig.urdf")
    if repaired is None:
        assert made.repaired is None
        assert "degrees" in {each.kind for each in made.left}
        return
    assert made.repaired is not None
    assert made.left == ()
    assert {id(each) for each in made.gone} == {id(each) for each in made.findings}
    robot = rd.Robot.from_text(made.repaired)
    np.testing.assert_allclose([robot.lower[1], robot.upper[1]], repaired, rtol=1e-15)


@pytest.mark.parametrize(("units", "more"), [(True, 10), *long([(False, 10)]), *stress([(False, 40), (True, 40)])])
def test_a_repaired_file_is_repaired_for_good(units: bool, more: int) -> None:
    """Each way to break the file, and pairs of them: repaired again no byte changes, and left is what is found."""
    rng, names = np.random.default_rng(3), [*BROKEN]
    pairs = [("decimal comma", "misspelt attribute"), ("misspelt origin", "degrees"), ("g mm²", "mass in grams")]
    for chosen in ((name,) for name in names), pairs, (tuple(rng.choice(names, 2, replace=False)) for _ in range(more)):
        for faults in chosen:
            text = SOUND
            try:
                for name in faults:
                    text = BROKEN[name].change(text)
            except (AssertionError, ValueError):  # the first change took what the second one breaks
                continue
            once = checked(text.encode(), "rig.urdf", units=units)
            again = checked(text.encode() if once.repaired is None else once.repaired, "rig.urdf", units=units)
            assert again.repaired is None, faults
            assert [*map(str, once.left)] == [*map(str, again.findings)], faults


def test_the_exit_code_after_a_repair_is_that_of_what_is_left(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(BROKEN["misspelt origin"].change(BROKEN["no axis"].change(SOUND)), encoding="utf-8")
    mended = run("check-urdf", "arm.urdf", "--fix")
    assert mended.returncode == 0
    assert "written to arm.fixed.urdf: repaired 1 error; left 1 warning" in mended.stdout
    Path("weak.urdf").write_text(BROKEN["misspelt origin"].change(BROKEN["weak joint"].change(SOUND)), encoding="utf-8")
    assert run("check-urdf", "weak.urdf", "--fix").returncode == 1


def test_a_xacro_file_is_checked_as_what_it_expands_to(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    head = '<robot name="rig" xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arg name="m" default="2.0"/>'
    text = SOUND.replace('<robot name="rig">', head).replace('<mass value="2.0"/>', '<mass value="$(arg m)"/>')
    Path("rig.urdf.xacro").write_text(text, encoding="utf-8")
    assert not check_urdf("rig.urdf.xacro").loads
    assert check_urdf("rig.urdf.xacro", xacro={}).findings == ()
    told = run("check-urdf", "rig.urdf.xacro", "--xacro", "m=2000", "--fix", "--units")
    assert told.returncode == 0
    assert 'its mass of "2000" kg' in told.stdout
    x, y = (rd.Robot.from_text(each).M(Q) for each in (SOUND, Path("rig.fixed.urdf").read_text(encoding="utf-8")))
    assert np.abs(x - y).max() <= 1e-12 * np.abs(x).max()


def test_what_is_left_of_a_xacro_file_is_what_a_check_of_the_written_file_finds(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One right angle is repaired, a missing axis and a weak joint are left, each counted once."""
    monkeypatch.chdir(tmp_path)
    text = BROKEN["weak joint"].change(BROKEN["1.57"].change(BROKEN["no axis"].change(SOUND)))
    Path("rig.urdf.xacro").write_text(text, encoding="utf-8")
    made = rd.tools.doctor.check_urdf("rig.urdf.xacro", xacro={})
    assert made.repaired is not None
    assert {each.kind for each in made.gone} == {"near_right_angle"}
    Path("rig.fixed.urdf").write_bytes(made.repaired)
    assert [*map(str, rd.tools.doctor.check_urdf("rig.fixed.urdf").findings)] == [*map(str, made.left)]
    told = run("check-urdf", "rig.urdf.xacro", "--xacro", "", "--fix", "--force").stdout
    assert "repaired 1 warning; left 1 error, 1 warning" in told


def test_the_command_tells_fixes_and_exits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(BROKEN["misspelt origin"].change(SOUND), encoding="utf-8")
    told = run("check-urdf", "arm.urdf")
    assert told.returncode == 1
    assert "error: unknown_element: joint 'elbow' (line" in told.stdout
    assert "<orgin> is unknown in URDF and is ignored; <origin> is meant; correct it [--fix]" in told.stdout
    fixed = run("check-urdf", "arm.urdf", "--fix", "--json")
    whole = json.loads(fixed.stdout)
    check_document("check-urdf", whole)
    (document,) = whole["files"]
    assert document["written"] == "arm.fixed.urdf"
    (change,) = document["findings"][0]["changes"]
    assert change["text"] == "<orgin> is now <origin>"
    assert run("check-urdf", "arm.fixed.urdf").returncode == 0
    again = run("check-urdf", "arm.urdf", "--fix")
    assert again.returncode == 2
    assert "add --force" in again.stderr
    assert run("check-urdf", "arm.urdf", "--density", "1000").returncode == 2
    assert run("check-urdf", "arm.urdf", "--units").returncode == 2
    assert run("check-urdf", "no_such.urdf").returncode == 2
    (tmp_path / "other").mkdir()
    Path("other/arm.urdf").write_text(SOUND, encoding="utf-8")
    both = run("check-urdf", "arm.urdf", "other/arm.urdf", "--fix", "--force")
    assert both.returncode == 2
    assert "the same name" in both.stderr


@pytest.mark.parametrize(
    ("word", "named"),
    [("1.5708", "π/2"), ("-1.5708", "−π/2"), ("3.14159265359", "π"), ("-3.14159", "−π"), ("4.71239", "3π/2")],
)
def test_the_multiple_of_a_right_angle_that_is_meant_is_named(word: str, named: str) -> None:
    text = SOUND.replace('xyz="0.3 0 0" rpy="0 0 0.3"', f'xyz="0.3 0 0" rpy="0 {word} 0"')
    (finding,) = checked(text.encode(), "rig.urdf").findings
    assert f'rpy "0 {word} 0" differs from {named} by' in finding.message
    assert finding.remedy == f"write {named} to 16 digits"


def test_what_was_not_checked_is_said() -> None:
    """Of a file that is not read, and whose repairs do not make it so; a repaired one is checked."""
    unread = "masses, inertias and shapes were not checked"
    refused = SOUND.replace('xyz="0.3 0 0" rpy="0 0 0.3"', 'xyz="0.3 0 0" rpy="a 0 0"')
    assert checked(refused.encode(), "rig.urdf").sentence.endswith(f"it does not load; {unread}")
    assert unread not in checked(SOUND.encode(), "rig.urdf").sentence
    repaired = checked(BROKEN["decimal comma"].change(SOUND).encode(), "rig.urdf")
    assert not repaired.loads
    assert unread not in repaired.sentence


def inertial(mass: float, moment: float) -> str:
    moments = " ".join(f'{key}="{moment}"' for key in ("ixx", "iyy", "izz"))
    return f'<inertial><mass value="{mass}"/><inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'


def chain(masses: list[float], edges: list[float], moments: float = 1.0) -> str:
    """Cubes in a row, each turned by a joint against the one before."""
    cubes = "".join(
        f'<link name="l{k}">{inertial(m, moments * m * a * a / 6)}'
        f'<collision><geometry><box size="{a} {a} {a}"/></geometry></collision></link>'
        for k, (m, a) in enumerate(zip(masses, edges, strict=True))
    )
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><parent link="{"base" if not k else f"l{k - 1}"}"/><child link="l{k}"/>'
        '<origin xyz="0 0.2 0"/><axis xyz="0 0 1"/></joint>'
        for k in range(len(masses))
    )
    return f'<robot name="cubes"><link name="base"/>{cubes}{joints}</robot>'


@pytest.mark.parametrize(("scatter", "found"), [(0.004, True), (0.05, False)])
def test_masses_of_one_density_are_told(scatter: float, found: bool) -> None:
    """Cubes at 1000 kg/m³, each off by up to so much."""
    edges = [0.1, 0.12, 0.09, 0.11, 0.08]
    masses = [1000 * a**3 * (1 + scatter * (-1) ** k * (1 + k / 8)) for k, a in enumerate(edges)]
    kinds = {each.kind: each for each in checked(chain(masses, edges).encode(), "cubes.urdf").findings}
    assert ("density_uniform" in kinds) is found
    if found:
        assert "5 of 5 links have a density of" in kinds["density_uniform"].message


def test_masses_of_equal_links_are_no_sign_of_one_material() -> None:
    """Five equal cubes, as the links of a chain, tell nothing."""
    made = checked(chain([1.3] * 5, [0.1] * 5).encode(), "cubes.urdf")
    assert "density_uniform" not in {each.kind for each in made.findings}


def test_an_arm_of_points_with_shapes_is_a_warning_and_a_single_one_is_a_note() -> None:
    masses, edges = [1.0, 1.5, 0.9], [0.1, 0.12, 0.09]
    points = [x for x in checked(chain(masses, edges, 0.0).encode(), "cubes.urdf").findings if x.kind == "inertia_zero"]
    assert [x.severity for x in points] == [Severity.WARNING] * 3 and "all its moments are 0" in points[0].message
    (alone,) = [x for x in checked(chain([1.0], [0.1], 0.0).encode(), "cube.urdf").findings if x.kind == "inertia_zero"]
    assert alone.severity is Severity.NOTE


@pytest.mark.parametrize("address", ["C:\\arms\\meshes\\hand.stl", "file:///home/user/meshes/hand.stl"])
def test_meshes_of_another_computer_are_noted_with_the_path_or_the_folder_that_was_read(
    address: str, tmp_path: Path
) -> None:
    file = tmp_path / "arm.urdf"
    file.write_text(SOUND.replace('<box size="0.05 0.07 0.12"/>', f'<mesh filename="{address}"/>'))
    (absent,) = [x for x in check_urdf(file).findings if x.kind.startswith("shape")]
    assert (absent.kind, absent.where) == ("shape_missing", "link 'hand'") and address in absent.message
    (tmp_path / "meshes").mkdir()
    stl(tmp_path / "meshes" / "hand.stl", 0.3)
    (near,) = [x for x in check_urdf(file).findings if x.kind.startswith("shape")]
    assert (near.kind, near.severity.value, near.where) == ("shape_elsewhere", "note", "file")
    assert "'meshes'" in near.remedy
