"""What a motion asks of the motors of an arm, as text, tables and JSON, and the payload that still fits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar, final

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.foundations import UNREPORTED, Block, QueryError, Table, number_or_dash, reported
from robot_dyn.queries import of_joint, without_rounding
from robot_dyn.report import Result
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.demand import Demand
from robot_dyn.tools.motors.motor_budget.joint_budget import KINDS, JointBudget

if TYPE_CHECKING:
    from robot_dyn.tools.motors.motor_budget.largest_payload import LargestPayload


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
        case: The plant, the motion and the limits of torque and speed, and of continuous torque, of a plan; else None.
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
    case: tuple[Plant, PiecewisePolynomial, Limits, Any] | None = field(metadata=UNREPORTED)

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
        yield f"limits: {self.limits}"
        yield f"{self.resolution}; integrals by two rules differ by {self.error:.1g} of them"
        yield ""
        yield self._torques()
        yield ""
        yield "at the joint, without losses of motor and gear:"
        yield self._speeds()
        yield ""
        yield "torque by cause at the peak:"
        yield self._causes("torque", "of_peak")
        yield ""
        yield "rms torque, and the part of it that each cause asks for:"
        yield self._causes("rms", "of_rms")
        yield ""
        yield from (f"finding: {each}" for each in self.findings)

    def _torques(self) -> Table:
        starts = any(each.breakaway > 0 for each in self.joints)
        peak = "joint", "unit", "peak", "at t [s]", *(("break-away",) if starts else ()), "limit", "headroom"
        rows = []
        for x in self.joints:
            needs = (x.joint, of_joint("N m", x.type), x.peak, x.peak_at, *((_known(x.breakaway),) if starts else ()))
            of_peak = _known(x.peak_limit), _percent(x.headroom["peak"], x.peak_limit)
            lasting = x.rms, _known(x.continuous_limit), _percent(x.headroom["continuous"], x.continuous_limit)
            rows.append((*needs, *of_peak, *lasting))
        heading = (*peak, "rms", "continuous", "left of it")
        return Table(heading, tuple(rows), digits=4, right=(*peak[4:], *heading[-2:]))

    def _speeds(self) -> Table:
        rows = []
        for x in self.joints:
            speed = x.joint, of_joint("rad/s", x.type), x.speed, x.speed_at, _known(x.speed_limit)
            power = x.power, x.mean_power, x.energy, x.regenerated
            rows.append((*speed, _percent(x.headroom["speed"], x.speed_limit), *power))
        speed = "joint", "unit", "speed", "at t [s]", "limit", "headroom"
        heading = (*speed, "power [W]", "mean [W]", "energy [J]", "regenerated [J]")
        return Table(heading, tuple(rows), digits=4, right=speed[4:])

    def _causes(self, what: str, key: str) -> Table:
        names = tuple(self.joints[0].of_peak) if self.joints else ()
        rows = []
        for x in self.joints:
            parts = getattr(x, key)
            values = without_rounding([sum(parts.values()), *parts.values()]).tolist()
            at = (x.peak_at,) if key == "of_peak" else ()
            rows.append((x.joint, of_joint("N m", x.type), *at, *values))
        at = ("at t [s]",) if key == "of_peak" else ()
        return Table(("joint", "unit", *at, what, *names), tuple(rows), digits=4)

    def max_payload(self, link: str, com: Any = (0.0, 0.0, 0.0)) -> LargestPayload:
        """The largest point mass on a link with which the motors suffice, besides what the arm carries.

        Torque is affine in it, so the masses that fit are an interval, in closed form at each time; where the torque
        peaks between times is found again with that mass, until no limit is passed.

        Args:
            link: The link that carries it.
            com: Where, in the axes of the link, (3,), in [m].

        Raises:
            QueryError: If the budget is of a run, whose control would change as well.
            EditError: If there is no such link.
        """
        from robot_dyn.tools.motors.motor_budget.largest_payload import largest_payload

        return largest_payload(*case_of(self, "the largest payload"), link=link, com=com)


def case_of(found: MotorBudget, what: str) -> tuple[Plant, PiecewisePolynomial, Limits, Any]:
    """The case of a plan; QueryError for a run, of which what is asked for is not known."""
    if found.case is None:
        raise QueryError(
            f"{what} is of a plan, this budget is of a run: give its motion,"
            " rd.tools.motors.budget(rd.control.from_samples(arm, run.table(), ends='measured'), plant)"
        )
    return found.case


def _known(x: float) -> str:
    return number_or_dash(x, 4)


def _percent(free: float, limit: float) -> str:
    return f"{round(free, 3) + 0.0:.1%}" if limit < inf else "—"
