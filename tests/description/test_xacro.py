"""xacro files: expanded on request, in a process of their own, and read as any other file after it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.description.sources import xacro
from robot_dyn.foundations import DescriptionError
from tests.command import document, refusal
from tests.hostile.kinds import ARM

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
# the sound arm, of macros and arguments; the second file lies in another package
ARM_XACRO = ARM.replace("<robot ", f"<robot {NAMESPACE} ").replace(
    '<link name="base"/>',
    '<xacro:arg name="heavy" default="false"/><xacro:arg name="side" default="left"/>'
    '<xacro:include filename="$(find parts)/masses.xacro"/><xacro:base/>',
).replace('value="1.5"', 'value="${3 * half}"')  # fmt: skip
PARTS = f"""<robot {NAMESPACE}><xacro:property name="half" value="0.5"/>
  <xacro:if value="$(arg heavy)"><xacro:property name="half" value="2.5"/></xacro:if>
  <xacro:macro name="base"><link name="base"/></xacro:macro></robot>"""
Q, V, A = np.array([0.4, -0.7]), np.array([0.3, 0.9]), np.array([-0.6, 0.5])


def package(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><!-- <name>x</name> --><name> {name} </name></package>")
    return folder


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """The file of the arm, in a package beside that of its parts, neither in a folder of its name."""
    (package(tmp_path / "src/b", "parts") / "masses.xacro").write_text(PARTS)
    file = package(tmp_path / "src/a", "arms") / "urdf" / "arm.urdf.xacro"
    file.parent.mkdir()
    file.write_text(ARM_XACRO)
    return file


def test_expanded_file_has_the_dynamics_of_the_file_written_out(arm: Path) -> None:
    robot, sound = rd.load(arm, xacro={}), rd.Robot.from_text(ARM)
    assert np.array_equal(robot.inverse_dynamics(Q, V, A), sound.inverse_dynamics(Q, V, A))
    assert robot.description.source == str(arm)
    heavy = rd.Robot.from_text(ARM.replace('"1.5"', '"7.5"'))
    for yes in (True, "true", 1):
        robot = rd.load(arm, xacro={"heavy": yes, "side": "right"})
        assert np.array_equal(robot.inverse_dynamics(Q, V, A), heavy.inverse_dynamics(Q, V, A))


def test_file_that_only_defines_macros_is_told_from_a_robot_without_name(tmp_path: Path) -> None:
    file = tmp_path / "macros.xacro"
    file.write_text(f'<robot {NAMESPACE}><xacro:macro name="base"><link name="base"/></xacro:macro></robot>')
    with pytest.raises(DescriptionError, match="add at least one link, or give the file that calls the macros of this"):
        rd.load(file, xacro={})


def test_nothing_is_expanded_unless_it_is_asked_for(arm: Path) -> None:
    with pytest.raises(DescriptionError, match=r"is a xacro file; expand the file: xacro=\{\} of load, --xacro"):
        rd.load(arm)


@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf.XACRO"])
def test_a_xacro_file_without_expressions_is_refused_too(name: str, tmp_path: Path) -> None:
    """What its macros add would be missing without a word: here, the mass of the forearm."""
    body = '<xacro:macro name="heavy"><mass value="9"/></xacro:macro><link name="base"/>'
    macros = ARM.replace("<robot ", f"<robot {NAMESPACE} ").replace('<link name="base"/>', body)
    (file := tmp_path / name).write_text(macros.replace('<mass value="1.5"/>', "<xacro:heavy/>"))
    with pytest.raises(DescriptionError, match="is a xacro file; expand the file"):
        rd.load(file)
    (finding,) = rd.tools.doctor.check_urdf(file).findings
    assert (finding.kind, finding.message) == ("refused", "is a xacro file")
    assert rd.load(file, xacro={}).total_mass == rd.Robot.from_text(ARM).total_mass + 7.5


def test_an_argument_that_the_file_does_not_have_is_refused_with_the_nearest(arm: Path) -> None:
    with pytest.raises(DescriptionError, match="no argument 'hevy' in it; nearest: heavy"):
        rd.load(arm, xacro={"hevy": True})


@pytest.mark.parametrize("wrong", [["heavy"], "heavy=1", {"heavy": None}, {"heavy": [1]}])
def test_arguments_are_texts_numbers_or_booleans_by_name(wrong: object, arm: Path) -> None:
    with pytest.raises(DescriptionError, match="xacro"):
        rd.load(arm, xacro=wrong)  # pyright: ignore[reportArgumentType]


BODIES = {
    '<xacro:include filename="$(find nowhere)/a.xacro"/>': "no package 'nowhere'; searched .*; add the folder that",
    '<xacro:include filename="nowhere.xacro"/>': "No such file",
    '<link name="${lenght}"/>': "name 'lenght' is not defined",
    '<link name="$(arg side)"/>': r"Undefined substitution argument side .*; give it a value: xacro=\{'side': …\}",
    '<link name="${().__class__}"/>': "invalid name",
    "<xacro:gripper/>": "unknown macro name",
    "<link>": "mismatched tag",
    '<xacro:macro name="a"><xacro:a/></xacro:macro><xacro:a/>': "recursion",
    '<link name="a"/><link name="${1/3}" type="${2**4}"/>': "has 2 roots",  # said by the read of what it makes
}


@pytest.mark.parametrize("body", BODIES)
def test_what_xacro_refuses_is_said_by_file_and_reason(body: str, tmp_path: Path) -> None:
    (folder := tmp_path.joinpath(*"abcdefghijklmnopqrst")).mkdir(parents=True)  # a list of places hides no remedy
    (file := folder / "arm.xacro").write_text(f'<robot name="a" {NAMESPACE}>{body}</robot>')
    with pytest.raises(DescriptionError, match=BODIES[body]) as refusal:
        rd.load(file, xacro={})
    assert str(refusal.value).startswith(f"{file}: ")
    assert str(refusal.value).isprintable()


def test_a_document_type_survives_no_expansion(tmp_path: Path) -> None:
    (file := tmp_path / "arm.xacro").write_text(
        f'<!DOCTYPE robot [<!ENTITY a "1.5">]>{ARM}'.replace('"1.5"/', '"&a;"/')
    )
    with pytest.raises(DescriptionError, match="DOCTYPE"):
        rd.load(file, xacro={})


def test_expansion_is_limited_in_time_and_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (file := tmp_path / "arm.xacro").write_text(f'<robot name="a" {NAMESPACE}><link name="${{9**9**9**9}}"/></robot>')
    monkeypatch.setattr(xacro, "SECONDS", 1)
    with pytest.raises(DescriptionError, match="takes over 1 s"):
        rd.load(file, xacro={})
    file.write_text(f'<robot name="a" {NAMESPACE}><link name="${{len(\'x\' * 10**10)}}"/></robot>')
    monkeypatch.undo()
    with pytest.raises(DescriptionError, match=r"when evaluating expression|without a result"):
        rd.load(file, xacro={})


def test_warnings_of_xacro_are_findings_and_nothing_of_it_stays_in_this_process(arm: Path, capfd) -> None:
    arm.write_text(ARM_XACRO.replace("<xacro:base/>", '<xacro:property name="pi" value="3"/><xacro:base/>'))
    with pytest.warns(ModelWarning, match="arm: xacro: redefining global symbol: pi"):
        rd.load(arm, xacro={})
    assert capfd.readouterr() == ("", "")
    assert "xacro" not in sys.modules
    assert "ament_index_python" not in sys.modules


def test_without_the_package_the_remedy_is_named(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(xacro, "find_spec", lambda name: None)
    with pytest.raises(DescriptionError, match=r"pip install robot-dyn\[xacro\]"):
        rd.load(arm, xacro={})


def test_modules_of_the_working_directory_are_not_imported(arm: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder with a robot in it must not run its yaml.py."""
    for name in ("yaml", "json", "xacro"):
        (arm.parent / f"{name}.py").write_text("raise SystemExit('run')")
    monkeypatch.chdir(arm.parent)
    assert rd.load(arm, xacro={}).n == 2


def test_command_line_expands_on_request(arm: Path) -> None:
    names = ("info", arm, "--xacro")
    masses = [
        document(*names, *given)["total_mass"] for given in (("heavy=true",), ("",), ("heavy=1", "--xacro", "side=a"))
    ]
    assert masses == [10.0, 4.0, 10.0]
    assert "must be NAME=VALUE" in refusal((*names, "heavy"))
    assert "is a xacro file" in refusal(names[:2])
