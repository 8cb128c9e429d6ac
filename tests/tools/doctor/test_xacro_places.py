"""A finding of an expanded xacro file names the line that was written and the macro calls that led there."""

from __future__ import annotations

from pathlib import Path

import pytest

from robot_dyn.tools.doctor import Checkup, check_urdf

HEAD = '<robot name="vx6" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
LINK = """<xacro:macro name="lnk" params="name mass:=1 izz:=0.01">
  <link name="${name}"><inertial><mass value="${mass}"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="${izz}"/></inertial></link>
</xacro:macro>
"""
JOINT = """<xacro:macro name="jnt" params="name above below rpy:='0 0 0'">
  <joint name="${name}" type="revolute">
    <parent link="${above}"/><child link="${below}"/>
    <origin xyz="0 0 0.3" rpy="${rpy}"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="90" velocity="2"/>
  </joint>
</xacro:macro>
"""
BASE = '<link name="base"/>\n'


def places(checkup: Checkup) -> dict[str, dict[str, str]]:
    """Places by kind and by link or joint."""
    result: dict[str, dict[str, str]] = {}
    for finding in checkup.findings:
        result.setdefault(finding.kind, {})[finding.where] = finding.expanded_from
        assert finding.line is None
    return result


def check(folder: Path, text: str, **others: str) -> dict[str, dict[str, str]]:
    for name, content in others.items():
        (folder / f"{name}.xacro").write_text(HEAD + content + "</robot>")
    (folder / "arm.urdf.xacro").write_text(HEAD + text + "</robot>")
    return places(check_urdf(folder / "arm.urdf.xacro", xacro={}))


def test_a_macro_called_several_times_is_named_with_its_call(tmp_path: Path) -> None:
    found = check(
        tmp_path,
        LINK + JOINT + BASE + '<xacro:lnk name="l1"/>\n<xacro:lnk name="l2" izz="0.5"/>\n'
        '<xacro:jnt name="j1" above="base" below="l1"/>\n<xacro:jnt name="j2" above="l1" below="l2" rpy="1.57 0 0"/>\n',
    )  # fmt: skip
    assert found["inertia_impossible"] == {"link 'l2'": "line 3, macro lnk called in line 15"}
    assert found["near_right_angle"] == {"joint 'j2'": "line 9, macro jnt called in line 17"}


def test_an_element_without_a_macro_has_its_line(tmp_path: Path) -> None:
    """The line at which its start tag begins; conditions and properties do not hide it."""
    found = check(
        tmp_path,
        BASE + LINK + '<xacro:property name="x" value="1.57"/>\n<xacro:lnk name="l1"/>\n<xacro:if value="true">\n'
        '<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><axis xyz="0 1 0"/>\n'
        '<origin rpy="${x} 0 0"\n  xyz="0 0 0.3"/><limit lower="-1" upper="1" effort="90" velocity="2"/></joint>\n'
        "</xacro:if>\n",
    )  # fmt: skip
    assert found["near_right_angle"] == {"joint 'j1'": "line 11"}


def test_included_files_are_named(tmp_path: Path) -> None:
    found = check(
        tmp_path,
        '<xacro:include filename="parts.xacro"/>\n' + BASE + '<xacro:lnk name="l1" mass="-1"/>\n'
        '<xacro:jnt name="j1" above="base" below="l1" rpy="1.57 0 0"/>\n',
        parts="\n\n" + LINK + JOINT,
    )  # fmt: skip
    assert found["near_right_angle"] == {"joint 'j1'": "line 11 of parts.xacro, macro jnt called in line 5"}
    assert found["refused"]["link 'l1'"].startswith("line 5 of parts.xacro, macro lnk called in line 4")


def test_macros_within_macros_are_named_innermost_first(tmp_path: Path) -> None:
    arm = """<xacro:macro name="arm" params="side izz">
  <xacro:lnk name="${side}_l1" izz="${izz}"/>
  <xacro:jnt name="${side}_j1" above="base" below="${side}_l1"/>
</xacro:macro>
"""
    found = check(
        tmp_path,
        '<xacro:include filename="arm.xacro"/>\n' + BASE + '<xacro:arm side="left" izz="0.01"/>\n'
        '<xacro:arm side="right" izz="0.5"/>\n',
        parts=LINK + JOINT,
        arm='<xacro:include filename="parts.xacro"/>\n' + arm,
    )  # fmt: skip
    right = "line 3 of parts.xacro, macro lnk called in line 4 of arm.xacro, macro arm called in line 5"
    assert found["inertia_impossible"] == {"link 'right_l1'": right}


def test_a_block_given_to_a_macro_has_the_line_of_the_call(tmp_path: Path) -> None:
    turned = """<xacro:macro name="turned" params="name above below *place">
  <joint name="${name}" type="revolute"><parent link="${above}"/><child link="${below}"/>
    <xacro:insert_block name="place"/><axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="90" velocity="2"/></joint>
</xacro:macro>
"""
    found = check(
        tmp_path,
        LINK + turned + BASE + '<xacro:lnk name="l1"/>\n<xacro:turned name="j1" above="base" below="l1">\n'
        '  <origin xyz="0 0 0.3" rpy="1.57 0 0"/>\n</xacro:turned>\n',
    )  # fmt: skip
    assert found["near_right_angle"] == {"joint 'j1'": "line 13, macro turned called in line 12"}


@pytest.mark.parametrize("prefix", ["", "b_"])
def test_two_calls_with_one_name_are_found_at_the_second(tmp_path: Path, prefix: str) -> None:
    text = LINK + JOINT + BASE + '<xacro:lnk name="l1"/>\n<xacro:jnt name="j1" above="base" below="l1"/>\n'
    found = check(tmp_path, f'{text}<xacro:lnk name="{prefix}l1"/>\n')
    twice = {} if prefix else {"link 'l1'": "line 3, macro lnk called in line 16"}
    assert found.get("name_twice", {}) == twice
