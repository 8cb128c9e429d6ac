"""The result of an identification, as text, report, URDF and JSON."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.foundations import (
    UNREPORTED,
    Answer,
    Block,
    FileKind,
    Table,
    Value,
    document,
    json_text,
    read_only,
    reported,
    target,
)
from robot_dyn.foundations import save as save_file
from robot_dyn.report import ResultError
from robot_dyn.tools.identify.verdict import Verdict

if TYPE_CHECKING:
    from robot_dyn.tools.doctor import RobotDifference

_JSON = FileKind("a result", ".json", b'{\n "arm":')
_PAGE = FileKind("a report", ".html", b"<!doctype html>")
_URDF = FileKind("a URDF", ".urdf")
KINDS = _URDF, _PAGE, _JSON
_SHOWN = 5  # causes in the text


@final
@dataclass(frozen=True)
class Parameter:
    """An identified parameter.

    Attributes:
        name: Joint that carries the body, and parameter; in SI units.
        value: Estimate.
        half_width: Half width of its 95 % interval.
        in_file: Value of the arm's file; nan where it has none.
    """

    name: str
    value: float
    half_width: float
    in_file: float


@final
@dataclass(frozen=True, eq=False)
class HeldOut(Value):
    """Rms errors of torques in the last quarter of a log, which was not used to fit them, each (n,).

    Attributes:
        joints: Names of the joints.
        file: By the numbers of the file.
        file_with_friction: By the numbers of the file, with fitted friction and offsets.
        identified: By identified numbers.
        deviation: Deviation of the torques from their mean.
    """

    joints: tuple[str, ...]
    file: np.ndarray
    file_with_friction: np.ndarray
    identified: np.ndarray
    deviation: np.ndarray

    def __post_init__(self) -> None:
        read_only(self)


@final
@dataclass(frozen=True, eq=False, repr=False)
class Identification(Answer, Value):
    """Parameters of an arm, with intervals, from a log.

    Attributes:
        arm: Name of the arm.
        parameters: Base parameters, rotor inertias, friction and offsets.
        determined: Inertial parameters of bodies that the log determines one by one.
        blind: Names of inertial parameters that it determines only in combinations, or not at all.
        confounded: Parameters that no log of joint torques distinguishes.
        time_offset_s: Time by which torques are late, in [s].
        time_offset_half_width_s: Half width of its 95 % interval, in [s].
        held_out: Errors in a part of the log that was not used.
        verdict: Causes of the difference between file and log.
        instruments: "desired motion", "second log" or "smoothed positions", whose intervals are less reliable.
        cutoff_hz: Cutoff of the filters, in [Hz].
        environment: Versions and processor.
        robot: The arm with identified parameters.
        urdf: Text of its URDF.
        file: The arm of the file.
    """

    arm: str
    parameters: tuple[Parameter, ...]
    determined: tuple[Parameter, ...]
    blind: tuple[str, ...]
    confounded: tuple[str, ...]
    time_offset_s: float
    time_offset_half_width_s: float
    held_out: HeldOut
    verdict: Verdict
    instruments: str
    cutoff_hz: float
    environment: dict[str, str]
    robot: Robot = field(metadata=UNREPORTED)
    urdf: bytes = field(metadata=UNREPORTED)
    file: Robot = field(metadata=UNREPORTED)

    def __post_init__(self) -> None:
        read_only(self)

    @cached_property
    def difference(self) -> RobotDifference:
        """The difference of the identified arm from that of the file."""
        from robot_dyn.tools.doctor import diff_robots

        return diff_robots(self.file, self.robot)

    @reported
    def sentence(self) -> str:
        """The result in one sentence."""
        new, old = (
            float(np.sqrt(np.nansum(x**2))) for x in (self.held_out.identified, self.held_out.file_with_friction)
        )
        cause = self.verdict.first[0].text if self.verdict.first else "no cause of a difference is seen"
        if self.verdict.seen and not self.verdict.has_single_cause:
            cause = f"no single cause explains more than {self.verdict.causes[0].explained:.0%} of the difference"
        return f"{self.arm}: held-out error {new:.3g}, {old:.3g} with the file's numbers and fitted friction; {cause}"

    def blocks(self) -> Iterator[Block]:
        yield self.sentence
        if (worst := self.difference.worst) is not None:
            size = f"{abs(worst.difference):.3g} {worst.unit}"
            yield f"torques at rest differ from those of the file by up to {size}, at {worst.joint}"
        if self.instruments == "smoothed positions":
            yield "without the desired motion or a second log: 95 % intervals may be too narrow"
        offset, width = 1e3 * self.time_offset_s, 1e3 * self.time_offset_half_width_s
        yield f"torques are late by {offset:.3g} ± {width:.2g} ms; filters of {self.cutoff_hz:g} Hz"
        yield ""
        yield "rms torque error in the last quarter of the log:"
        heading = "joint", "file", "file and fitted friction", "identified", "deviation of the torque"
        x = self.held_out
        rows = zip(x.joints, x.file, x.file_with_friction, x.identified, x.deviation, strict=True)
        yield Table(heading, tuple((row[0], *map(float, row[1:])) for row in rows), digits=3)
        yield ""
        yield from self._verdict()
        yield ""
        heading = "parameter", "identified", "± 95 %", "file"
        rows = ((p.name, p.value, p.half_width, p.in_file) for p in self.parameters)
        yield Table(heading, tuple(rows), digits=4)
        yield f"confounded: {'; '.join(self.confounded)}" if self.confounded else "nothing is confounded"
        yield f"not determined one by one: {', '.join(self.blind)}"
        yield ", ".join(f"{name} {value}" for name, value in self.environment.items())

    def _verdict(self) -> Iterator[Block]:
        if not self.verdict.seen:
            yield f"the file's residual is below {np.nanmax(self.verdict.ratios):.2g} times the noise: no cause is seen"
            return
        yield "causes of the difference between file and log:"
        first = self.verdict.first
        rows = ((f"{'=' if x in first else ''}", x.text, x.explained, x.bic) for x in self.verdict.causes[:_SHOWN])
        yield Table(("", "cause", "explains", "BIC"), tuple(rows), digits=4)
        if len(first) > 1:
            yield f"the log does not distinguish the first {len(first)}"
        if self.verdict.experiment is not None:
            yield self.verdict.experiment.text

    def save(self, path: str | Path) -> Path:
        """Save the report (.html), the corrected URDF (.urdf) or all data (.json); return the path.

        Raises:
            ResultError: If the suffix is another one, or the file cannot be written.
        """
        path = target(path, KINDS, ResultError)
        if path.suffix.lower() == _URDF.suffix:
            text = self.urdf
        elif path.suffix.lower() == _JSON.suffix:
            text = json_text(self).encode()
        else:
            text = document(self.arm, self._repr_html_()).encode()
        return save_file(path, lambda stream: stream.write(text), ResultError)
