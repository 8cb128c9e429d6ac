"""Loops and steppers as machine code are the plain functions, bit for bit: the same rates, called by either."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Setup
from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.foundations import FLOAT64, MachineCodeError
from robot_dyn.integrate import FIXED_STEP, FixedStepper, PlainMethod, method
from robot_dyn.integrate.adaptive import ADAPTIVE
from robot_dyn.integrate.primitives import evaluate
from robot_dyn.simulation import Run, StateEquation, choose, machine_code, observation_of, segment_table
from robot_dyn.simulation.dynamics.loop_state import Ended, lanes_of, loop_config, start_position
from robot_dyn.simulation.observation.guard_levels import guard_levels
from robot_dyn.simulation.run.fixed_steps import samples_at_most
from robot_dyn.simulation.run.recording import Loop, records_of
from robot_dyn.simulation.run.time_loop import time_loop
from tests.campaigns.estimates.scenes import arms
from tests.long import long, stress, third

ARM = rd.load("planar_2r")
PLAIN = [name for name in FIXED_STEP if method(name).plain]
Q0, V0 = np.array([0.31, -0.73]), np.array([0.9, -1.7])
SAMPLED = rd.control.Loop(
    rd.control.PD(rd.control.hold([0.4, -0.2]), kp=[9.0, 5.0], kd=[0.7, 0.4], period_s=0.03),
    actuation=rd.control.Noise(0.2), actuation_delay_periods=0.5
)  # fmt: skip
CONTINUOUS = rd.control.PD(rd.control.hold([0.4, -0.2]), kp=[9.0, 5.0], kd=[0.7, 0.4])
SMOOTH = [rd.effects.ViscousFriction([0.3, 0.2]), rd.effects.RegularisedCoulombFriction([0.2, 0.1], 0.05)]
BOUNDED = [*rd.effects.joint_stops([-0.5, -0.9], [0.6, 0.8], 900.0, 4.0), rd.effects.ViscousFriction([0.1, 0.2])]
BODY = rd.effects.CarriedPayload(rd.Payload("tip", 0.3, (0.1, 0.0, 0.05)), 0.2, 0.4)


def numbers(value: Any, name: str = "") -> Iterator[tuple[str, np.ndarray]]:
    """All arrays in nested named tuples."""
    if isinstance(value, np.ndarray):
        yield name, value
    elif isinstance(value, tuple):
        for i, each in enumerate(value):
            yield from numbers(each, f"{name}.{getattr(value, '_fields', range(99))[i]}")


def assert_same_bits(ours: Any, theirs: Any, without: tuple[str, ...] = ()) -> None:
    """Every array, signs of zeros included; a nan is a nan."""
    for (name, x), (_, y) in zip(numbers(ours), numbers(theirs), strict=True):
        if name not in without:
            np.testing.assert_array_equal(x, y, err_msg=name, strict=True)
            if x.dtype == float:
                here = ~np.isnan(x)
                np.testing.assert_array_equal(np.signbit(x[here]), np.signbit(y[here]), err_msg=name)


def both(setup: Setup) -> tuple[Any, Any]:
    """A run by machine code, and by Python with the same rates of machine code."""
    code: Any = choose(setup)
    runs = [Run(setup, each) for each in (code, replace(code, machine_loop=None))]
    for each in runs:
        room = (
            each.state.lanes._replace(y=0, p=0, run_parameters=0, scale=0, energy=0, keys=0),
            each.steps.stepper.work,
        )
        for _, x in numbers(room):  # what is not written yet
            x[...] = 0
        each.record()
    return runs[0], runs[1]


def setup(what: list[Any], name: Any, **options: Any) -> Setup:
    """A run that keeps no estimate."""
    options = {"duration_s": 0.6, "record_every_s": 0.02, **options}
    return Setup(rd.Plant(ARM, what), Q0, V0, method=name, engine="compiled", estimate_error=False, **options)


@pytest.mark.parametrize("sampled", [*long([False]), True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("name", PLAIN)
def test_a_fixed_step_gives_the_same_bits(name: str, sampled: bool) -> None:
    """Each array after 300 steps: samples, ticks with noise and delay, a payload, states of the stepper."""
    more = {"controller": SAMPLED} if sampled else {}
    of = method(name)
    effects = SMOOTH if of.canonical or of.nonsmooth else [*SMOOTH, BODY]
    ours, theirs = both(setup(effects, name, step_s=0.002, **more))
    assert ours.steps.time == theirs.steps.time == 0.6
    assert_same_bits(*((run.state.lanes, run.steps.stepper.work) for run in (ours, theirs)))
    ours, theirs = ours.state, theirs.state
    rows = int(ours.position.sample_row[0])
    names = ["t", "y"] if of.nonsmooth else ["t", "y", "sampled"]  # its rates at samples are found afterwards
    for mine, other in ((getattr(each.records, name) for each in (ours, theirs)) for name in names):
        assert_same_bits(mine[:rows], other[:rows])
    shared = int(ours.position.shared_row[0])
    for i in (4, 5, 6):  # of states shared with companions
        assert_same_bits(ours.records[i][:shared], theirs.records[i][:shared])


HELD = [rd.effects.DryFriction([0.4, 0.2], [0.7, 0.3]), rd.effects.RigidStops([-0.8, -1.2], [0.7, 1.0], [0.5, 0.8])]
GEAR = [rd.effects.RigidBacklash([0.02, 0.0], 0.003, 8.0, 0.4), *HELD]
SOFT = [*HELD, *rd.effects.joint_stops([-0.75, -9.0], [0.6, 9.0], 900.0, 4.0), BODY]


@pytest.mark.parametrize(
    ("name", "what", "controller"),
    [
        *((ADAPTIVE[0], BOUNDED, SAMPLED), ("RK4", BOUNDED, None)),
        *(("DOP853", GEAR, CONTINUOUS), ("DOP853", SOFT, SAMPLED)),
        *long([("RK4", GEAR, SAMPLED), ("Rodas5PFixed", HELD, CONTINUOUS)]),
        *long([(ADAPTIVE[1], BOUNDED, SAMPLED), ("GaussLegendre4", BOUNDED, None)]),
        *stress([(ADAPTIVE[0], BOUNDED, None), (ADAPTIVE[1], BOUNDED, None), ("GaussLegendre4", BOUNDED, SAMPLED)]),
        *stress([("RK4", BOUNDED, SAMPLED), *(("Rodas5PFixed", BOUNDED, law) for law in (None, SAMPLED))]),
    ],
)
def test_a_run_with_events_gives_the_same_bits(name: str, what: list[Any], controller: Any) -> None:
    """Soft stops met and left; sticking, impacts, jumps over other thresholds, a payload; events of the user's own."""
    events = [rd.Event(lambda t, q, v: q[0] - 0.2, name="level"), rd.Event(lambda t, q, v: v[0] - 0.3, name="speed")]
    duration = 3.0 if what is BOUNDED else 1.0
    ours, theirs = both(setup(what, name, duration_s=duration, controller=controller, events=events))
    states, handlers = (ours.state, theirs.state), (ours.steps.handler, theirs.steps.handler)
    arrays = (
        (run.state.lanes, run.steps.stepper.work, run.steps.control, run.state.position) for run in (ours, theirs)
    )
    assert_same_bits(*arrays, (".3.budget",))  # machine code has a larger one
    assert_same_bits(*(handler.event_table._replace(functions=0) for handler in handlers))
    ours, theirs = states
    assert ours.events == theirs.events and len(ours.events) > 3
    rows = int(ours.position.sample_row[0])
    assert_same_bits(*(tuple(x[:rows] for x in each.records[1:4]) for each in (ours, theirs)))
    if what is not BOUNDED:
        assert sum("strikes" in each.name for each in ours.events) > 2
        modes = (handler.switching.contacts.mode for handler in handlers)
        assert_same_bits(*modes, (".log.rows",))  # since the last return


def test_a_loop_is_compiled_once_for_arms_of_any_number_of_joints() -> None:
    """One joint or two, one threshold or four: no array has a type of its own."""
    made = [setup([*HELD, *rd.effects.joint_stops([-0.5, -0.9], [0.6, 0.8], 900.0)], "RK4", step_s=0.01)]
    rail = rd.Plant(arms()["rail"], [rd.effects.RigidStops(0.0, 5.0), *rd.effects.joint_stops([0.1], [9.0], 900.0)])
    made.append(replace(made[0], plant=rail, q0=[0.3], v0=[0.0]))
    loops = []
    for each in made:
        code: Any = choose(each)
        Run(each, code).record()
        loops.append((code.machine_loop, {id(entry) for entry in code.machine_loop._entries.values()}))
    assert loops[0] == loops[1]


def test_the_end_of_a_mode_is_no_end_of_a_call_of_machine_code() -> None:
    """Hundreds of impacts, of sticking and of sliding: the loop returns for progress and for room alone."""
    made = setup(
        HELD,
        "DOP853",
        duration_s=6.0,
        controller=rd.control.PD(rd.control.hold([1.4, -1.9]), kp=[60.0, 30.0], kd=[0.1, 0.1]),
    )
    run, calls = Run(made, choose(made)), []
    inner = run.steps.loop
    run.steps.loop = lambda *given: calls.append(inner(*given)) or calls[-1]
    events = len(run.record().events)
    assert events > 100
    assert len(calls) <= 4 + events // 20
    assert set(calls) <= {Ended.PAUSED, Ended.DONE}


@pytest.mark.parametrize(
    ("name", "controller"),
    [
        ("RK4", CONTINUOUS),
        ("GaussLegendre4", SAMPLED),
        *third((name, SAMPLED) for name in PLAIN if name != "GaussLegendre4"),
    ],
)
def test_lanes_in_lock_step_give_the_same_bits(name: str, controller: rd.control.Controller) -> None:
    """64 runs, of which some diverge, with ticks or with instants at every third step, and samples; 100 steps."""
    W, of = 64, method(name)
    made = setup(SMOOTH, name, duration_s=0.2, step_s=0.002, controller=controller)
    equation = StateEquation(made.plant, made.controller, of.canonical)
    equation = equation if of.nonsmooth else equation.in_a_mode
    code: Any = machine_code(equation, of, lanes=W, extras=("u", "energy"))
    n, m, plan = 2, equation.size, segment_table(made)
    rng = np.random.default_rng(3)
    starts = np.stack([equation.start(q, v) for q, v in rng.normal(size=(W, 2, 2))]).T
    starts[n, 5] = 1e200  # overflows at once
    of_levels = guard_levels(made.plant.dynamics, made.plant.effects, made.controller, W)
    times = {"sample_period": 0.02, "sample_slack": 1e-12}
    config = loop_config(equation, False)._replace(largest=1e100, apart=0 if equation.sampled else 3, **times)
    results = []
    for interpreted in (False, True):
        lanes = lanes_of(equation, starts, code.run_parameters({}), n + 2, plan.parameters[0], np.arange(W))
        stepper = of.stepper(FLOAT64, m, n, m, W)
        for _, x in numbers(
            (stepper.work, lanes.sampled, lanes.command, lanes.u, lanes.energies, lanes.size, lanes.after)
        ):
            x[...] = 0
        rows = samples_at_most(made, plan.counts)
        observation = observation_of(np.vstack([starts[: 2 * n], np.full((n, W), np.nan)]), of_levels)
        arrays = np.arange(m), np.zeros((rows, m, W)), np.zeros((rows, n + 2, W))
        records = records_of((m, n), *arrays, observation=observation)
        records.t[...] = 0
        loop = Loop(plan, lanes, records, config, start_position())
        loop.position.budget[0] = 10**6
        advance: Any = time_loop(stepper.step) if interpreted else code.machine_loop.calls()
        functions = code.in_python if interpreted else code.code.addresses
        with np.errstate(all="ignore"):
            ended = advance(functions, stepper.coefficients, stepper.work, loop, np.zeros(1, np.int64))
        assert ended == Ended.DONE
        results.append((lanes, records, loop.position, stepper.work))
    assert results[0][0].reason[5] != 0
    assert_same_bits(results[0], results[1])


def test_the_loops_are_translated_as_they_stand() -> None:
    """No loop has a text of its own for machine code."""
    of = method("RK4").stepper(FLOAT64, 2, 1, 2)
    assert MachineFunction(time_loop(of.step), INSTEAD, lambda: None, "").function.__name__ == "advance"


class Weights(NamedTuple):
    half: float


class Work(NamedTuple):
    K: np.ndarray


def heun(f, c, work, t, h, x):
    """A step of the subset, over entries."""
    y, after = x.y, x.after
    evaluate(f.rate, t, y, x.p, x.run_parameters, work.K[0])
    for e in range(len(y)):
        for b in range(y.shape[1]):
            after[e, b] = y[e, b] + h * work.K[0, e, b]
    evaluate(f.rate, t + h, after, x.p, x.run_parameters, work.K[1])
    for e in range(len(y)):
        for b in range(y.shape[1]):
            after[e, b] = y[e, b] + c.half * h * (work.K[0, e, b] + work.K[1, e, b])
    return 2


def heun_by_arrays(f, c, work, t, h, x):
    """The same as NumPy has it, which is outside the subset."""
    evaluate(f.rate, t, x.y, x.p, x.run_parameters, work.K[0])
    x.after[...] = x.y + h * work.K[0, : len(x.y)]
    evaluate(f.rate, t + h, x.after, x.p, x.run_parameters, work.K[1])
    x.after[...] = x.y + (work.K[0, : len(x.y)] + work.K[1, : len(x.y)]) * (c.half * h)
    return 2


def heun_that_errs(f, c, work, t, h, x):
    """It takes one entry too many."""
    evaluate(f.rate, t, x.y, x.p, x.run_parameters, work.K[0])
    for e in range(len(x.y) + 1):
        x.after[e, 0] = x.y[e, 0] + h * work.K[0, e, 0]
    return 1


@dataclass(frozen=True)
class Heun(PlainMethod):
    of: Any
    name = "heun"
    order = 2
    evaluations_per_step = 2

    def stepper(self, kind, m, n, rows, runs=1, widths=None):
        return FixedStepper(self.of, Weights(0.5), Work(np.zeros((2, rows, runs), kind.dtype)))


def test_a_step_of_the_users_own_is_machine_code_or_the_summary_says_why_not() -> None:
    """Both take the compiled equation; a step in arrays runs in Python, and says the line and what to write."""
    options: dict[str, Any] = {"engine": "compiled", "step_s": 2e-3, "duration_s": 0.4, "estimate_error": False}
    made = [rd.simulate(rd.Plant(ARM, SMOOTH), Q0, V0, method=Heun(of), **options) for of in (heun, heun_by_arrays)]
    np.testing.assert_allclose(made[0].q, made[1].q, rtol=0, atol=1e-13)  # rounding of another order
    assert made[0].statistics.engine == "compiled"
    said = made[1].statistics.engine
    line = heun_by_arrays.__code__.co_firstlineno + 3
    assert "the equation of motion; steps in Python" in said
    assert (
        f"line {line}, in heun_by_arrays: an operation on a value that is not a number is not translated; write it"
        in said
    )
    assert said in made[1].summary
    with pytest.raises(SubsetError, match=f"line {line}, in heun_by_arrays"):
        rd.rollouts(rd.Plant(ARM, SMOOTH), [Q0] * 3, [V0] * 3, method=Heun(heun_by_arrays), step_s=2e-3, duration_s=0.1)


def test_a_step_that_errs_ends_the_run_with_its_line() -> None:
    """Not as a run that diverged."""
    with pytest.raises(MachineCodeError, match=r"heun_that_errs, line \d+: an index is out of range"):
        rd.simulate(
            rd.Plant(ARM, SMOOTH), Q0, V0, method=Heun(heun_that_errs), engine="compiled", step_s=2e-3,
            duration_s=0.4, estimate_error=False,
        )  # fmt: skip
