"""The second reading: the checked numbers are those of the file by yourdfpy; a fault of the hardened read shows."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from lxml import etree

import robot_dyn as rd
from robot_dyn.cross_check.second_reading import second_reading
from robot_dyn.description import check, description, urdf
from tests.campaigns.foreign import macros, markup, robots
from tests.campaigns.foreign.files import inside
from tests.command import ROOT

LOADING = [file for topic in (markup, macros, robots) for file in topic.FILES if not file.refused]
# XML, but yourdfpy knows no capsule, no mass without inertia and no default namespace
UNREAD = {"a capsule and a mesh of the network", "a mass without inertia", "a default namespace"}


def is_xml(text: str | bytes) -> bool:
    try:
        etree.fromstring(text.encode() if isinstance(text, str) else text)
    except etree.XMLSyntaxError:
        return False
    return True


@pytest.mark.parametrize("file", LOADING, ids=[file.id for file in LOADING])
def test_foreign_files_are_read_alike_or_the_second_reader_says_why_not(file) -> None:
    """What the hardened read assumed where a file departs from the format is what the format's words say, twice."""
    pairs, notes = second_reading(check(file.text, "arm"), 1e-12)
    assert bool(pairs) != bool(notes)
    assert bool(pairs) == (is_xml(file.text) and file.id not in UNREAD)
    assert all(pair.worst({}).ok for pair in pairs)
    assert all("yourdfpy cannot read it" in note and "<string>" not in note for note in notes)


FAULTS = [
    ("file: mass", "link 'middle'", "link[@name='middle']//mass", "value", lambda x: x + "1"),
    ("file: inertia", "link 'distal'", "link[@name='distal']//inertia", "ixz", lambda x: "-" + x),
    ("file: origin", "link 'tip'", "link[@name='tip']/inertial/origin", "xyz", lambda x: "0 0 0"),
    ("file: origin", "joint 'flex_1'", "joint[@name='flex_1']/origin", "rpy", lambda x: "-0.2 0.1 0.4000001"),
    ("file: axis", "joint 'spread'", "joint[@name='spread']/axis", "xyz", lambda x: "0 0 -1"),
    ("file: mimic", "joint 'flex_1'", "joint[@name='flex_1']/mimic", "offset", lambda x: "0"),
    ("file: limits", "joint 'spread'", "joint[@name='spread']/limit", "velocity", lambda x: urdf.UNBOUNDED),
    ("file: limits", "joint 'spread'", "joint[@name='spread']/limit", "lower", lambda x: "0"),
    ("file: friction", "joint 'spread'", "joint[@name='spread']/dynamics", "friction", lambda x: "0"),
    ("file: links and joints", "'flex_2'", "joint[@name='flex_2']/parent", "link", lambda x: "proximal"),
    ("file: links and joints", "'flex_2'", "joint[@name='flex_2']/mimic", "joint", lambda x: "spread"),
    ("file: links and joints", "'spread'", "joint[@name='spread']", "type", lambda x: "prismatic"),
]


@pytest.mark.parametrize(("quantity", "entry", "path", "key", "change"), FAULTS)
def test_a_fault_of_the_hardened_read_shows(
    monkeypatch, quantity: str, entry: str, path: str, key: str, change: Callable[[str], str]
) -> None:
    """One number that the read writes wrongly: both implementations take it and agree; the second reading names it."""
    read = urdf.checked_robot

    def wrong(robot: etree._Element, source: str):
        checked, findings = read(robot, source)
        (element,) = checked.findall(path)
        element.set(key, change(element.get(key)))
        return checked, findings

    monkeypatch.setattr(description.urdf, "checked_robot", wrong)
    result = rd.compare(rd.load("mimic_chain"), samples=2)
    failed = [agreement for agreement in result.agreements if not agreement.ok]
    assert [(each.quantity, entry in each.entry) for each in failed] == [(quantity, True)]
    assert result.worst is failed[0] and not result.ok


def test_an_inertial_that_the_read_drops_shows(monkeypatch) -> None:
    """That of the base, of which no dynamics tells: it is on one side only, so no number agrees."""
    read = urdf.checked_robot

    def wrong(robot: etree._Element, source: str):
        checked, findings = read(robot, source)
        link = checked.find("link[@name='palm']")
        link.remove(link.find("inertial"))
        return checked, findings

    monkeypatch.setattr(description.urdf, "checked_robot", wrong)
    failed = {each.quantity: each for each in rd.compare(rd.load("mimic_chain"), samples=1).agreements if not each.ok}
    assert set(failed) == {"file: mass", "file: inertia", "file: origin"}
    assert failed["file: mass"].own == 0.5 and np.isnan(failed["file: mass"].pinocchio)


def test_the_second_reader_sees_the_file_and_not_what_was_written_of_it() -> None:
    """The numbers come from the bytes of the file: with these changed and the checked ones left, they differ."""
    text = (ROOT / "urdf" / "planar_2r.urdf").read_bytes()
    sound = check(text, "arm")
    other = description.Description(sound.name, "arm", text.replace(b'<mass value="', b'<mass value="9'), sound.xml)
    masses = [pair.worst({}) for pair in second_reading(other, 1e-12)[0] if pair.quantity == "file: mass"]
    assert masses and not any(mass.ok for mass in masses)


def test_numbers_of_a_visual_are_not_compared_whatever_they_are() -> None:
    """Infinite and nan angles, of which yourdfpy takes sines; no warning comes of it."""
    visual = '<visual><origin rpy="inf 0 nan" xyz="inf 0 0"/><geometry><sphere radius="1"/></geometry></visual>'
    pairs, notes = second_reading(
        check(inside("").replace('<link name="base"/>', f'<link name="base">{visual}</link>'), "arm"), 1e-12
    )
    assert notes == ()
    assert pairs
    assert all(pair.worst({}).ok for pair in pairs)
