"""The motor budget of a motion, as text, tables and JSON."""

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
from robot_dyn.tools.motors.gear import LOSS
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.bearing_loads import FIGURES, LOADS
from robot_dyn.tools.motors.motor_budget.demand import Demand
from robot_dyn.tools.motors.motor_budget.joint_budget import KINDS, JointBudget


@final
@dataclass(frozen=True, eq=False, repr=False)
class MotorBudget(Result):
    """The demand of a motion on the motors of an arm, compared with their limits.

    Attributes:
        robot: Name of the robot.
        motion: Plan or run, in words.
        duration_s: Duration, in [s]; means and rms assume that the motion is repeated without a pause.
        joints: Demand, limits and causes of each joint.
        limits: Sources of the limits, in words.
        resolution: Times at which the motion was evaluated, in words.
        error: Largest difference of two rules of integration, relative to the mean τ² or |τ v|.
        findings: Doubtful parts, with remedies.
        demand: Torque by cause and velocity at these times.
        case: The plant, the motion and the limits of a plan; None for a run.
    """

    diagram: ClassVar[str] = "robot_dyn.tools.motors.motor_budget.diagram"
    columns: ClassVar[tuple[str, ...]] = (
        "joint", "unit", "peak", "peak_at_s", "peak_limit", "rms", "continuous_limit", "speed", "speed_at_s",
        "speed_limit", "power", "mean_power", "energy", "regenerated", "breakaway",
        *FIGURES,
    )  # fmt: skip
    robot: str
    motion: str
    duration_s: float
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
        """True if no known limit is exceeded."""
        return not any(joint.too_small for joint in self.joints)

    @reported
    def sentence(self) -> str:
        """Verdict on the motors, in one sentence."""
        return f"{self.robot}, {self.motion}: {self.verdict}"

    @property
    def verdict(self) -> str:
        """The verdict on the motors, with the exceeded limits or the nearest one."""
        small = [(joint, kind) for joint in self.joints for kind in joint.too_small]
        if small:
            return f"too small: {'; '.join(f'{joint.joint} needs {joint.says(kind)}' for joint, kind in small)}"
        used = [(share, joint, kind) for joint in self.joints for kind, share in joint.shares.items()]
        share, nearest, kind = max(used, key=lambda x: x[0])
        if not share:
            return "no limits are known, so the motors cannot be checked"
        verdict = "the motors suffice" if not self._unknown else "the motors suffice where limits are known"
        return f"{verdict}; the largest use is {share:.0%}: {KINDS[kind]} of {nearest.joint}, {nearest.says(kind)}"

    @property
    def _unknown(self) -> list[str]:
        """Joints with an unknown limit of peak torque, continuous torque or speed."""
        return [x.joint for x in self.joints if inf in (x.peak_limit, x.continuous_limit, x.speed_limit)]

    @property
    def rows(self) -> Iterator[Mapping[str, object]]:
        """A row for each joint."""
        for joint in self.joints:
            loads = {} if joint.bearing is None else vars(joint.bearing)
            yield vars(joint) | loads | {"unit": of_joint("N m", joint.type)}

    def tables(self) -> Iterator[Block]:
        joints = self.joints
        torque = {"joint": [x.joint for x in joints], "unit": [of_joint("N m", x.type) for x in joints]}
        speed = torque | {"unit": [of_joint("rad/s", x.type) for x in joints]}
        at_peak, starts = {"at t [s]": [x.peak_at_s for x in joints]}, [x.breakaway for x in joints]
        yield f"limits: {self.limits}"
        yield f"{self.resolution}; two rules of integration agree to {self.error:.1g}, relative"
        yield ""
        needs = torque | {"peak": [x.peak for x in joints]} | at_peak
        needs |= {"break-away": map(_four_digits, starts)} if any(x > 0 for x in starts) else {}
        needs |= {
            "limit": [_four_digits(x.peak_limit) for x in joints],
            "headroom": [_percent(x.headroom["peak"], x.peak_limit) for x in joints],
            "rms": [x.rms for x in joints],
            "continuous": [_four_digits(x.continuous_limit) for x in joints],
            "rms headroom": [_percent(x.headroom["continuous"], x.continuous_limit) for x in joints],
        }
        yield _table(needs)
        yield ""
        has_loss = any(LOSS in x.of_peak for x in joints)
        yield f"at the joint, without losses of {'the motor' if has_loss else 'motor and gear'}:"
        speed |= {
            "speed": [x.speed for x in joints],
            "at t [s]": [x.speed_at_s for x in joints],
            "limit": [_four_digits(x.speed_limit) for x in joints],
            "headroom": [_percent(x.headroom["speed"], x.speed_limit) for x in joints],
            "power [W]": [x.power for x in joints],
            "mean [W]": [x.mean_power for x in joints],
            "energy [J]": [x.energy for x in joints],
            "regenerated [J]": [x.regenerated for x in joints],
        }
        yield _table(speed)
        yield ""
        if lines := [(x, x.line) for x in joints if x.line]:
            yield "torque–speed line, at the largest used fraction:"
            yield _table(
                {
                    "joint": [x.joint for x, _ in lines],
                    "unit": [of_joint("N m", x.type) for x, _ in lines],
                    **{key: [line[key] for _, line in lines] for key in ("torque", "speed", "limit")},
                    "used": [f"{line['used']:.1%}" for _, line in lines],
                    "at t [s]": [line["at_s"] for _, line in lines],
                }
            )
            yield ""
        if brakes := [(x, x.holding) for x in joints if x.holding]:
            yield "brakes, and the largest torque of gravity found over the joint limits, below the bound Σ m g r:"
            yield _table(
                {
                    "joint": [x.joint for x, _ in brakes],
                    "unit": [of_joint("N m", x.type) for x, _ in brakes],
                    **{key: [getattr(y, key) for _, y in brakes] for key in ("brake", "gravity", "bound")},
                    "factor": [f"{y.factor:.2f}" for _, y in brakes],
                }
            )
            yield ""
        if bearings := [(x.joint, x.bearing) for x in joints if x.bearing]:
            yield "largest loads on bearings at the joint's origin; torsion, or force along a slide, is the drive's:"
            heads = (head for load, unit in LOADS.items() for head in (f"{load} [{unit}]", "at [s]"))
            used = [f"{y.used:.1%}" if y.used else "—" for _, y in bearings]
            rows = (
                (joint, *(getattr(y, key) for key in FIGURES), x) for (joint, y), x in zip(bearings, used, strict=True)
            )
            yield Table(("joint", *heads, "used"), tuple(rows), digits=4, right=("used",))
            yield ""
        yield "torque by cause at the peak:"
        yield _table(torque | at_peak | _by_cause("torque", [x.of_peak for x in joints]))
        yield ""
        yield "rms torque, and its parts by cause:"
        yield _table(torque | _by_cause("rms", [x.of_rms for x in joints]))
        yield ""
        yield from (f"finding: {finding}" for finding in self.findings)


def case_of(motor_budget: MotorBudget, query: str) -> tuple[Plant, PiecewisePolynomial, Limits]:
    """Return the plant, the motion and the limits of a plan's budget; raise a QueryError for a run's budget."""
    instance("motor_budget", motor_budget, MotorBudget, "give the budget of a plan, rd.tools.motors.budget(plan, arm)")
    if motor_budget.case is None:
        raise QueryError(
            f"{query} needs the budget of a plan, but this is the budget of a run: pass its motion,"
            " rd.tools.motors.budget(rd.control.from_samples(arm, run.table(), ends='measured'), plant)"
        )
    return motor_budget.case


def _four_digits(x: float) -> str:
    return number_or_dash(x, 4)


def _percent(free: float, limit: float) -> str:
    return f"{round(free, 3) + 0.0:.1%}" if limit < inf else "—"


def _by_cause(total: str, parts: Sequence[Mapping[str, float]]) -> dict[str, Iterable[Any]]:
    """Return columns of the total of each joint, and of its parts."""
    rows = [without_rounding([sum(x.values()), *x.values()]).tolist() for x in parts]
    return dict(zip((total, *parts[0]), zip(*rows, strict=True), strict=True)) if parts else {total: ()}


def _table(columns: Mapping[str, Iterable[Any]]) -> Table:
    """Return a table of columns; all except joint and unit are aligned at the right."""
    return Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), digits=4, right=tuple(columns)[2:])
