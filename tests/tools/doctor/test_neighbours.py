"""Masses and moments without shapes: compared with joint distances, with other links and with a data sheet."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.tools.doctor import Severity, check_urdf
from tests.command import run

LIMIT = '<limit lower="-2" upper="2" effort="900" velocity="2"/>'


def link(name: str, mass: float, com: str, ixx: float, iyy: float, izz: float, shape: str = "") -> str:
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/><inertia ixx="{ixx}" iyy="{iyy}"'
        f' izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>{shape}</link>'
    )


def arm(folder: Path, links: list[str], distances: list[float]) -> Path:
    """A file of links in a row, with the distance of each joint from the one before."""
    names = ["base", *(text.split('"')[1] for text in links)]
    joints = [
        f'<joint name="j{i}" type="revolute"><parent link="{names[i]}"/><child link="{names[i + 1]}"/>'
        f'<origin xyz="0 0 {x}"/><axis xyz="0 1 0"/>{LIMIT}</joint>'
        for i, x in enumerate(distances)
    ]
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm"><link name="base"/>{"".join(links)}{"".join(joints)}</robot>')
    return path


def kinds(path: Path, **options) -> set[tuple[str, str]]:
    return {(x.kind, x.where) for x in check_urdf(path, **options).findings if x.severity is not Severity.NOTE}


UPPER = link("upper", 7.293, "0.0215 0 -0.135", 0.014, 2.9544, 2.9595)
LOWER = link("lower", 3.0, "0 0 0.1", 0.03, 0.03, 0.004)
WRIST = link("wrist", 0.38, "0 0 0.02", 4e-4, 4e-4, 3e-4)


def test_moments_that_no_link_of_this_length_has_are_reported(tmp_path: Path) -> None:
    """7.293 kg with a radius of gyration of 0.64 m before a joint 0.36 m away; a tenth of the moments is possible."""
    wrong = arm(tmp_path, [UPPER, LOWER, WRIST], [0.2, 0.36, 0.3])
    assert kinds(wrong) == {("inertia_wide", "link 'upper'")}
    right = link("upper", 7.293, "0.0215 0 -0.135", 0.014, 0.29544, 0.29595)
    assert kinds(arm(tmp_path, [right, LOWER, WRIST], [0.2, 0.36, 0.3])) == set()


@pytest.mark.parametrize("radius", [0.2, 0.35, 0.37, 0.8, 2.0])
def test_a_radius_of_gyration_beyond_the_next_joint_is_reported(tmp_path: Path, radius: float) -> None:
    """½ tr I = m k² in a link whose next joint is 0.36 m away."""
    moment = 2 / 3 * 4.0 * radius**2
    path = arm(tmp_path, [link("upper", 4.0, "0 0 0.1", moment, moment, moment), LOWER, WRIST], [0.2, 0.36, 0.3])
    assert (("inertia_wide", "link 'upper'") in kinds(path)) is (radius > 0.36)


@pytest.mark.parametrize(("mass", "reported"), [(3.0, False), (3.14, False), (3.2, True), (0.3, True), (30.0, True)])
def test_a_mass_more_than_5_percent_from_the_data_sheet_is_reported(
    tmp_path: Path, mass: float, reported: bool
) -> None:
    path = arm(tmp_path, [LOWER, WRIST], [0.2, 0.36])
    for options in ({"mass": {"lower": mass}}, {"total_mass": mass + 0.38}):
        assert ("mass_sheet" in {kind for kind, _ in kinds(path, **options)}) is reported


@pytest.mark.parametrize("tool", [[], [link("tool", 0.5, "0 0 0.03", 4e-4, 4e-4, 3e-4)]])
def test_a_wrist_of_a_few_grams_is_reported(tmp_path: Path, tool: list[str]) -> None:
    """7 g after a link of 0.38 kg, at the end of the arm and before a tool; 0.07 kg is not."""
    for mass, expected in ((0.007, {("mass_neighbours", "link 'hand'")}), (0.07, set())):
        hand = link("hand", mass, "0 0 0.02", 4e-6, 4e-6, 3e-6)
        path = arm(tmp_path, [LOWER, WRIST, hand, *tool], [0.2, 0.36, 0.1, *([0.1] * len(tool))])
        assert kinds(path) == expected


def test_light_fingers_are_not_reported(tmp_path: Path) -> None:
    """Two fingers of 8 g on a wrist of 0.38 kg."""
    text = arm(tmp_path, [LOWER, WRIST], [0.2, 0.36]).read_text()
    for i in (1, 2):
        finger = link(f"finger{i}", 0.008, "0 0 0.02", 4e-6, 4e-6, 3e-6)
        joint = f'<joint name="f{i}" type="prismatic"><parent link="wrist"/><child link="finger{i}"/>'
        joint += f'<axis xyz="0 1 0"/>{LIMIT}</joint>'
        text = text.replace("</robot>", f"{finger}{joint}</robot>")
    (tmp_path / "hand.urdf").write_text(text)
    assert kinds(tmp_path / "hand.urdf") == set()


def test_a_link_denser_than_steel_and_heavier_than_its_neighbours_is_reported(tmp_path: Path) -> None:
    """42.872 kg in a cylinder of 0.06 m × 0.4 m, 9480 kg/m³, before a link of 7.2 kg."""
    shape = '<collision><geometry><cylinder radius="0.06" length="0.4"/></geometry></collision>'
    for mass, expected in ((42.872, {("mass_neighbours", "link 'upper'")}), (12.0, set())):
        upper = link("upper", mass, "0 0 0", mass * 0.0142, mass * 0.0142, mass * 0.0018, shape)
        path = arm(tmp_path, [upper, link("lower", 7.2, "0 0 0.1", 0.1, 0.1, 0.02), WRIST], [0.2, 0.4, 0.3])
        assert kinds(path) == expected


ROD = [
    link("one", 5, "0 0 0.1", 0.06, 0.06, 0.009),
    link("two", 3, "0.2 0 0", 0.004, 0.04, 0.04),
    link("three", 1, "0.1 0 0", 0.0009, 0.005, 0.005),
]
UNITS = {"g m2": 3, "kg·cm²": 4, "kg mm2": 6, "g mm2": 9}


def in_unit(folder: Path, power: int, distances: list[float] | None = None) -> Path:
    """An arm whose moments are written in a unit of 10 to minus a power."""
    path = arm(folder, ROD, distances or [0.1, 0.3, 0.4])
    text = path.read_text()
    for key in ("ixx", "iyy", "izz"):
        for number in {part.split('"')[0] for part in text.split(f'{key}="')[1:]}:
            text = text.replace(f'{key}="{number}"', f'{key}="{number}e{power}"')
    path.write_text(text)
    return path


@pytest.mark.parametrize("unit", UNITS)
def test_a_common_unit_of_all_moments_is_named_and_converted_on_request_alone(tmp_path: Path, unit: str) -> None:
    """With the unit the repaired file has M of the arm in kg m², and repairing it again changes nothing."""
    expected = rd.load(arm(tmp_path, ROD, [0.1, 0.3, 0.4]))
    path = in_unit(tmp_path, UNITS[unit])
    plain = check_urdf(path, units=True)
    assert "inertia_unit" in {x.kind for x in plain.findings} and plain.repaired is None
    named = check_urdf(path, inertia_unit=unit)
    assert named.repaired is not None
    assert {x.kind for x in named.left} == set()
    mended = tmp_path / "mended.urdf"
    mended.write_bytes(named.repaired)
    q = np.array([0.3, -0.7, 1.1])
    np.testing.assert_allclose(rd.load(mended).M(q), expected.M(q), rtol=1e-14)
    again = check_urdf(mended, inertia_unit=unit)
    assert again.repaired is None
    assert [x.severity for x in again.findings] == [Severity.NOTE]


def test_a_unit_that_does_not_fit_converts_nothing(tmp_path: Path) -> None:
    assert check_urdf(in_unit(tmp_path, 6), inertia_unit="g m2").repaired is None
    with pytest.raises(QueryError, match="kg inch"):
        check_urdf(in_unit(tmp_path, 6), inertia_unit="kg inch")


def test_the_command_converts_from_a_unit_and_compares_a_data_sheet(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    path = str(in_unit(tmp_path, 6))
    assert run("check-urdf", path, "--inertia-unit", "kg mm2").returncode != 0  # needs --fix
    assert run("check-urdf", path, "--fix", "--inertia-unit", "kg mm2").returncode == 0
    answer = run("check-urdf", "arm.fixed.urdf", "--mass", "two=6", "--total-mass", "12")
    assert answer.returncode == 0
    assert answer.stdout.count("mass_sheet") == 1


@pytest.mark.parametrize("joints", [1, 2])
def test_a_small_arm_of_impossible_size_is_reported(tmp_path: Path, joints: int) -> None:
    """5 kg with 5e4 kg m² on a joint 400 m away, in arms of one or two joints, which have no neighbours to compare."""
    links = [link("one", 5, "0 0 0.1", 5e4, 5e4, 5e4), link("two", 3, "0.2 0 0", 0.004, 0.04, 0.04)][:joints]
    assert kinds(arm(tmp_path, links, [400.0, 0.3][:joints])) >= {
        ("inertia_wide", "link 'one'"),
        ("origin_far", "joint 'j0'"),
    }
    usual = [link("one", 5, "0 0 0.1", 0.06, 0.06, 0.009), links[-1]][:joints]
    assert kinds(arm(tmp_path, usual, [1.0, 0.3][:joints])) == set()


def test_masses_of_a_data_sheet_are_compared_with_the_file(tmp_path: Path) -> None:
    path = arm(tmp_path, ROD, [0.1, 0.3, 0.4])
    assert check_urdf(path, mass={"one": 5.1, "two": 3.0}, total_mass=9.2).findings == ()
    wrong = check_urdf(path, mass={"one": 50.0, "two": 3.0}, total_mass=54.0)
    assert [(x.kind, x.where) for x in wrong.findings] == [("mass_sheet", "link 'one'"), ("mass_sheet", "robot")]
    assert wrong.repaired is None
    with pytest.raises(QueryError, match="no link 'on'"):
        check_urdf(path, mass={"on": 5.0})


def test_a_dense_body_next_to_one_without_mass_is_judged_without_a_ratio(tmp_path: Path) -> None:
    """A frame between two joints has no mass; the ratio of masses would be infinite."""
    box = '<collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>'
    inertia = '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/>'
    joints = "".join(
        f'<joint name="{name}" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0 0"/><axis xyz="0 {y} {1 - y}"/></joint>'
        for name, parent, child, y in (("a", "base", "frame", 0), ("b", "frame", "dense", 1))
    )
    text = f'<robot name="r"><link name="base"/><link name="frame"/><link name="dense">{box}<inertial>'
    path = tmp_path / "r.urdf"
    path.write_text(f'{text}<mass value="50"/>{inertia}</inertial></link>{joints}</robot>', encoding="utf-8")
    assert "mass_neighbours" not in {finding.kind for finding in rd.tools.doctor.check_urdf(path).findings}


def test_a_shape_that_covers_a_small_part_of_a_heavy_link_is_no_reason(tmp_path: Path) -> None:
    """A foot of 0.6 kg with four balls as its contact: 3e5 kg/m³ in these, and an ankle of 0.07 kg before it."""
    ball = '<collision><origin xyz="{} {} -0.03"/><geometry><sphere radius="0.005"/></geometry></collision>'
    balls = "".join(ball.format(x, y) for x in (-0.05, 0.12) for y in (-0.03, 0.03))
    box = '<visual><geometry><box size="0.2 0.08 0.06"/></geometry></visual>'
    ankle = link("ankle", 0.07, "0 0 0.02", 4e-5, 4e-5, 3e-5)
    foot = link("foot", 0.6, "0 0 0", 5e-4, 2e-3, 2e-3, box + balls)
    assert "mass_neighbours" not in {kind for kind, _ in kinds(arm(tmp_path, [LOWER, ankle, foot], [0.2, 0.36, 0.05]))}
