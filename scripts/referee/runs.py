"""87 runs: every effect, controller and method, interpreted and compiled, with events, impacts and rollouts.

Each is a function that returns a case: a setup, and for batches the starts and what varies. Runs take 0.1 s to 1 s of
motion, so that all of them take minutes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from referee import library as lib
from referee.library import CONTROL as CT
from referee.library import EFFECTS as FX

COUNT = 87
ENGINES = ("interpreted", "compiled")
Q2, V2 = np.array([0.4, 0.9]), np.array([1.3, -0.5])
Q6 = np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])
V6 = np.array([0.5, 0.4, -0.3, 0.2, 0.6, -0.5])
Q7 = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])
INERTIA6 = np.array([2.4, 2.3, 0.9, 0.09, 0.09, 0.01])  # of the UR5 near Q6, in [kg m²]
KP6, KD6 = 225 * INERTIA6, 30 * INERTIA6
KP2, KD2 = np.array([60.0, 20.0]), np.array([20.0, 6.0])


@dataclass(frozen=True)
class Case:
    """A setup; for a batch also starts (B, n), and values that differ from run to run."""

    setup: Any
    q0: Any = None
    v0: Any = None
    vary: dict[str, np.ndarray] | None = None
    record: tuple[str, ...] = ("q", "v")

    @property
    def is_batch(self) -> bool:
        return self.q0 is not None


def planar(**edits: Any) -> Any:
    """Return the planar arm with two joints."""
    return lib.arm("planar_2r", **edits)


def move(q: np.ndarray = Q2, duration: float = 0.25) -> Any:
    """Return a reference that starts at q."""
    return CT.quintic(q, q + 0.4 * np.cos(np.arange(len(q))), duration)


def of_method(name: str, engine: str) -> Case:
    """A swing with friction and a moving reference by one method; three methods choose their steps."""
    fixed = name not in ("DOP853", "Rosenbrock", "automatic")
    plant = lib.plant(planar(), FX.viscous(0.5))
    return Case(
        lib.setup(
            plant, Q2, V2, 0.3, CT.pd(move(), KP2, KD2), lib.method(name, None if fixed else 1e-8),
            2e-3 if fixed else None, 0.02, engine=engine,
        )
    )  # fmt: skip


def of_effects(*effects: Callable[[], Any], engine: str, controlled: bool = False, by: str = "DOP853") -> Case:
    """The planar arm under effects, by steps that adapt."""
    plant = lib.plant(planar(), *(effect() for effect in effects))
    law = CT.pd(move(), KP2, KD2) if controlled else None
    return Case(lib.setup(plant, Q2, V2, 0.3, law, lib.method(by, 1e-8), record=0.02, engine=engine))


EFFECTS: dict[str, Callable[..., Case]] = {
    "regularised friction": partial(of_effects, lambda: FX.regularised_coulomb(2.0, 0.05)),
    "spring": partial(of_effects, lambda: FX.spring([20.0, 5.0], [0.1, -0.2])),
    "soft stops": partial(of_effects, lambda: FX.stops(-1.0, [0.45, 0.95], 4e3, 40.0)),
    "stop damper alone": partial(
        of_effects, lambda: (FX.stop_spring(-1.0, 0.5, 2e3), FX.stop_damper([-1.0, -2.0], 0.5, 30.0))
    ),
    "wrench in world axes": partial(
        of_effects, lambda: FX.wrench("tip", [5.0, -9.0, 4.0, 0.1, 0.5, -0.3], 0.05, 0.13)
    ),
    "wrench in axes of the body": partial(
        of_effects, lambda: FX.wrench("bar_2", [5.0, -9.0, 4.0, 0.1, 0.5, -0.3], 0.1, axes="body")
    ),
    "line spring": partial(
        of_effects, lambda: FX.line_spring("tip", None, (0, 0, 0), (0.3, 0.1, 0.9), 80.0, 0.5)
    ),
    "line damper": partial(
        of_effects, lambda: FX.line_damper("tip", "base", (0, 0, 0), (0.4, 0.2, 0.7), 15.0)
    ),
    "line spring and damper": partial(
        of_effects, lambda: FX.line_spring_damper("tip", "bar_1", (0, 0, 0), (0.1, 0.3, 0.1), 200.0, 5.0, 0.6)
    ),
    "effort limit": partial(of_effects, lambda: FX.effort_limit([12.0, 6.0]), controlled=True),
    "actuator lag": partial(of_effects, lambda: FX.actuator_lag([0.02, 0.05]), controlled=True),
    "payload taken and put down": partial(
        of_effects, lambda: FX.carried(lib.payload("tip", 0.8, (0.05, 0.0, 0.1)), 0.06, 0.2)
    ),
    "payload in motion": partial(
        of_effects, lambda: FX.carried(lib.payload("tip", 0.8), 0.1, at_rest=False), controlled=True
    ),
    "bristles": partial(of_effects, lambda: FX.lugre(900.0, 8.0, 0.1, 2.0, 3.0, 0.1)),
    "Dahl friction": partial(of_effects, lambda: FX.dahl(500.0, [2.0, 1.0], 1.5)),
    "dry friction": partial(of_effects, lambda: FX.dry([9.0, 4.0])),
    "dry friction of Stribeck": partial(
        of_effects, lambda: FX.dry([6.0, 3.0], [9.0, 4.0], 0.2), controlled=True
    ),
    "rigid stops": partial(of_effects, lambda: FX.rigid_stops(-1.0, [0.5, 1.0], 0.6)),
    "rigid stops without rebound": partial(
        of_effects, lambda: (FX.rigid_stops([-1.0, 0.8], [0.5, 2.0], 0.0), FX.viscous(0.5))
    ),
    "rigid stops and dry friction": partial(
        of_effects, lambda: (FX.rigid_stops([-1.0, 0.8], [0.5, 2.0], 0.4), FX.dry([3.0, 1.5]))
    ),
    "rigid backlash": partial(
        of_effects, lambda: FX.backlash(0.02, 2e-4, 50.0, 0.3, 1.0), controlled=True
    ),
    "series elastic": partial(
        of_effects, lambda: FX.series_elastic(900.0, 2e-4, 80.0, 5.0, 5.0), controlled=True
    ),
    "series elastic with backlash": partial(
        of_effects, lambda: FX.series_elastic(900.0, 2e-4, 80.0, 5.0, 5.0, 0.01), controlled=True
    ),
    "rope, written by a user": partial(
        of_effects, lambda: lib.Rope(np.array([0.5, 9.0]), np.array([300.0, 0.0]))
    ),
}  # fmt: skip


def of_law(law: Callable[[Any], Any], engine: str = "compiled", duration: float = 0.2) -> Case:
    """The UR5 under a controller, by RK4."""
    robot = lib.arm("ur5")
    plant = lib.plant(robot, FX.viscous(1.0), FX.effort_limit([150, 150, 150, 28, 28, 28]))
    return Case(lib.setup(plant, Q6, 0.2 * V6, duration, law(robot), lib.method("RK4"), 1e-3, 0.01, engine=engine))


def reference6() -> Any:
    return move(Q6, 0.2)


def sampled(robot: Any) -> Any:
    """A loop with an encoder, filters, noise, delays and a bound on the rate of the actuation."""
    law = CT.pd_gravity(robot, reference6(), KP6, KD6, 2e-3)
    return CT.loop(
        law, [CT.quantisation(1e-4), CT.noise(2e-4)], [CT.differences(), CT.low_pass(300.0, 1)],
        [CT.rate_limit(4e4)], 1.0, 0.5, 7,
    )  # fmt: skip


def tip_motion(kind: str, robot: Any) -> Any:
    tip = lib.placement(robot, Q6, "tool0")[:3, 3]
    if kind == "circle":
        return CT.operational_space(
            robot, "tool0", CT.circle(tip - np.array([0.0, 0.1, 0.0]), 0.1, [0.0, 0.0, 1.0], 0.5), 144.0, 24.0
        )
    return CT.operational_space(
        robot, "tool0", CT.line(tip, tip + np.array([0.05, -0.1, 0.03]), 0.15), 144.0, 24.0, (0, 1, 2), 2e-3
    )


def recorded() -> Any:
    t = np.linspace(0.0, 0.25, 11)
    return CT.samples(t, Q6 + np.outer(np.sin(6 * t) ** 2, 0.3 * np.cos(np.arange(6))))


LAWS: dict[str, Callable[[Any], Any]] = {
    "PID in saturation": lambda r: CT.pid(reference6(), KP6, 5 * KP6, KD6, [9, 40, 20, 2, 1, 0.05]),
    "PID sampled": lambda r: CT.pid(reference6(), KP6, 5 * KP6, KD6, period=2e-3),
    "PD and gravity": lambda r: CT.pd_gravity(r, reference6(), KP6, KD6),
    "computed torque": lambda r: CT.computed_torque(lib.arm("ur5", mass_scale=1.2), reference6(), 225.0, 30.0),
    "computed torque sampled": lambda r: CT.computed_torque(r, recorded(), 225.0, 30.0, 2e-3),
    "feed forward": lambda r: CT.feed_forward(
        r, CT.via_points([0.0, 0.1, 0.2], [Q6, Q6 + 0.1, Q6 - 0.1], "cubic"), KP6, KD6
    ),
    "operational space, circle": partial(tip_motion, "circle"),
    "operational space, line, sampled": partial(tip_motion, "line"),
    "loop with delays and noise": sampled,
}


def passes(t: float, q: Any, v: Any) -> Any:
    return q[0] - 0.3


def stands(t: float, q: Any, v: Any) -> Any:
    return v[1] - 0.2


def with_events(engine: str) -> Case:
    """A swing that an event of a user ends, with another one on the way."""
    events = (lib.event(passes, "passes", -1), lib.event(stands, "stands", terminal=True))
    plant = lib.plant(planar(), FX.viscous(0.5))
    return Case(
        lib.setup(plant, Q2, [-2.0, 1.0], 0.4, by=lib.method("DOP853", 1e-9), record=0.02, engine=engine, events=events)
    )


def two_torques(t: float, q: Any, v: Any) -> Any:
    return np.array([3.0 * np.sin(9.0 * t), -2.0 * v[1]])


def miscellaneous() -> Iterator[tuple[str, Callable[[], Case]]]:
    """Runs with something of their own: arms, requested accuracy, divergence, functions as controllers."""
    dop = partial(lib.method, "DOP853", 1e-9)
    yield "events of a user, interpreted", partial(with_events, "interpreted")
    yield "events of a user, compiled", partial(with_events, "compiled")
    yield (
        "requested accuracy",
        lambda: Case(lib.setup(lib.plant(planar()), Q2, V2, 0.5, record=0.05, accuracy=1e-7, engine="auto")),
    )
    yield "function as controller", lambda: Case(
        lib.setup(lib.plant(planar()), Q2, V2, 0.3, CT.function(two_torques, 2), lib.method("RK4"), 2e-3, 0.02,
                  engine="interpreted")
    )  # fmt: skip
    yield "mimic joints", lambda: Case(
        lib.setup(lib.plant(lib.arm("mimic_chain"), FX.viscous(0.05)), [0.3, -0.4], [0.5, 1.0], 0.3, by=dop(),
                  record=0.02)
    )  # fmt: skip
    yield "mimic joints, interpreted", lambda: Case(
        lib.setup(lib.plant(lib.arm("mimic_chain")), [0.3, -0.4], [0.5, 1.0], 0.2, by=lib.method("RK4"), step=2e-3,
                  record=0.02, engine="interpreted")
    )  # fmt: skip
    yield "governor with stiff couplers", lambda: Case(
        lib.setup(
            lib.plant(lib.arm("flyball_governor"), *(
                FX.line_spring_damper(f"{side}_rod", "slider", (0.5, 0, 0), (sign * 0.05, 0, 0), 8e5, 4e4, 0.5)
                for side, sign in (("right", 1), ("left", -1)))),
            np.zeros(4), [2 * np.pi, 0, 0, 0], 0.3, by=lib.method("Rosenbrock", 1e-6), record=0.02,
        )
    )  # fmt: skip
    yield (
        "tree with two arms",
        lambda: Case(
            lib.setup(lib.plant(lib.arm("skew_tree")), 0.3 * np.arange(5), np.ones(5), 0.3, by=dop(), record=0.02)
        ),
    )
    yield "Panda with a payload, tilted", lambda: Case(
        lib.setup(
            lib.plant(
                lib.panda(payload=lib.payload("panda_hand", 1.5, (0.0, 0.0, 0.1)), gravity=(1.0, 0.0, -9.5)),
                FX.viscous(0.5),
            ),
            Q7, 0.1 * np.ones(7), 0.2, CT.pd(CT.hold(Q7), 100.0, 10.0), dop(), record=0.01,
        )
    )  # fmt: skip
    yield (
        "a run that diverges",
        lambda: Case(
            lib.setup(lib.plant(planar()), Q2, V2, 0.5, CT.pd(CT.hold(Q2), 9e3, 9e2), lib.method("RK4"), 5e-3, 0.02)
        ),
    )
    yield "automatic method on stiff friction", lambda: Case(
        lib.setup(
            lib.plant(planar(), FX.regularised_coulomb(2.0, 1e-4), FX.viscous(200.0)), Q2, V2, 0.3, record=0.02,
            engine="auto",
        )
    )  # fmt: skip
    yield "time stepping with stops and friction", lambda: Case(
        lib.setup(
            lib.plant(planar(), FX.dry([2.0, 1.0]), FX.rigid_stops(-1.0, [0.5, 1.0], 0.5)), Q2, V2, 0.3,
            by=lib.method("time stepping"), step=2e-3, record=0.02,
        )
    )  # fmt: skip


def batch(B: int, q: np.ndarray, seed: int) -> np.ndarray:
    """Return starts near q, (B, n)."""
    return q + np.random.default_rng(seed).uniform(-0.2, 0.2, (B, len(q)))


def of_batch(
    effects: Callable[[], Any], by: str, vary: Callable[[int], dict[str, np.ndarray]], law: Any = None
) -> Case:
    B, q0 = 12, batch(12, Q2, 3)
    fixed = by not in ("DOP853",)
    setup = lib.setup(
        lib.plant(planar(), effects()), Q2, V2, 0.3, law, lib.method(by, None if fixed else 1e-8),
        2e-3 if fixed else None, 0.02, estimate=False,
    )  # fmt: skip
    record = ("q", "v", "u", "energy", "work")
    return Case(setup, q0, np.tile(V2, (B, 1)), {lib.parameter(k): x for k, x in vary(B).items()}, record)


def spread(low: float, high: float, B: int) -> np.ndarray:
    return np.repeat(np.linspace(low, high, B)[:, None], 2, axis=1)


BATCHES: dict[str, Callable[[], Case]] = {
    "rollouts in lock step": lambda: of_batch(
        lambda: FX.viscous(0.5), "RK4", lambda B: {"viscous": spread(0.1, 1.0, B)}, CT.pd(move(), KP2, KD2)
    ),
    "rollouts in lock step past soft stops": lambda: of_batch(
        lambda: FX.stops(-1.0, [0.6, 1.1], 4e3, 40.0), "RK4", lambda B: {"soft upper": spread(0.6, 1.6, B)}
    ),
    "rollouts with dry friction": lambda: of_batch(
        lambda: FX.dry([9.0, 4.0]), "RK4", lambda B: {"dry": spread(1.0, 9.0, B)}
    ),
    "rollouts with rigid stops": lambda: of_batch(
        lambda: FX.rigid_stops(-1.0, [0.7, 1.2], 0.5), "order 8", lambda B: {}
    ),
    "rollouts by DOP853": lambda: of_batch(
        lambda: FX.spring(20.0), "DOP853", lambda B: {"mass_scale": np.linspace(0.8, 1.2, B)}
    ),
    "rollouts of sampled control": lambda: of_batch(
        lambda: FX.effort_limit([25.0, 9.0]), "RK4", lambda B: {"kp": spread(30.0, 90.0, B)},
        CT.loop(CT.pd(move(), KP2, KD2, 5e-3), [CT.noise(1e-4)], [CT.low_pass(200.0)], (), 0.4, 1.0, 3),
    ),
}  # fmt: skip


def cases() -> dict[str, Callable[[], Case]]:
    """Return all 87 runs by name."""
    made = {f"{name}, {engine}": partial(of_method, name, engine) for name in lib.METHODS for engine in ENGINES}
    for k, (name, case) in enumerate(EFFECTS.items()):
        engines = ENGINES if k % 5 < 2 else (ENGINES[k % 2],)
        made |= {f"{name}, {engine}": partial(case, engine=engine) for engine in engines}
    made |= {name: partial(of_law, law) for name, law in LAWS.items()}
    made |= dict(miscellaneous())
    return made | BATCHES
