"""What a motion asks of the motors of an arm, as text, tables and JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, ClassVar, final

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.foundations import UNREPORTED, Block, QueryError, Table, instance, number_or_dash, reported
from robot_dyn.queries import of_joint, without_rounding
from robot_dyn.report import Result
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.demand import Demand
from robot_dyn.tools.motors.motor_budget.joint_budget import KINDS, JointBudget


@final
@dataclass(frozen=True, eq=False, repr=False)
class MotorBudget(Result):
    """What a motion asks of the motors of an arm.

    Attributes:
        robot: Its name.
        motion: Plan or run, in words.
        duration: In [s]; means and rms are over it, as if it were repeated without a pause.
        joints: What each joint needs, its limits, and causes.
        limits: Where the limits are from, in words.
        resolution: At which times it was looked at, in words.
        error: Largest difference of two rules of integration, as a part of the mean τ² or |τ v|; the better one counts.
        findings: What is doubtful, each with its remedy.
        demand: Torque by cause and velocity at the times that were looked at.
        case: The plant, the motion and the limits of a plan; else None.
    """

    diagram: ClassVar[str] = "robot_dyn.tools.motors.motor_budget.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "joint", "unit", "peak", "peak_at", "peak_limit", "rms", "continuous_limit", "speed", "speed_at", "speed_limit",
        "power", "mean_power", "energy", "regenerated", "breakaway",
    )  # fmt: skip
    robot: str
    motion: str
    duration: float
    joints: tuple[JointBudget, ...]
    limits: str
    resolution: str
    error: float
    findings: tuple[str, ...]
    left_out: tuple[str, ...]
    environment: dict[str, str]
    demand: Demand = field(metadata=UNREPORTED)
    case: tuple[Plant, PiecewisePolynomial, Limits] | None = field(metadata=UNREPORTED)

    @reported
    def fits(self) -> bool:
        """Whether no limit that is known is passed."""
        return not any(each.too_small for each in self.joints)

    @reported
    def sentence(self) -> str:
        """Whether the motors suffice for the motion, in a sentence."""
        return f"{self.robot}, {self.motion}: {self.verdict}"

    @property
    def verdict(self) -> str:
        """Whether the motors suffice, and what is nearest to its limit, or beyond."""
        small = [(each, kind) for each in self.joints for kind in each.too_small]
        if small:
            return f"too small: {'; '.join(f'{each.joint} needs {each.says(kind)}' for each, kind in small)}"
        used = [(share, each, kind) for each in self.joints for kind, share in each.shares.items()]
        share, nearest, kind = max(used, key=lambda x: x[0])
        if not share:
            return "no limit is known, so nothing is said of its motors"
        known = "the motors suffice" if not self._unknown else "the motors suffice where limits are known"
        return f"{known}; {nearest.joint} is nearest to its {KINDS[kind]}, {nearest.says(kind)} ({share:.0%})"

    @property
    def _unknown(self) -> list[str]:
        """Joints where no peak torque, continuous torque or speed is known."""
        limits = ((x.joint, (x.peak_limit, x.continuous_limit, x.speed_limit)) for x in self.joints)
        return [joint for joint, each in limits if inf in each]

    @property
    def rows(self) -> Iterator[Mapping[str, Any]]:
        """A row for each joint."""
        return (vars(each) | {"unit": of_joint("N m", each.type)} for each in self.joints)

    def tables(self) -> Iterator[Block]:
        joints = self.joints
        torque = {"joint": [x.joint for x in joints], "unit": [of_joint("N m", x.type) for x in joints]}
        speed = torque | {"unit": [of_joint("rad/s", x.type) for x in joints]}
        at_peak, starts = {"at t [s]": [x.peak_at for x in joints]}, [x.breakaway for x in joints]
        yield f"limits: {self.limits}"
        yield f"{self.resolution}; integrals by two rules differ by {self.error:.1g} of them"
        yield ""
        needs = torque | {"peak": [x.peak for x in joints]} | at_peak
        needs |= {"break-away": map(_known, starts)} if any(x > 0 for x in starts) else {}
        needs |= {
            "limit": [_known(x.peak_limit) for x in joints],
            "headroom": [_percent(x.headroom["peak"], x.peak_limit) for x in joints],
            "rms": [x.rms for x in joints],
            "continuous": [_known(x.continuous_limit) for x in joints],
            "left of it": [_percent(x.headroom["continuous"], x.continuous_limit) for x in joints],
        }
        yield _table(needs)
        yield ""
        yield "at the joint, without losses of motor and gear:"
        speed |= {
            "speed": [x.speed for x in joints],
            "at t [s]": [x.speed_at for x in joints],
            "limit": [_known(x.speed_limit) for x in joints],
            "headroom": [_percent(x.headroom["speed"], x.speed_limit) for x in joints],
            "power [W]": [x.power for x in joints],
            "mean [W]": [x.mean_power for x in joints],
            "energy [J]": [x.energy for x in joints],
            "regenerated [J]": [x.regenerated for x in joints],
        }
        yield _table(speed)
        yield ""
        yield "torque by cause at the peak:"
        yield _table(torque | at_peak | _by_cause("torque", [x.of_peak for x in joints]))
        yield ""
        yield "rms torque, and the part of it that each cause asks for:"
        yield _table(torque | _by_cause("rms", [x.of_rms for x in joints]))
        yield ""
        yield from (f"finding: {finding}" for finding in self.findings)


def case_of(motor_budget: MotorBudget, what: str) -> tuple[Plant, PiecewisePolynomial, Limits]:
    """Return the plant, the motion and the limits of the budget of a plan; QueryError for that of a run."""
    instance("motor_budget", motor_budget, MotorBudget, "give that of a plan, as rd.tools.motors.budget(plan, arm)")
    if motor_budget.case is None:
        raise QueryError(
            f"{what} is of a plan, this budget is of a run: give its motion,"
            " rd.tools.motors.budget(rd.control.from_samples(arm, run.table(), ends='measured'), plant)"
        )
    return motor_budget.case


def _known(x: float) -> str:
    return number_or_dash(x, 4)


def _percent(free: float, limit: float) -> str:
    return f"{round(free, 3) + 0.0:.1%}" if limit < inf else "—"


def _by_cause(what: str, parts: Sequence[Mapping[str, float]]) -> dict[str, Iterable[Any]]:
    """Return columns of the sum of the parts of each joint, and of its parts."""
    rows = [without_rounding([sum(of.values()), *of.values()]).tolist() for of in parts]
    return dict(zip((what, *parts[0]), zip(*rows, strict=True), strict=True)) if parts else {what: ()}


def _table(columns: Mapping[str, Iterable[Any]]) -> Table:
    """Return a table of columns, texts after those of joint and unit at the right."""
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), digits=4, right=tuple(columns)[2:])
