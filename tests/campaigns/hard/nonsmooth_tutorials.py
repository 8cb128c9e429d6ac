"""Systems of Siconos' tutorials as arms: their equations and numbers, with joints for their coordinates.

    relay                  v' ∈ −2 Sgn(v),  v = (1, −1): q = v₀ t − sgn(v₀) t², at rest from 0.5 s
    bouncing ball          q'' = −9.81 from 1 m, e = 0.9: flights of 2 eᵏ √(2/g), at rest from (1 + e)/(1 − e) √(2/g)
    friction oscillator    q'' + q ∈ −Sgn(q'),  (q, v) = (12, 6): half periods about ±1, at rest once |q| ≤ 1 at v = 0
    twisting relay         q'' ∈ −10 Sgn(q) − 3 Sgn(q'),  (q, v) = (10, 10): parabolas, at rest from 12.3 s
    two-link manipulator   two links of 0.5 m, 1 kg, 1 kg m², from (0.9, −1.6) rad, with stops 0 ≤ q₁ ≤ π, −π ≤ q₂ ≤ 0

The first four have closed forms. The manipulator strikes stops of its joints, e = 0.7; the tutorial's hand strikes the
ground. Its truth is SciPy's DOP853 in modes that are found by trying all combinations, as under Friction, stops,
impacts. Pressed, it is driven by the tutorial's gains γ₁ = 8 and γ₁ γ₂ = 56 to a posture 0.1 rad beyond a stop. Judged
is the largest error of q over the whole run:

    default tolerances       |q_h − q| ≤ estimate / 0.3,  |q_h − q| ≤ 1e-5,  |v| = 0 where the motion ends at rest
    asked for 1e-6           |q_h − q| ≤ 10 · 1e-6
    time stepping            |q_h − q| at a quarter of the step ≤ 0.4 of that at the step (order 1), or rounding

Default tolerances and the steps of time stepping are for motions of 1 to 15 m. The switches of the twisting relay
accumulate: a method with events ends there with the time.
[Acary, Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, final

import numpy as np

import robot_dyn as rd
from robot_dyn import RobotDynError
from tests.campaigns.estimates.nonsmooth import nonsmooth_truth
from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.chains import Body, text
from tests.campaigns.hard.stiff_motion import Motion
from tests.campaigns.hard.stiffness import ASKED, LEAST, TIMES

TITLE = "Tutorials of nonsmooth dynamics"
ORDER_1 = 0.4  # of a quarter, since impacts fall anywhere within steps
SAMPLES = 200
ROUNDING = 1e-12  # [m] or [rad] of each unit of motion, below which an estimate cannot tell
G, E, LAST = 9.81, 0.9, 1e-13  # [s]: the shortest arc of those that accumulate
NEAR = 1e-5  # [m] or [rad]: what default tolerances leave on motions of 1 to 15 m


@dataclass(frozen=True)
class Tutorial:
    """A motion, the step of time stepping, and whether it ends at rest."""

    motion: Motion
    step_s: float
    rests: bool = True


Arc = tuple[float, Callable[[np.ndarray], np.ndarray]]  # its duration, and positions after a time


def joined(arcs: Iterator[Arc], rest: float) -> Callable[[np.ndarray], np.ndarray]:
    """Positions of one joint along arcs, at rest after the last."""
    pieces, starts = [], [0.0]
    for duration, q in arcs:
        pieces.append(q)
        starts.append(starts[-1] + duration)

    def exact(t: np.ndarray) -> np.ndarray:
        found = np.full(len(t), rest)
        for q, start, end in zip(pieces, starts, starts[1:], strict=False):
            inside = (start <= t) & (t < end)
            found[inside] = q(t[inside] - start)
        return found[:, None]

    return exact


def parabola(q: float, v: float, a: float) -> Callable[[np.ndarray], np.ndarray]:
    return lambda t: q + t * (v + t * a / 2)


def slide(axes: int = 1) -> rd.Robot:
    """Blocks of 1 kg on horizontal rails, each across the one before."""
    x, y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    return rd.Robot.from_text(text("slide", [Body(axis, x, kind="prismatic") for axis in (x, y)[:axes]]))


def oscillator() -> Tutorial:
    """A spring and dry friction."""
    q0, v0 = 12.0, 6.0

    def arcs() -> Iterator[Arc]:
        centre = -1.0
        radius, angle = np.hypot(q0 - centre, v0), -np.arctan2(v0, q0 - centre)  # q = c + r cos(t + φ)
        yield -angle, lambda t, c=centre, r=radius, a=angle: c + r * np.cos(t + a)
        q = centre + radius
        while abs(q) > 1:
            centre = float(np.sign(q))
            yield np.pi, lambda t, c=centre, r=q - centre: c + r * np.cos(t)
            q = 2 * centre - q
        ends.append(q)

    ends: list[float] = []
    made = list(arcs())
    setup = rd.Setup(
        rd.Plant(slide(), [rd.effects.Spring(1.0), rd.effects.DryFriction(1.0)]), [q0], [v0], duration_s=100.0
    )
    return Tutorial(Motion(setup, joined(iter(made), ends[-1])), 1e-2)


def relay() -> Tutorial:
    """Two velocities that a relay brings to zero."""
    v0 = np.array([1.0, -1.0])
    setup = rd.Setup(rd.Plant(slide(2), [rd.effects.DryFriction([4.0, 2.0])]), [0.0, 0.0], v0, duration_s=1.0)
    setup = replace(setup, engine="interpreted")  # short, so that machine code takes longer to compile than to run

    def exact(t: np.ndarray) -> np.ndarray:
        until = np.minimum(t, 0.5)[:, None]
        return v0 * until * (1 - until)

    return Tutorial(Motion(setup, exact), 1e-2)


def ball() -> Tutorial:
    """Bounces that accumulate at 8.6 s."""
    block = Body((0.0, 0.0, 1.0), (0.1, 0.0, 0.0), kind="prismatic")
    robot = rd.Robot.from_text(text("ball", [block])).with_(gravity=(0.0, 0.0, -G))

    def arcs() -> Iterator[Arc]:
        fall = np.sqrt(2 / G)
        yield fall, parabola(1.0, 0.0, -G)
        v = E * G * fall
        while (flight := 2 * v / G) > LAST:
            yield flight, parabola(0.0, v, -G)
            v *= E

    setup = rd.Setup(rd.Plant(robot, [rd.effects.RigidStops(0.0, 10.0, E)]), [1.0], [0.0], duration_s=10.0)
    return Tutorial(Motion(setup, joined(arcs(), 0.0)), 5e-3)


@final
@dataclass(frozen=True, eq=False)
class Relay(rd.effects.Active):
    """A force −f sgn(q)."""

    force: float

    def thresholds(self, n: int) -> tuple[rd.effects.Threshold, ...]:
        return tuple(rd.effects.Threshold(i, 0.0, "relay", "switched", "switched back") for i in range(n))

    def torque(self, dynamics: Any, t: float, q: Any, v: Any) -> Any:
        return -self.force * np.sign(q)


def twisting() -> Tutorial:
    """A relay of position and one of velocity, whose switches accumulate at 12.3 s."""
    strong, weak, q0, v0 = 13.0, 7.0, 10.0, 10.0

    def arcs() -> Iterator[Arc]:
        side, start, v = 1.0, q0, v0
        while (out := v / strong) > LAST:
            yield out, parabola(side * start, side * v, -side * strong)
            apex = start + v**2 / (2 * strong)
            back = np.sqrt(2 * apex / weak)
            yield back, parabola(side * apex, 0.0, -side * weak)
            side, start, v = -side, 0.0, weak * back

    plant = rd.Plant(slide(), [Relay(10.0), rd.effects.DryFriction(3.0)])
    return Tutorial(Motion(rd.Setup(plant, [q0], [v0], duration_s=20.0), joined(arcs(), 0.0)), 0.1)


def manipulator(controller: Any = None) -> Tutorial:
    """Two links that fall, or are pressed, on joint stops."""
    radius = np.sqrt((12 - 0.25) / 3)  # of a cylinder of 0.5 m and 1 kg: 1 kg m² about its middle
    links = [Body((0.0, 0.0, 1.0), (0.5, 0.0, 0.0), 1.0, float(radius))] * 2
    robot = rd.Robot.from_text(text("two_links", links)).with_(gravity=(0.0, -9.8, 0.0))
    stops = rd.effects.RigidStops([0.0, -np.pi], [np.pi, 0.0], 0.7)
    setup = rd.Setup(rd.Plant(robot, [stops]), [0.9, -1.6], [0.0, 0.0], duration_s=3.0, controller=controller)
    return Tutorial(Motion(setup, partial(nonsmooth_truth, setup)), 1e-3, rests=False)


def pressed() -> Tutorial:
    """The gains of the tutorial, γ₁ = 8 and γ₁ γ₂ = 56, towards a posture 0.1 rad beyond the stop."""
    return manipulator(rd.control.PD(rd.control.hold([-0.1, -1.6]), kp=56.0, kd=8.0))


def rows(case: str, make: Callable[[], Tutorial], seed: int) -> Iterator[Row]:
    made = make()
    motion = made.motion
    setup = replace(motion.setup, record_every_s=motion.setup.duration_s / SAMPLES)
    run = rd.simulate(setup)
    assert run.error is not None
    words = "; ".join(x for x in (run.outcome.text, run.error.note, run.leak) if x)
    error, floor = distance(run, motion), ROUNDING * (1 + float(np.abs(run.q).max()))
    estimate = run.error.largest if run.error.until_s > 0 else np.nan
    yield Row(case, "true error over its estimate", max(error, floor) / max(estimate, floor), 1 / LEAST, words)
    yield Row(case, "true error, m or rad", error, NEAR, words)
    if made.rests:
        yield Row(case, "speed at the end, m/s", float(np.abs(run.v[-1]).max()), 0.0, words)
    what = f"asked for {ASKED:g}: true error over that"
    try:
        yield Row(case, what, distance(rd.simulate(setup, accuracy=ASKED), motion) / ASKED, TIMES)
    except RobotDynError as refusal:
        yield Row(case, what, np.nan, TIMES, str(refusal))
    errors = [
        distance(rd.simulate(setup, method="MoreauJean", step_s=step), motion)
        for step in (made.step_s, made.step_s / 4)
    ]
    found = errors[1] / errors[0] if errors[1] > floor else 0.0
    yield Row(case, f"time stepping of {made.step_s:g} s: error at a quarter of the step", found, ORDER_1)


def distance(run: rd.Trajectory, motion: Motion) -> float:
    """The largest error of q over the run."""
    return float(np.abs(run.q - motion.exact(run.t)).max())


MADE = {
    "relay": relay, "bouncing ball": ball, "friction oscillator": oscillator, "twisting relay": twisting,
    "two-link manipulator, falling": manipulator, "two-link manipulator, pressed": pressed,
}  # fmt: skip
CASES = [Case(name, partial(rows, name, make), make is pressed) for name, make in MADE.items()]
