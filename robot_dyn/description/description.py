"""Reading of untrusted URDF files: bytes in, checked bytes out, or a refusal.

Both implementations of the dynamics see only the canonical bytes written here. In them each element occurs once, every
number is a finite decimal literal, and links and joints form one tree. Meshes, materials and simulator extensions are
left out, because dynamics does not need them.
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
_MARK = "\ufeff".encode()  # overrides the encoding declared in a str, which was that of its file


@final
@dataclass(frozen=True)
class Description:
    """A checked robot description.

    Attributes:
        name: The robot's name in the file.
        source: Origin of the text, as shown in messages.
        text: The bytes of the file, in UTF-8.
        xml: The checked bytes: a minimal URDF with the same literals.
        findings: Assumptions made where the file departs from the format.
    """

    name: str
    source: str
    text: bytes = field(repr=False)
    xml: bytes = field(repr=False)
    findings: tuple[str, ...] = ()

    @property
    def element(self) -> etree._Element:
        """Return the checked bytes as a fresh XML element."""
        return parse(self.xml, self.source)[0]

    @cached_property
    def estimated(self) -> dict[str, str]:
        """Basis of each estimated inertial by link, from the mark that `load` and `check_urdf` write."""
        marked = ((link.get("name"), link.find("inertial[@estimated]")) for link in self.element.iterfind("link"))
        return {name: inertial.get("estimated") for name, inertial in marked if inertial is not None}

    @cached_property
    def joint_kinds(self) -> dict[str, str]:
        """Type of each joint: "revolute", "continuous", "prismatic" or "fixed"."""
        return {joint.get("name"): joint.get("type") for joint in self.element.iterfind("joint")}

    @cached_property
    def joint_frames(self) -> dict[str, str]:
        """Child link of each joint, whose frame is the joint's; without joints that share the name of a link."""
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
    """Raise DescriptionError for a file with a xacro suffix: unexpanded, it may describe another robot."""
    if path.suffix.lower() == ".xacro":
        raise DescriptionError(f"{path}: is a xacro file; {urdf.EXPAND}")


def content(path: Path) -> bytes:
    """Return the bytes of a file, up to `MAX_BYTES` + 1.

    Raises:
        DescriptionError: If it is not a regular file or cannot be read.
    """
    return read_start(path, MAX_BYTES + 1, DescriptionError, "give the path of a URDF file that you may read")


def check(text: bytes | str, source: str, findings: Iterable[str] = ()) -> Description:
    """Check the text of a URDF; `source` names it in messages, `findings` come from earlier steps.

    Raises:
        DescriptionError: If it cannot be read safely, or does not describe one tree of rigid bodies.
    """
    instance("source", source, str, "give a name for the URDF, to be shown in messages", error=DescriptionError)
    if not isinstance(text, str | bytes):
        raise DescriptionError(f"{source}: must be str or bytes, got {type(text).__name__}")
    if isinstance(text, str):
        try:
            text = (_MARK if "<?xml" in text else b"") + text.encode()
        except UnicodeEncodeError:
            raise DescriptionError(
                f"{source}: contains characters that UTF-8 cannot encode; read the file as UTF-8"
            ) from None
    if len(text) > MAX_BYTES:
        raise DescriptionError(
            f"{source}: is larger than {MAX_BYTES >> 20} MiB, the limit for a robot description;"
            " keep meshes in separate files"
        )
    root, markup_findings = parse(text, source)
    checked, robot_findings = urdf.checked_robot(root, source)
    encoding = root.getroottree().docinfo.encoding or "UTF-8"
    if encoding.upper() not in ("UTF-8", "US-ASCII"):
        with suppress(LookupError, UnicodeError):  # an encoding that Python lacks
            text = _MARK + text.decode(encoding).encode()
    findings = (*findings, *markup_findings, *robot_findings)
    return Description(checked.get("name", ""), source, text, etree.tostring(checked), findings)
