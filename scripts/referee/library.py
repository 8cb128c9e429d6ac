"""The library's names that the referee uses, each once: after a rename, a line here changes and nothing else.

Names and arguments of these functions, and names of stored values, stay as they are, so that the results of two trees
can be compared.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

import robot_dyn as rd

Values = dict[str, np.ndarray]
Texts = dict[str, Any]

CACHE_VARIABLE = "ROBOT_DYN_CACHE"  # names the folder of compiled code
METHODS = {
    "Euler": "Euler",
    "semi-implicit Euler": "SemiImplicitEuler",
    "midpoint": "Midpoint",
    "RK4": "RK4",
    "order 8": "DP8",
    "Gauss 2": "GaussLegendre2",
    "Gauss 4": "GaussLegendre4",
    "Gauss 6": "GaussLegendre6",
    "Rosenbrock, fixed step": "Rodas5PFixed",
    "time stepping": "MoreauJean",
    "DOP853": "DOP853",
    "Rosenbrock": "Rodas5P",
    "automatic": "auto",
}
_FORMER = "explicit euler,semi implicit euler,midpoint,rk4,order 8,gauss 2,gauss 4,gauss 6,rosenbrock 5,time stepping"
RENAMED = {**dict(zip(_FORMER.replace(" ", "_").split(","), METHODS.values(), strict=False)), "Rosenbrock": "Rodas5P"}
"""Names of methods by the names that stored folders have."""


def arm(name: str, **edits: Any) -> Any:
    """Return a robot; edits are gravity, lock, payload, armature and mass_scale."""
    robot = rd.load(name)
    return robot.with_(**edits) if edits else robot


def panda(**edits: Any) -> Any:
    """Return the Panda without its fingers."""
    return arm("panda", lock={"panda_finger_joint1": 0.0}, **edits)


def payload(frame: str, mass: float, com: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Any:
    """Return a payload that is fixed to a frame."""
    return rd.Payload(frame, mass, com)


def plant(robot: Any, *effects: Any) -> Any:
    """Return a robot with effects; tuples of effects are taken apart."""
    return rd.Plant(robot, [x for group in effects for x in (group if isinstance(group, tuple) else (group,))])


def own_lagrangian(robot: Any) -> Any:
    """Return the own implementation of a robot."""
    return rd.Lagrangian(robot)


def compiled(robot: Any) -> Any:
    """Return the machine code of a robot or plant, on one thread."""
    return rd.compiled(robot, threads=1)


def pinocchio_model(robot: Any) -> Any:
    """Return the model of Pinocchio that a robot uses."""
    return robot.model


def placement(robot: Any, q: Any, frame: str) -> np.ndarray:
    """Return the pose of a frame, (4, 4)."""
    return robot.placement(q, frame)


def compare(robot: Any, samples: int) -> Any:
    """Compare the implementations of a robot at random states."""
    return rd.compare(robot, samples=samples)


_fx, _ct = rd.effects, rd.control
EFFECTS = SimpleNamespace(
    viscous=lambda b: _fx.ViscousFriction(b),
    regularised_coulomb=lambda coulomb, velocity: _fx.RegularisedCoulombFriction(coulomb, velocity),
    dry=lambda coulomb, static=None, velocity=None: _fx.DryFriction(coulomb, static, velocity),
    lugre=lambda k, d, b, coulomb, static, velocity: _fx.LuGreFriction(k, d, b, coulomb, static, velocity),
    dahl=lambda k, coulomb, exponent=None: _fx.DahlFriction(k, coulomb, exponent),
    spring=lambda k, rest=0.0: _fx.Spring(k, rest),
    stops=lambda lower, upper, k, d: tuple(_fx.joint_stops(lower, upper, k, d)),
    stop_spring=lambda lower, upper, k: _fx.JointStopSpring(lower, upper, k),
    stop_damper=lambda lower, upper, d: _fx.JointStopDamper(lower, upper, d),
    rigid_stops=lambda lower, upper, restitution=0.0: _fx.RigidStops(lower, upper, restitution),
    wrench=lambda frame, wrench, start=0.0, end=np.inf, axes="world_aligned": _fx.ExternalWrench(
        frame, wrench, axes, start_s=start, end_s=end
    ),
    line_spring=lambda a, b, p, r, k, length: _fx.LineSpring(a, b, p, r, stiffness=k, length=length),
    line_damper=lambda a, b, p, r, d: _fx.LineDamper(a, b, p, r, damping=d),
    line_spring_damper=lambda a, b, p, r, k, d, length: _fx.LineSpringDamper(
        a, b, p, r, stiffness=k, damping=d, length=length
    ),
    effort_limit=lambda limit: _fx.EffortLimit(limit),
    actuator_lag=lambda time: _fx.ActuatorLag(time),
    carried=lambda load, start=0.0, end=np.inf, at_rest=True: _fx.CarriedPayload(load, start, end, at_rest),
    backlash=lambda half_gap, inertia, ratio=None, restitution=0.0, viscous=None: _fx.RigidBacklash(
        half_gap, inertia, ratio, restitution, viscous
    ),
    series_elastic=lambda k, inertia, ratio=None, damping=None, viscous=None, half_gap=None: _fx.SeriesElastic(
        k, inertia, ratio, damping, viscous, half_gap
    ),
)
CONTROL = SimpleNamespace(
    hold=lambda q: _ct.hold(q),
    quintic=lambda q0, q1, duration, start=0.0: _ct.quintic(q0, q1, duration, start_s=start),
    via_points=lambda times, points, kind="quintic": _ct.via_points(times, points, kind=kind),
    samples=lambda t, q: _ct.Samples(t, q),
    circle=lambda centre, radius, normal, period: _ct.circle(centre, radius, normal, period),
    line=lambda p0, p1, duration: _ct.line(p0, p1, duration),
    pd=lambda reference, kp, kd, period=0.0: _ct.PD(reference, kp=kp, kd=kd, period_s=period),
    pid=lambda reference, kp, ki, kd, limit=np.inf, period=0.0: _ct.PID(
        reference, kp=kp, ki=ki, kd=kd, effort_limit=limit, period_s=period
    ),
    pd_gravity=lambda model, reference, kp, kd, period=0.0: _ct.PDGravity(
        model, reference, kp=kp, kd=kd, period_s=period
    ),
    computed_torque=lambda model, reference, kp, kd, period=0.0: _ct.ComputedTorque(
        model, reference, kp=kp, kd=kd, period_s=period
    ),
    feed_forward=lambda model, reference, kp, kd, period=0.0: _ct.FeedForward(
        model, reference, kp=kp, kd=kd, period_s=period
    ),
    operational_space=lambda model, frame, reference, kp, kd, rows=None, period=0.0: _ct.OperationalSpace(
        model, frame, reference, kp=kp, kd=kd, rows=rows, period_s=period
    ),
    function=lambda law, n: _ct.ControlLaw(law, n),
    loop=lambda law, position=(), velocity=(), actuation=(), measured=0.0, acts=0.0, seed=0: _ct.Loop(
        law, tuple(position), tuple(velocity), tuple(actuation), measured, acts, seed
    ),
    quantisation=lambda step: _ct.Quantisation(step),
    noise=lambda deviation: _ct.Noise(deviation),
    differences=lambda: _ct.Differences(),
    low_pass=lambda cutoff, order=2: _ct.LowPass(cutoff, order),
    rate_limit=lambda rate: _ct.RateLimit(rate),
)


@dataclass(frozen=True, eq=False)
class Rope(rd.effects.Conservative):
    """An effect of a user that switches: a rope pulls a joint back beyond the position where it becomes tight."""

    slack: np.ndarray = field(metadata=rd.effects.coefficient("rad", symbol="slack until", fill_value=9.0))
    stiffness: np.ndarray = field(metadata=rd.effects.coefficient("N m/rad", symbol="k", minimum=0))

    def stretch(self, q: Any) -> Any:
        return np.maximum(q - self.slack, 0.0)

    def torque(self, dynamics: Any, t: Any, q: Any, v: Any) -> Any:
        return -self.stiffness * self.stretch(q)

    def potential(self, dynamics: Any, t: Any, q: Any) -> Any:
        return (self.stiffness * self.stretch(q) ** 2).sum(axis=-1) / 2

    def thresholds(self, n: int) -> tuple[Any, ...]:
        levels = np.broadcast_to(self.slack, n).tolist()
        return tuple(rd.effects.Threshold(i, level, "rope", "tight", "slack") for i, level in enumerate(levels))


def method(name: str, tolerance: float | None = None) -> Any:
    """Return a method by the name used here; with a tolerance, one that controls its error."""
    theirs = METHODS[name]
    return theirs if tolerance is None else rd.integrate.Adaptive(theirs, rtol=tolerance, atol=tolerance / 100)


def event(function: Callable[[Any, Any, Any], Any], name: str, direction: int = 0, terminal: bool = False) -> Any:
    """Return an event where a function of (t, q, v) vanishes."""
    return rd.Event(function, direction, terminal, name)


def setup(
    plant: Any,
    q0: Any,
    v0: Any = None,
    duration: float = 0.5,
    controller: Any = None,
    by: Any = None,
    step: float | None = None,
    record: float = 0.0,
    estimate: bool = True,
    engine: str = "compiled",
    events: tuple[Any, ...] = (),
    accuracy: float | None = None,
) -> Any:
    """Return the setup of a run; `engine` is "compiled", "interpreted" or "auto"."""
    options = {"method": by} if by is not None else {}
    return rd.Setup(
        plant, q0, v0, duration_s=duration, controller=controller, step_s=step, record_every_s=record,
        estimate_error=estimate, engine=engine, events=events, accuracy=accuracy, **options,
    )  # fmt: skip


def start_of(setup: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return position and velocity at the start of a setup."""
    return setup.q0, setup.v0


def simulate(of: Any, q0: Any = None, v0: Any = None) -> Any:
    """Run a setup, from another start if one is given."""
    return rd.simulate(of, q0, v0)


def run_values(run: Any) -> tuple[Values, Texts]:
    """Return the numbers and the texts of a run that are compared."""
    values = {"t": run.t, "q": run.q, "v": run.v, "a": run.a, "u": run.u}
    values |= {"kinetic": run.ledger.kinetic, "potential": run.ledger.potential}
    values |= {f"work of {name}": work for name, work in sorted(run.ledger.work.items())}
    values |= {f"power of {name}": power for name, power in sorted(run.power.items())}
    values |= {f"stored in {name}": x for name, x in sorted(run.ledger.stored.items())}
    values |= {f"state of {name}": x for name, x in sorted(run.effect_states.items()) if x.size}
    values |= {f"torque of {name}": x for name, x in sorted((run.effect_torques or {}).items())}
    optional = {
        "reference": run.desired,
        "deviation": None
        if run.tracking_error is None
        else 0.0 - run.tracking_error,  # name and sign of stored results
        "state of the controller": run.controller_states,
        "extremes": run.extremes,
    }
    values |= {name: x for name, x in optional.items() if x is not None and x.size}
    values["times of events"] = np.array([x.t for x in run.events])
    values["positions at events"] = np.array([x.q for x in run.events])
    values["end"] = np.array([run.outcome.t])
    remarks = sorted((str(x.kind), x.joint, x.quantity, x.value) for x in run.remarks)
    values["values of remarks"] = np.array([x[3] for x in remarks], float)
    if run.error is not None:
        values |= {
            # nothing is estimated where the estimate ends at the start: stored results have nan there
            "error": np.array([run.error.at(run.error.until_s) if run.error.until_s > 0 else np.nan]),
            "resolved until": np.array([run.error.until_s]),
        }
    texts = {
        "ending": str(run.outcome.ending),
        "method": run.statistics.method,
        "steps": run.statistics.steps,
        "evaluations": run.statistics.evaluations,
        "evaluations of companions": run.statistics.companion_evaluations,
        "ledger closes": bool(run.ledger.closes),
        "events": [[x.name, x.direction, x.joint] for x in run.events],
        "remarks": [list(x[:3]) for x in remarks],
        "verdict": None if run.error is None else str(run.error.verdict),
    }
    return {name: np.asarray(x) for name, x in values.items()}, texts


def rollouts(
    of: Any, q0: Any, v0: Any = None, vary: Mapping[str, Any] | None = None, record: Sequence[str] = ("q", "v")
) -> Any:
    """Run a batch on one thread."""
    return rd.rollouts(of, q0, v0, vary=vary, record=tuple(record), threads=1)


def rollouts_values(runs: Any) -> tuple[Values, Texts]:
    """Return the numbers and the texts of a batch that are compared."""
    values = {name: getattr(runs, name) for name in ("t", "q", "v", "u", "kinetic", "potential")}
    values |= {f"work of {name}": x for name, x in sorted((runs.work or {}).items())}
    values |= {"end": runs.ended_s}
    if runs.rms_tracking_error is not None:
        values["tracking error"] = runs.rms_tracking_error
    remarks = sorted((str(x.kind), x.joint, x.quantity, sorted(x.runs)) for x in runs.remarks)
    texts = {
        "diverged": runs.diverged.tolist(),
        "steps": runs.steps.tolist(),
        "remarks": [list(x) for x in remarks],
    }
    return {name: np.asarray(x) for name, x in values.items() if x is not None}, texts


PARAMETERS = {  # names of parameters that vary, where they differ from those used here
    "viscous": "viscous_friction.viscous",
    "dry": "dry_friction.coulomb",
    "dry static": "dry_friction.static",
    "limit": "effort_limit.limit",
    "lugre stiffness": "lugre_friction.bristle_stiffness",
    "lugre coulomb": "lugre_friction.coulomb",
    "dahl coulomb": "dahl_friction.coulomb",
    "soft upper": "joint_stops.upper",
    "soft stiffness": "joint_stops.stiffness",
    "rigid upper": "rigid_stops.upper",
    "restitution": "rigid_stops.restitution",
    "spring": "spring.stiffness",
    "elastic stiffness": "series_elastic.stiffness",
    "regularised": "regularised_coulomb_friction.coulomb",
}


def parameter(name: str) -> str:
    """Return the library's name of a parameter that varies."""
    return PARAMETERS.get(name, name)


_sw = rd.tools.sweeps
DISTRIBUTIONS = SimpleNamespace(
    uniform=lambda low, high: _sw.uniform(low=low, high=high),
    normal=lambda mean, sd: _sw.normal(mean=mean, sd=sd),
    lognormal=lambda median, sigma: _sw.lognormal(median=median, sigma_of_log=sigma),
    triangular=lambda low, mode, high: _sw.triangular(low=low, mode=mode, high=high),
    choice=lambda values: _sw.choice(values),
)
FIGURES = SimpleNamespace(
    rms_tracking_error=lambda joint=None: _sw.rms_tracking_error(joint),
    peak=lambda of, joint=None: _sw.peak(of, joint),
    final=lambda of, joint=None: _sw.final(of, joint),
)


def width(distribution: Any) -> int:
    """Return the number of columns of a design that a distribution takes."""
    return distribution.size


def sweep(setup: str, vary: Mapping[str, Any], figures: Mapping[str, Any], design: np.ndarray) -> Any:
    """Return a sweep on given rows; `setup` is the import path of a function that returns a setup."""
    names = {parameter(name): x for name, x in vary.items()}
    return _sw.Sweep(setup, len(design), names, dict(figures), design=design)


def sweep_values(of: Any, folder: Path) -> tuple[Values, Texts]:
    """Run a sweep on one thread; return the numbers and the texts of its rows that are compared."""
    table = _sw.run(of, folder, threads=1, chunk=32).table()
    names = {theirs: ours for ours, theirs in PARAMETERS.items()} | {"ended_s": "ended"}
    values = {
        ours_of(name, names): x
        for name, x in table.items()
        if x.dtype.kind == "f" and name not in ("reason", "remarks")
    }
    texts = {"outcome": [str(x) for x in table["outcome"]], "remarks": [bool(x) for x in table["remarks"]]}
    return values, texts


def ours_of(column: str, names: Mapping[str, str]) -> str:
    """Return the name used here of a column; an index in brackets is kept."""
    name, bracket, index = column.partition("[")
    return names.get(name, name) + bracket + index


def tree() -> Path:
    """Return the folder that the library is imported from."""
    return Path(rd.__file__).parents[1]


def environment(cache: Path | None = None) -> dict[str, str]:
    """Return the environment of a fresh process of this tree, on one thread, with the given folder for its code."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OPENBLAS", "OMP", "MKL", "NUMBA")}
    place = os.environ | threads | {"PYTHONPATH": f"{tree()}{os.pathsep}{tree() / 'scripts'}"}
    place.pop("PYTHONDONTWRITEBYTECODE", None)
    return place if cache is None else place | {CACHE_VARIABLE: str(cache)}


def versions() -> dict[str, str]:
    """Return what the results depend on besides the tree."""
    import pinocchio  # pyright: ignore[reportMissingImports]
    import scipy

    return {
        "python": sys.version.split()[0],
        "numpy": np.__version__,
        "scipy": scipy.__version__,
        "pinocchio": pinocchio.__version__,
    }
