"""Value objects: all that are public compare and hash without raising, copy and pickle, and cannot be changed."""

from __future__ import annotations

import pickle
from copy import copy, deepcopy
from dataclasses import FrozenInstanceError, fields, is_dataclass
from functools import cache
from inspect import isabstract, isclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.accuracy.work_precision_diagram.reference_run import Reference
from tests.effect_examples import EFFECTS, arguments, example
from tests.short_stress import short_stress
from tests.tools.identify import logs
from tests.wrong_arguments import FOR_AUTHORS, ROOMS

ARM = rd.load("planar_2r")
Q = np.array([0.3, -0.4])
PLAN = rd.control.quintic(Q, Q + 1, 1.0)
BOUNDS = {"lower": -2.0, "upper": 2.0, "velocity": 2.0, "torque": 60.0}
LINE = rd.control.line([0.1, 0.2, 0.3], [0.4, 0.2, 0.1], 1.0, rotation=np.eye(3))
CLASSES = {
    name for room in ROOMS for name in room.__all__ if isclass(thing := getattr(room, name)) and not isabstract(thing)
}
NO_VALUES = FOR_AUTHORS | {
    "LogError",
    "ModelWarning",
    "PrecisionWarning",
    "RobotDynError",
    "SweepError",
    "Env",
    "Stepper",
    "VectorEnv",
}  # for types, warned of or raised; steppers and environments have a state
HELD = {  # of values that are made by functions, or held by others
    "CartesianReference", "CompiledDynamics", "CompiledPlant", "Couplings", "Edits", "ErrorEstimate",
    "ExplicitRungeKutta",
    "GaussLegendre", "JointWrenches", "Ledger", "Outcome", "Rosenbrock", "Statistics", "TaskDynamics", "WorstCase",
}  # fmt: skip
NAMES = sorted(CLASSES - NO_VALUES | HELD)


def height(t: float, q: np.ndarray, v: np.ndarray) -> float:
    return q[0]


def sweep_of_pendulum() -> rd.tools.sweeps.SweepResult:
    with TemporaryDirectory() as folder:
        scene = Path(folder, "scene.toml")
        scene.write_text('robot = "pendulum"\nduration_s = 0.01\nmethod = "RK4"\n', encoding="utf-8")
        sweep = rd.tools.sweeps.Sweep(str(scene), 4, {"q0": rd.tools.sweeps.uniform(low=[0.1], high=[0.2])})
        return rd.tools.sweeps.run(sweep, Path(folder, "out"), threads=1, chunk=4)


@cache
def values() -> dict[str, Any]:
    """One of each public class, by its name, and of the values that they hold; made when the first is asked for."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction([0.1, 0.2])])
    options: Any = {
        "duration_s": 0.05,
        "controller": rd.control.PD(PLAN, kp=10.0, kd=1.0),
        "method": "RK4",
        "step_s": 0.01,
    }
    setup = rd.Setup(plant, Q, **options)
    run, runs = rd.simulate(setup), rd.rollouts(setup, q0=[Q, Q + 0.1], vary={"kp": [1.0, 2.0]})
    loop = rd.control.Loop(
        rd.control.PD(PLAN, kp=[1.0, 2.0], kd=1.0, period_s=0.01),
        [rd.control.Noise([0.1, 0.2]), rd.control.Quantisation(0.1)],
        [rd.control.Differences(), rd.control.LowPass(9.0)],
        rd.control.RateLimit([1.0, 2.0]), 1.5,
    )  # fmt: skip
    made = [
        rd.Event(height), rd.effects.Threshold(0, 0.5, "upper stop", "touched", "left"),
        rd.effects.Layer(0, 0.01, of_velocity=True),
        rd.integrate.Adaptive(), rd.accuracy.Ball(100), rd.compare(ARM, samples=2), rd.Payload("tip", 1.0), ARM,
        ARM.joint_wrenches(Q, Q, Q),
        rd.Lagrangian(ARM), plant,
        rd.control.PD(PLAN, kp=[1.0, 2.0], kd=1.0), rd.control.PID(PLAN, kp=1.0, ki=1.0, kd=1.0),
        rd.control.PDGravity(ARM, PLAN, kp=1.0, kd=1.0),
        rd.control.FeedForward(ARM, PLAN, kp=1.0, kd=1.0), rd.control.ComputedTorque(ARM, PLAN, kp=1.0, kd=1.0),
        rd.control.OperationalSpace(ARM, "tip", LINE, kp=1.0, kd=1.0, posture=Q, rows=(0, 2)),
        rd.control.MomentumObserver(rd.control.PD(PLAN, kp=1.0, kd=1.0, period_s=0.01), ARM, bandwidth_rad_s=9.0),
        (pushed := rd.control.external_torque(ARM, [0.0, 2.0], [Q, Q], np.eye(2), np.eye(2), bandwidth_rad_s=9.0)),
        pushed.threshold(block_s=2.0), *pushed.contacts(1e-9)[:1],
        *map(example, EFFECTS), PLAN,
        rd.control.Samples([0.0, 1.0, 2.0], np.ones((3, 2))), LINE,
        loop, loop.controller, *loop.position, *loop.velocity, *loop.actuation,
        setup, run, runs, run.ledger, run.error, run.statistics, run.outcome, ARM.couplings, ARM.edits,
        rd.control.task_dynamics(ARM, Q, Q, "tip", rows=(0, 2)), rd.integrate.method("RK4"),
        rd.integrate.method("GaussLegendre4"), rd.integrate.method("Rodas5PFixed"),
        rd.accuracy.WorkPrecision("arm", (), "rad", 1.0, Reference(Q, Q, 1e-12, ("a", "b"), 1.0), (), (), {}, 1.0, 1.0),
        rd.tools.proof.prove(rd.Setup(plant, Q), 0.01), rd.advise(setup),
        rd.accuracy.Cost("arm", (), (), (), {}, 1.0, 1.0),
        rd.accuracy.certify(rd.load("pendulum"), samples=100, repeats=1), rd.tools.doctor.check_urdf("pendulum"),
        rd.tools.doctor.diff_robots(ARM, ARM.with_(mass_scale=1.1), samples=3),
        (swept := sweep_of_pendulum()), swept.sweep, rd.tools.motors.budget(PLAN, plant, effort=9.0, velocity=9.0),
        (stressed := short_stress(rd.load("pendulum"))), stressed.worst[0], rd.diff_runs(run, run),
        rd.control.inverse_kinematics(ARM, ARM.placement(Q, "tip"), frame="tip", starts=2),
        rd.tools.motors.Motors(peak={"shoulder": 9.0}, continuous={}, speed={}, armature={}),
        (motion := rd.tools.motors.path(ARM, [Q, Q + 0.5], effort=50.0, velocity=1.0)), motion.plan,
        (planned := rd.tools.identify.excite(ARM, 5.0, limits=BOUNDS, starts=1, compare_longer=False)),
        planned.expected, (poses := rd.tools.identify.Poses(np.eye(2), ARM.N(np.eye(2)))),
        rd.tools.identify.static(ARM, poses, friction=1.0),
        rd.tools.identify.Experiment((("mass", "gain"),), np.ones(1), np.ones(1), np.eye(2), planned.plan),
        (identified := rd.tools.identify.identify(logs.FILE, logs.log(), reference=logs.reference())),
        rd.tools.identify.payload(logs.FILE, logs.log(), reference=logs.reference(), link="tip"),
        identified.parameters[0], identified.held_out, identified.verdict, identified.verdict.causes[0],
        rd.tools.sweeps.Estimate("mean", 1.0, 0.9, 1.1, 0.95, 4, 0, "Student's t"),
        rd.tools.sweeps.Sensitivity(("kp",), (), (), (), 0.0, 4, 0, "fits of degree 2"),
        (source := rd.tools.export.c_source(ARM, ["N"])), source.functions[0],
        (formulas := rd.tools.symbols.symbols(ARM)), formulas.letters["m1"],
        rd.tools.symbols.RoundedAngle("roll of joint 'a'", 1.5708, 6),
        rd.tools.export.discretise(np.eye(2), np.ones((2, 1)), 0.01, 0.02),
        rd.tools.step.Stepper(ARM, 3).reset(Q),
        rd.tools.sweeps.Run(Q, Q, Q, None, None, None, None, None, np.ones((3, 2, 2)), 0.05, {"q0": Q}),
    ]  # fmt: skip
    named: dict[str, Any] = {type(each).__name__: each for each in made}
    return named | {"CompiledDynamics": rd.compiled(ARM), "CompiledPlant": rd.compiled(plant)}


def test_every_public_class_is_looked_at() -> None:
    assert sorted(values()) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_values_compare_and_hash_and_so_do_their_copies(name: str) -> None:
    value = values()[name]
    assert (value == value, value != value) == (True, False)
    assert (value == object()) is False and (value == None) is False  # noqa: E711
    for other in (copy(value), deepcopy(value), pickle.loads(pickle.dumps(value))):
        assert type(other) is type(value)
        equal = value == other
        assert equal in (True, False)
        assert not equal or hash(other) == hash(value)
        assert len({value, other}) == 2 - equal
        for field in fields(value):
            same(getattr(other, field.name), getattr(value, field.name))


def same(one: Any, other: Any) -> None:
    """The same type and, of arrays, the same numbers, read-only in both."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        for key in other:
            same(one[key], other[key])
    elif isinstance(one, np.ndarray):
        np.testing.assert_array_equal(one, other)
        assert not one.flags.writeable and not other.flags.writeable


@pytest.mark.parametrize("name", NAMES)
def test_values_cannot_be_changed(name: str) -> None:
    value = values()[name]
    assert is_dataclass(value)
    for field in fields(value):
        with pytest.raises(FrozenInstanceError):
            setattr(value, field.name, getattr(value, field.name))
        with pytest.raises(FrozenInstanceError):
            delattr(value, field.name)


def test_values_keep_copies_of_what_they_are_given() -> None:
    """What the caller does to an array afterwards changes nothing, and the array of the caller stays writeable."""
    x, points = np.array([0.3, 0.4]), np.ones((3, 2))
    times, about = np.array([0.0, 1.0, 2.0]), {"author": "me"}
    made: list[tuple[Any, tuple[str, ...]]] = [
        (rd.control.PD(PLAN, kp=x, kd=x), ("kp", "kd")),
        (rd.control.ComputedTorque(ARM, PLAN, kp=x, kd=x), ("kp", "kd")),
        (rd.control.PID(PLAN, kp=x, ki=x, kd=x, effort_limit=x), ("kp", "ki", "kd", "effort_limit")),
        (rd.control.Samples(times, points), ("breaks", "coefficients")),
        (rd.Setup(rd.Plant(ARM), x, x, metadata=about), ("q0", "v0", "metadata")),
    ]
    arrays = [x, points, times]
    for kind in EFFECTS.values():
        given = {key: np.array(value) if isinstance(value, list) else value for key, value in arguments(kind).items()}
        names = tuple(key for key, value in given.items() if isinstance(value, np.ndarray))
        made.append((kind(**given), names))
        arrays += [given[name] for name in names]
    before = [[deepcopy(getattr(value, name)) for name in names] for value, names in made]
    for array in arrays:
        array += 7.0
    about["author"] = "you"
    for (value, names), kept in zip(made, before, strict=True):
        for name, old in zip(names, kept, strict=True):
            np.testing.assert_array_equal(getattr(value, name), old)


def test_a_users_own_arrays_stay_as_they_are() -> None:
    """Copies of a controller or an effect of one's own have read-only arrays only where it has."""

    class Own(rd.control.Stateless):
        n = 2

        def __init__(self) -> None:
            self.gain, self.fixed = np.ones(2), np.ones(2)
            self.fixed.setflags(write=False)

        def torque(self, t, q, v, z):
            return -self.gain * q

    own = Own()
    for made in (copy(own), deepcopy(own)):
        assert made.gain.flags.writeable and own.gain.flags.writeable
        assert not made.fixed.flags.writeable
