"""The doctor of URDF files: each way to break one is named; what the file still says is restored, to M itself."""

from __future__ import annotations

import json
import re
import struct
import warnings
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.errors import QueryError
from robot_dyn.studies.doctor.check import checked
from robot_dyn.studies.doctor.finding import Severity
from tests.broken_files import BROKEN, LINKS, SOUND
from tests.cli.test_command_documents import PROMISE
from tests.command import run

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
    assert all(each.what and each.remedy for each in made.findings)


@pytest.mark.parametrize("name", [name for name, each in BROKEN.items() if each.restored])
def test_what_the_file_still_says_is_restored(name: str) -> None:
    """M and N are those of the sound file to 1e-12 of their largest entries; each change is in a comment."""
    repaired = checked(BROKEN[name].change(SOUND).encode(), "rig.urdf", units=True).repaired
    assert repaired is not None
    sound, mended = rd.Robot.from_text(SOUND), rd.Robot.from_text(repaired)
    for quantity in ("M", "N"):
        x, y = getattr(sound, quantity)(Q), getattr(mended, quantity)(Q)
        assert np.abs(x - y).max() <= 1e-12 * np.abs(x).max()
    assert name == "late declaration" or repaired.count(b"<!-- robot-dyn check: ") >= 1
    again = checked(repaired, "rig.urdf")
    assert again.findings == ()


@pytest.mark.parametrize("name", ["kg mm²", "g m²", "mass in grams"])
def test_a_unit_that_is_only_suspected_is_converted_on_request_alone(name: str) -> None:
    """Numbers that nobody measured, as of sensors in the files of the world, look like numbers of other units."""
    made = checked(BROKEN[name].change(SOUND).encode(), "rig.urdf")
    (finding,) = made.findings
    assert finding.supposed
    assert finding.changes
    assert made.repaired is None


def test_an_inertial_is_estimated_at_a_density() -> None:
    """A box of the density that its stated mass is: the moments of the closed form, and M of the sound file."""
    mass, _, edges = LINKS["hand"]
    text = BROKEN["no inertial"].change(SOUND).encode()
    made = checked(text, "rig.urdf", density=float(mass / np.prod(edges)))
    assert made.repaired is not None
    x, y = rd.Robot.from_text(SOUND).M(Q), rd.Robot.from_text(made.repaired).M(Q)
    assert np.abs(x - y).max() <= 1e-6 * np.abs(x).max()  # shapes are drawn in float32
    assert checked(text, "rig.urdf").repaired is None
    with pytest.raises(QueryError, match="density"):
        checked(text, "rig.urdf", density=-1.0)


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
        assert {each.kind for each in rd.check(file).findings} <= {"com_outside"}
    assert [str(each.message) for each in seen] == []


@pytest.mark.parametrize("text", [b"", b"<robot", b"\xff\xfe", b"<html></html>", b"<robot name='x'></robot>"])
def test_what_is_no_urdf_is_a_finding(text: bytes) -> None:
    made = checked(text, "x.urdf")
    assert not made.loads
    assert [(each.kind, each.where) for each in made.findings] == [("refused", "file")]


def test_known_files_of_the_catalog() -> None:
    """UR5's wrists have inertias that their shapes have at no density; kinova's and planar_2r's numbers are sound."""
    found = {(each.kind, each.where) for each in rd.check("ur5").findings if each.severity is Severity.ERROR}
    assert found == {("inertia_shape", f"link 'wrist_{k}_link'") for k in (1, 2, 3)}
    assert rd.check("kinova").ok
    assert rd.check("planar_2r").ok


def test_the_command_tells_fixes_and_exits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(BROKEN["misspelt origin"].change(SOUND), encoding="utf-8")
    told = run("check", "arm.urdf")
    assert told.returncode == 1
    assert "error: joint 'elbow' (line" in told.stdout
    assert "<orgin> is not of URDF, and is passed over; <origin> is meant; correct it [--fix]" in told.stdout
    fixed = run("check", "arm.urdf", "--fix", "--json")
    (document,) = json.loads(fixed.stdout)["files"]
    assert document["written"] == "arm.fixed.urdf"
    (change,) = document["findings"][0]["changes"]
    assert change["text"] == "<orgin> is now <origin>"
    promised = set(re.findall(r"`(\w+)`", PROMISE.split("## `robot-dyn check")[1].split("\n## ")[0]))
    assert {*document, *document["findings"][0], *change} <= promised
    assert run("check", "arm.fixed.urdf").returncode == 0
    again = run("check", "arm.urdf", "--fix")
    assert again.returncode == 2
    assert "add --force" in again.stderr
    assert run("check", "arm.urdf", "--density", "1000").returncode == 2
    assert run("check", "arm.urdf", "--units").returncode == 2
    assert run("check", "no_such.urdf").returncode == 2
    (tmp_path / "other").mkdir()
    Path("other/arm.urdf").write_text(SOUND, encoding="utf-8")
    both = run("check", "arm.urdf", "other/arm.urdf", "--fix", "--force")
    assert both.returncode == 2
    assert "under one name" in both.stderr
