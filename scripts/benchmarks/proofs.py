"""Proven runs: radius and time of theorems about four arms, from points, boxes and random starts; how far they reach.

Times are of one process on one core (`time.process_time`), after tracing, which is told apart.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from time import process_time
from typing import Any, final

import numpy as np

import robot_dyn as rd
from benchmarks.measure import Effort, panda, row, table
from robot_dyn.tools.proof.motion import motion
from robot_dyn.tools.proof.tape import Tape

LITERAL = (("pendulum", 1.0), ("planar_2r", 1.0), ("ur5", 0.1), ("ur5", 0.5), ("panda", 0.05), ("panda", 0.1))
HORIZONS = {"pendulum": 20.0, "planar_2r": 10.0, "ur5": 2.0, "panda": 0.5}
NAMES = {"pendulum": "pendulum", "planar_2r": "2R", "ur5": "UR5", "panda": "Panda-7"}
RANDOM = {"pendulum": (8, 1.0), "planar_2r": (8, 1.0), "ur5": (8, 0.1), "panda": (6, 0.1)}
SEED = 20261122


def arm(name: str) -> rd.Robot:
    """An arm, without fingers."""
    return panda() if name == "panda" else rd.load(name)


@final
@dataclass(frozen=True)
class Case:
    """What is proven.

    Attributes:
        name: Of the arm.
        until_s: In [s].
        what: What acts, in words.
        effects: Besides gravity.
        control: (robot, q) → controller, or None.
        options: Of `rd.tools.proof.prove`.
        start: q and v, drawn from seed 0 if not given.
    """

    name: str
    until_s: float
    what: str = ""
    effects: tuple[rd.effects.ViscousFriction | Any, ...] = ()
    control: Any = None
    options: dict[str, Any] = field(default_factory=dict)
    start: tuple[np.ndarray, np.ndarray] | None = None

    def prove(self, bits: int) -> tuple[rd.tools.proof.Proof, float, float]:
        """The theorem, the time of tracing and that of the rest, in [s]."""
        robot, rng = arm(self.name), np.random.default_rng(0)
        q, v = (rng.uniform(-1, 1, robot.n) for _ in range(2)) if self.start is None else self.start
        controller = self.control(robot, q) if self.control else None
        setup = rd.Setup(rd.Plant(robot, self.effects), q, v, controller=controller)
        began = process_time()
        Tape(motion(setup, self.until_s))
        traced = process_time()
        made = rd.tools.proof.prove(setup, self.until_s, bits, budget_s=600.0, **self.options)
        return made, traced - began, max(process_time() - traced - (traced - began), 0.0)


def proofs(effort: Effort) -> None:
    """All tables, and the figure."""
    literal(effort)
    random(effort)
    boxes(effort)
    acting(effort)
    if (picture := effort.picture("proofs")) is not None:
        draw(picture)


def literal(effort: Effort) -> None:
    """Points, q and v drawn once from ±1, at 53 and 100 bits."""
    table("arm", "t, s", "bits", "radius of q", "radius of v", "steps", "trace, s", "time, s")
    for name, until_s in LITERAL[:2] if effort.quick else LITERAL:
        for bits in (53, 100):
            _row(Case(name, until_s), bits)


def random(effort: Effort) -> None:
    """Random starts, |q|, |v| ≤ 2, at 100 bits."""
    table("arm", "t, s", "starts", "proven to 1e-12", "worst radius of q", "median time, s", "worst time, s")
    for name, (count, until_s) in list(RANDOM.items())[: 1 if effort.quick else None]:
        rng, found = np.random.default_rng(SEED), []
        n = arm(name).n
        for _ in range(1 if effort.quick else count):
            q, v = rng.uniform(-2, 2, (2, n))
            made, _, time = Case(name, until_s, start=(q, v)).prove(100)
            found.append((made.radius_q.max() if made.proven else np.inf, time))
        radius, times = np.array(found).T
        good = int((radius <= 1e-12).sum())
        cells = f"{radius.max():.1e}", f"{np.median(times):.2f}", f"{times.max():.2f}"
        row(NAMES[name], until_s, len(found), good, *cells)


def boxes(effort: Effort) -> None:
    """Starts within a width of q."""
    table("arm", "t, s", "q(0) within", "radius of q", "steps", "time, s")
    cases = (("planar_2r", 1.0, 1e-6), ("ur5", 0.1, 1e-6), ("ur5", 0.1, 1e-4), ("panda", 0.05, 1e-6))
    for name, until_s, width in cases[:1] if effort.quick else cases:
        made, _, time = Case(name, until_s, options={"width_q": width}).prove(100)
        radius = f"{made.radius_q.max():.1e}" if made.proven else f"only to {made.until_s:.3g} s"
        row(NAMES[name], until_s, f"{width:g}", radius, len(made.nodes) - 1, f"{time:.2f}")


def acting(effort: Effort) -> None:
    """With effects and control."""
    viscous, tanh = rd.effects.ViscousFriction(0.5), rd.effects.RegularisedCoulombFriction
    cases = (
        Case("ur5", 0.1, "viscous, b = 0.5", (viscous,)),
        Case("panda", 0.05, "viscous, b = 0.5", (viscous,)),
        Case("ur5", 0.1, "spring, k = 10", (rd.effects.Spring(10.0, 0.2),)),
        Case(
            "planar_2r",
            1.0,
            "PD, kp = 100, kd = 10",
            control=lambda _, q: rd.control.PD(rd.control.hold(q + 0.1), kp=100.0, kd=10.0),
        ),
        Case(
            "ur5",
            0.1,
            "PD, kp = 100, kd = 1",
            control=lambda _, q: rd.control.PD(rd.control.hold(q + 0.1), kp=100.0, kd=1.0),
        ),
        Case(
            "ur5",
            0.1,
            "PD, kp = 100, kd = 10",
            control=lambda _, q: rd.control.PD(rd.control.hold(q + 0.1), kp=100.0, kd=10.0),
        ),
        Case("ur5", 0.1, "computed torque, masses 10 % off", control=_computed_torque),
        Case("pendulum", 1.0, "tanh, f = 1, v_s = 0.01", (tanh(1.0),)),
        Case("planar_2r", 1.0, "tanh, f = 1, v_s = 0.1", (tanh(1.0, 0.1),)),
        Case("planar_2r", 1.0, "tanh, f = 1, v_s = 0.01", (tanh(1.0),)),
        Case("ur5", 0.1, "tanh, f = 1, v_s = 0.1", (tanh(1.0, 0.1),)),
    )
    table("arm", "what", "t, s", "radius of q", "steps", "time, s")
    for case in cases[3:4] if effort.quick else cases:
        made, _, time = case.prove(100)
        radius = f"{made.radius_q.max():.1e}" if made.proven else f"only to {made.until_s:.3g} s"
        row(NAMES[case.name], case.what, case.until_s, radius, len(made.nodes) - 1, f"{time:.2f}")


def _computed_torque(robot: rd.Robot, q: np.ndarray) -> rd.control.ComputedTorque:
    return rd.control.ComputedTorque(
        robot.with_(mass_scale=0.9), rd.control.quintic(q, q + 0.5, 0.5), kp=100.0, kd=20.0
    )


def _row(case: Case, bits: int) -> None:
    made, traced, time = case.prove(bits)
    assert made.proven, made.why_not
    radii = f"{made.radius_q.max():.1e}", f"{made.radius_v.max():.1e}"
    row(NAMES[case.name], case.until_s, bits, *radii, len(made.nodes) - 1, f"{traced:.2f}", f"{time:.2f}")


def draw(picture: Path) -> None:
    """Digits proven against the horizon."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 4), layout="constrained")
    axes = figure.subplots()
    for k, (name, until_s) in enumerate(HORIZONS.items()):
        for bits, line in ((53, "--"), (100, "-")):
            made, _, time = Case(name, until_s).prove(bits)
            t, radii = (each[1:] for each in made.radii)
            label = f"{NAMES[name]}, {until_s:g} s in {time:.0f} s" if bits == 100 else None
            axes.semilogx(t, -np.log10(radii), line, color=f"C{k}", label=label)
            print(NAMES[name], bits, made.until_s, made.why_not, f"{time:.1f} s")
    axes.set(xlabel="t, s", ylabel="digits of q that are proven", ylim=(0, 30))
    axes.legend(title="100 bits (dashed: 53 bits)", frameon=False, ncols=2, loc="lower left")
    axes.grid(alpha=0.3)
    figure.savefig(picture, dpi=110)
