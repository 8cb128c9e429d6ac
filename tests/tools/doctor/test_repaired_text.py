"""A repaired file is the file with the repaired values: all other characters and lines stay."""

from __future__ import annotations

import re

import numpy as np
import pytest

from robot_dyn.description import catalog
from robot_dyn.shapes import Masses
from robot_dyn.tools.doctor import checked
from tests.long import third

FILE = """<?xml version="1.0"?>
<!-- quotes: > " ' -->
<robot name="r"> <!-- <mass value="2,0"/> -->
<link name='base'/>
<link
   name='a &amp; b'   >
  <inertial><!-- measured --><mass
      value =  '2,0'  />
    <origin   xyz="0  0  .1" rpy='0   0  0'></origin>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01"
       iyz="0" izz='0.01'/></inertial>
</link>
<joint name="j" type="revolute"><parent link="base"/><child link="a &#38; b"/><orgin
 rpy='0   1.5708  0'
 xyz="0 0 1">
</orgin><axis xyz="0 1 0"/><limit uper="1" lower="-1" effort="10" velocity='-1'/></joint>
</robot>"""
REPAIRED = {
    "'2,0'  />": "'2.0'  />", "1.5708": "1.5707963267948966", "<orgin": "<origin", "/orgin": "/origin",
    "uper": "upper", "'-1'": "'1'",
}  # fmt: skip
FORMS = {
    "as it stands": lambda text: text.encode(),
    "line ends of Windows": lambda text: text.replace("\n", "\r\n").encode(),
    "byte order mark and last line end": lambda text: b"\xef\xbb\xbf" + text.encode() + b"\n\n",
    "no declaration": lambda text: text.partition("\n")[2].encode(),
    "Latin-1": lambda text: text.replace('"1.0"', '"1.0" encoding="latin1"').replace("sured", "süred").encode("latin1"),
    "UTF-16": lambda text: text.replace('"1.0"', '"1.0" encoding="UTF-16"').encode("utf-16"),
    "default namespace": lambda text: text.replace('name="r"', 'name="r" xmlns="http://x"').encode(),
    "undeclared prefix": lambda text: text.replace("</robot>", '<a:b c:d="1,5"/></robot>').encode(),
}  # fmt: skip


@pytest.mark.parametrize("form", FORMS)
def test_all_but_the_repaired_values_stays(form: str) -> None:
    sound = FILE
    for old, new in REPAIRED.items():
        assert sound.count(old) == 1
        sound = sound.replace(old, new)
    assert checked(FORMS[form](FILE), "rig.urdf").repaired == FORMS[form](sound)


def test_a_line_break_in_a_number_goes_and_no_other() -> None:
    text = FILE.replace('"0  0  .1"', '"0\n 0\t.1"').encode()
    repaired = checked(text, "rig.urdf").repaired
    assert repaired is not None
    assert b"<origin   xyz=\"0 0 .1\" rpy='0   0  0'></origin>" in repaired
    assert repaired.count(b"\n") == text.count(b"\n") - 1


def test_an_estimated_inertial_is_one_more_line() -> None:
    """The link keeps its other lines, in an element that had content and in one that is closed at once."""
    shape = '<visual><geometry><box size="1 1 1"/></geometry></visual>'
    text = re.sub(r"(?s)  <inertial>.*</inertial>", f"  {shape}", FILE).replace("'-1'", "'1'")
    text = text.replace("orgin", "origin").replace("uper", "upper").replace("1.5708", "0").encode()
    repaired = checked(text, "rig.urdf", estimates=Masses({}, None, 1000.0)).repaired
    assert repaired is not None
    before, after = text.splitlines(), repaired.splitlines()
    (new,) = [line for line in after if line not in before]
    assert [line for line in after if line != new] == before
    assert new.startswith(b"  <inertial") and b'<mass value="1000.0"/>' in new


def small(count: int) -> list[str]:
    """Names of the smallest files of the catalog that state a mass with a decimal point."""
    named = {name: catalog.find(name).stat().st_size for name in catalog.list_robots()}
    return sorted(named, key=lambda name: named[name])[:count]


@pytest.mark.parametrize("name", [*small(4), *third(small(36)[4:])])
def test_of_a_file_of_the_catalog_only_lines_with_repairs_change(name: str) -> None:
    path = catalog.find(name)
    text = path.read_bytes().replace(b"package://", b"package://absent/")  # without its meshes, which take minutes
    places = [*re.finditer(rb"<mass\s+value\s*=\s*[\"'](\d+\.\d+)[\"']", text)]
    if not places:
        pytest.skip("no mass with a decimal point")
    place = places[np.random.default_rng(1).integers(len(places))]
    broken = text[: place.start(1)] + place[1].replace(b".", b",") + text[place.end(1) :]
    checkup = checked(broken, "rig.urdf")
    assert checkup.repaired is not None
    assert "decimal_comma" not in {finding.kind for finding in checkup.left}
    lines = zip(broken.split(b"\n"), checkup.repaired.split(b"\n"), strict=True)
    changed = {number for number, (old, new) in enumerate(lines, start=1) if old != new}
    assert broken.count(b"\n", 0, place.start(1)) + 1 in changed
    assert changed <= {finding.line for finding in checkup.findings if finding.changes}
