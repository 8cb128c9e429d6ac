"""The hardened read of a URDF file: bytes in, checked bytes out, or a refusal.

Both implementations see only the canonical bytes written here, in which each element occurs
once, every number is a finite decimal literal, and links and joints form one tree; what dynamics does
not need (meshes, materials, simulator extensions) is left out.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import urdf
from robot_dyn.description.markup import parse
from robot_dyn.foundations.errors import DescriptionError
from robot_dyn.foundations.files import read_start
from robot_dyn.foundations.validate import instance

MAX_BYTES = 16 * 2**20  # the largest robot of example-robot-data has 0.2 MiB
_MARK = "\ufeff".encode()  # outweighs the encoding that a text declares, which is that of its file


@final
@dataclass(frozen=True)
class Description:
    """A checked robot description.

    Attributes:
        name: The robot's name in the file.
        source: Where it was read from, as shown in messages.
        text: The bytes of the file, in UTF-8.
        xml: The checked bytes: a minimal URDF with the same literals.
        findings: What was assumed where the file departs from the format.
    """

    name: str
    source: str
    text: bytes = field(repr=False)
    xml: bytes = field(repr=False)
    findings: tuple[str, ...] = ()

    @property
    def element(self) -> etree._Element:
        """The checked bytes as a fresh XML element."""
        return parse(self.xml, self.source)[0]

    @cached_property
    def estimated(self) -> dict[str, str]:
        """What the inertials that nobody measured were made from, by link: the mark that `load` and `check` write."""
        marked = ((link.get("name"), link.find("inertial[@estimated]")) for link in self.element.iterfind("link"))
        return {name: inertial.get("estimated") for name, inertial in marked if inertial is not None}

    @cached_property
    def joint_kinds(self) -> dict[str, str]:
        """Type by joint: "revolute", "continuous", "prismatic" or "fixed"."""
        return {joint.get("name"): joint.get("type") for joint in self.element.iterfind("joint")}

    @cached_property
    def joint_frames(self) -> dict[str, str]:
        """The child link, whose frame is that of the joint, by joint; without joints that share a link's name."""
        file = self.element
        links = {link.get("name") for link in file.iterfind("link")}
        children = {joint.get("name"): joint.find("child").get("link") for joint in file.iterfind("joint")}
        return {joint: link for joint, link in children.items() if joint not in links}


def read(path: str | Path) -> Description:
    """Read and check a URDF file.

    Raises:
        DescriptionError: If the file cannot be read safely, does not describe one tree of rigid bodies, or is a xacro
            file.
    """
    path = Path(path)
    refuse_xacro(path)
    return check(content(path), source=str(path))


def refuse_xacro(path: Path) -> None:
    """Refuse a file that is named as one of xacro: without its macros it may describe another robot."""
    if path.suffix.lower() == ".xacro":
        raise DescriptionError(f"{path}: is a xacro file; {urdf.EXPAND}")


def content(path: Path) -> bytes:
    """The bytes of a file, one more than `MAX_BYTES` at most.

    Raises:
        DescriptionError: If it is not a regular file, or cannot be read.
    """
    return read_start(path, MAX_BYTES + 1, DescriptionError, "give the path of a URDF file that you may read")


def check(text: bytes | str, source: str, findings: Iterable[str] = ()) -> Description:
    """Check the text of a URDF; `source` names it in messages, `findings` are those of earlier steps.

    Raises:
        DescriptionError: As `read`.
    """
    instance("source", source, str, "give a text that messages call the URDF", error=DescriptionError)
    if not isinstance(text, str | bytes):
        raise DescriptionError(f"{source}: must be a text or bytes, got {type(text).__name__}")
    if isinstance(text, str):
        try:
            text = (_MARK if "<?xml" in text else b"") + text.encode()
        except UnicodeEncodeError:
            raise DescriptionError(f"{source}: holds characters that are not text; read it as UTF-8") from None
    if len(text) > MAX_BYTES:
        raise DescriptionError(
            f"{source}: is larger than {MAX_BYTES >> 20} MiB, the limit for a robot description;"
            " keep meshes in files of their own"
        )
    root, of_markup = parse(text, source)
    checked, of_robot = urdf.checked_robot(root, source)
    encoding = root.getroottree().docinfo.encoding or "UTF-8"
    if encoding.upper() not in ("UTF-8", "US-ASCII"):
        with suppress(LookupError, UnicodeError):  # one that only the parser knows
            text = _MARK + text.decode(encoding).encode()
    findings = (*findings, *of_markup, *of_robot)
    return Description(checked.get("name", ""), source, text, etree.tostring(checked), findings)
