"""A part earns machine code and "order seen" by what it declares, whoever wrote it; nothing is lost in silence."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import isabstract
from pathlib import Path
from textwrap import dedent
from typing import Any, ClassVar

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Trajectory
from robot_dyn.control import Block, Controller
from robot_dyn.effects import Effect
from robot_dyn.foundations import ControlError, EffectError, QueryError, SceneError, TraceError, tanh
from robot_dyn.scene.effects import DeclaredEffect
from robot_dyn.simulation import DoubtKind, MachineError, Verdict, choose
from robot_dyn.simulation.diagnostics.smoothness import LOOKS
from robot_dyn.simulation.dynamics.declarations import undeclared
from tests.effect_examples import EFFECTS, example
from tests.long import long

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.9])


def setup_of(part: Any, **options: Any) -> rd.Setup:
    """Of an effect or a controller."""
    effects, controller = ([part], None) if isinstance(part, Effect) else ((), part)
    steps = {"duration_s": 0.5, "method": "RK4", "step_s": 1e-3, "estimate_error": False}
    return rd.Setup(rd.Plant(ARM, effects), Q, V, controller=controller, **steps | options)


def run(part: Any, engine: str, **options: Any) -> Trajectory:
    return rd.simulate(setup_of(part, engine=engine, **options))


def engine_of(part: Any) -> str:
    """The engine that a run of six seconds takes, which is worth compiling."""
    setup = setup_of(part, duration_s=6.0)
    return choose(setup).label


@dataclass(frozen=True, eq=False)
class Declared(rd.effects.Dissipative):
    """τ = −c tanh(v): what is written outside of the library, and declared."""

    c: Any = field(metadata=rd.effects.coefficient("N m", symbol="c", minimum=0))

    def thresholds(self, n=0):
        return ()

    calls: ClassVar[int] = 0

    def torque(self, dynamics, t, q, v):
        Declared.calls += 1
        return -self.c * tanh(v)


@dataclass(frozen=True, eq=False)
class Silent(rd.effects.Dissipative):
    """The same, and nothing is declared."""

    c: Any
    calls: ClassVar[int] = 0

    def torque(self, dynamics, t, q, v):
        Silent.calls += 1
        return -self.c * tanh(v)


def test_a_declared_effect_is_compiled_and_has_the_order_of_its_method() -> None:
    """As one of the library does; others of its coefficients share the code. 1e-12 is rounding of 500 steps."""
    assert engine_of(Declared(2.0)) == "compiled"
    made = run(Declared(1.5), "auto", estimate_error=True)
    assert made.statistics.engine == "compiled" and made.error is not None
    assert made.error.verdict is Verdict.ORDER
    np.testing.assert_allclose(made.q, run(Declared(1.5), "interpreted").q, rtol=0, atol=1e-12)


def test_a_declared_effect_is_not_looked_at_between_steps_and_an_undeclared_one_is() -> None:
    counts = []
    for kind in (Declared, Silent):
        kind.calls = 0
        plant = rd.Plant(ARM, [kind(1.5)])
        made = rd.simulate(plant, Q, V, duration_s=0.3, engine="interpreted", record_every_s=0.1)
        counts.append(kind.calls - made.statistics.evaluations - made.statistics.companion_evaluations)
    assert made.error is not None and made.error.verdict is Verdict.BOUND
    assert made.error.no_order.kind is DoubtKind.UNDECLARED and made.error.no_order.facts["part"] == "Silent"
    assert counts[0] < 100 < LOOKS <= counts[1]  # of the start, the samples and their ledger


def test_an_undeclared_part_runs_interpreted_and_the_summary_says_what_to_declare() -> None:
    made = run(Silent(1.5), "auto", duration_s=0.01)
    remedy = "declares no thresholds: define thresholds(self, n), which returns () if it is smooth everywhere"
    assert f"interpreted (Silent {remedy})" in made.summary


class Bare(rd.effects.Active):
    def thresholds(self, n=0):
        return ()

    def __init__(self, c: float) -> None:
        self.c = c

    def torque(self, dynamics, t, q, v):
        return -self.c * v


@dataclass(frozen=True, eq=False)
class Remembers(rd.effects.Active):
    memory: Any = field(default_factory=dict)

    def thresholds(self, n=0):
        return ()

    def torque(self, dynamics, t, q, v):
        return self.memory.setdefault("v", v) - v


@dataclass(frozen=True, eq=False)
class Cached(rd.effects.Active):
    c: Any = field(default=2.0, metadata=rd.effects.coefficient("N m s/rad", minimum=0))

    def thresholds(self, n=0):
        return ()

    @cached_property
    def square(self) -> float:
        return self.c**2

    def torque(self, dynamics, t, q, v):
        return -self.square * v


class Halved(Block):
    def output(self, x, s, period_s):
        return x / 2


@pytest.mark.parametrize(
    ("effects", "block", "said"),
    [
        ([Bare(2.0)], None, "may change its attribute 'c' in a run: make it a frozen dataclass"),
        ([Remembers()], None, "may change the content of its attribute 'memory'"),
        ((), Halved(), "does not declare whether its output jumps: define rounds"),
        ([Cached()], None, ""),
    ],
)
def test_what_may_change_unseen_is_not_declared(effects: Any, block: Any, said: str) -> None:
    pd = rd.control.PD(rd.control.hold(Q), kp=4.0, kd=1.0, period_s=0.01)
    controller = None if block is None else rd.control.Loop(pd, velocity=[block])
    found = undeclared(rd.Plant(ARM, effects), controller)
    assert [why for _, why in found] == [] if not said else said in found[0][1]
    if not block and not said:
        assert engine_of(effects[0]) == "compiled"


def test_what_follows_from_a_coefficient_is_not_kept_where_that_is_swept() -> None:
    """A cached property stayed what it was for the first run of a batch, and for other values of machine code."""
    setup = setup_of(Cached(1.0))
    rd.simulate(setup, engine="interpreted")  # which keeps c² = 1
    runs = rd.rollouts(setup, vary={"cached.c": [1.0, 3.0]})
    for k, c in enumerate((1.0, 3.0)):
        np.testing.assert_allclose(runs.q[k], run(Cached(c), "interpreted").q, rtol=0, atol=1e-12)


def concrete(base: type) -> list[type]:
    kinds = [kind for each in base.__subclasses__() for kind in (each, *concrete(each))]
    return [kind for kind in dict.fromkeys(kinds) if not isabstract(kind)]


@pytest.mark.parametrize(("base", "name"), [(Effect, "thresholds"), (Controller, "thresholds"), (Block, "rounds")])
def test_each_part_of_the_library_declares_as_a_users_does(base: type, name: str) -> None:
    """A function alone declares nothing; what wraps a part while it is traced stands in no plant of a run."""
    without = {"ControlLaw"} | {kind.__name__ for kind in concrete(base) if "symbolic_plant" in kind.__module__}
    for kind in concrete(base):
        inherited = kind.__mro__[: kind.__mro__.index(base)]
        if kind.__module__.startswith("robot_dyn.") and kind.__name__ not in without:
            assert any(name in vars(each) for each in inherited), kind


def test_no_part_of_the_library_is_undeclared() -> None:
    sampled = rd.control.PD(rd.control.hold(Q), kp=4.0, kd=1.0, period_s=0.01)
    blocks = [rd.control.Noise(0.1), rd.control.LowPass(3.0), rd.control.Quantisation(0.1)]
    loop = rd.control.Loop(
        sampled,
        velocity=[rd.control.Differences(), *blocks],
        actuation=rd.control.RateLimit(1.0),
    )
    effects = [example(name) for name in EFFECTS]
    for controller in (
        loop,
        rd.control.PID(rd.control.hold(Q), kp=4.0, ki=1.0, kd=1.0),
        rd.control.FeedForward(ARM, rd.control.hold(Q), kp=4.0, kd=1.0),
    ):
        assert undeclared(rd.Plant(ARM, effects), controller) == ()


STATE = {"count": 0, "gain": 2.0}
DRAWN = np.random.default_rng(1)


@dataclass(frozen=True, eq=False)
class Law(rd.control.Stateless):
    """A controller whose formula is that of the test; thresholds are declared, which says nothing of its code."""

    formula: Any
    n: int = 2

    def thresholds(self, n=0):
        return ()

    def torque(self, t, q, v, z):
        return self.formula(t, q, v)


def random(t, q, v):
    return -v + 1e-3 * DRAWN.normal(size=2)


def counting(t, q, v):
    STATE["count"] += 1
    return -v * (1 + 1e-3 * STATE["count"])


def late(t, q, v):
    return -v if isinstance(t, float) and t > 3.0 else -2 * v


def swallowed(t, q, v):
    try:
        return -v * float(v[0])
    except TypeError:
        return -v


@pytest.mark.parametrize("law", [random, counting, late, swallowed], ids=lambda law: law.__name__)
def test_what_a_trace_loses_is_found_and_named_and_the_run_is_interpreted(law: Any) -> None:
    """Randomness, global state, and what does on symbols something else, after the first second as well."""
    assert engine_of(Law(law)).startswith("interpreted (the compiled state equation with Law differs")
    with pytest.raises(MachineError, match="Law differs from the interpreted one"):
        run(Law(law), "compiled", duration_s=6.0)


def reads(t, q, v):
    return -v * np.loadtxt([str(STATE["gain"])])


def crosses(t, q, v):
    return q[0] - STATE["gain"] / 10


class Changing(rd.effects.Active):
    """An effect whose coefficient its owner changes between two runs."""

    stiffness = 2.0

    def torque(self, dynamics, t, q, v):
        return -self.stiffness * q


OWNED = Changing()
CHANGED: dict[str, tuple[Any, dict[str, Any]]] = {
    "an attribute of an effect": ([OWNED], {}),
    "what a controller reads": ((), {"controller": Law(reads)}),
    "a global of an event": ((), {"events": [rd.Event(crosses)]}),
}


@pytest.mark.parametrize("what", CHANGED)
def test_what_has_changed_since_an_earlier_run_is_found(what: str) -> None:
    """What an attribute, a file or a global holds is a constant of the code: it is compared before each run."""
    effects, parts = CHANGED[what]
    options = {"duration_s": 0.1, "method": "RK4", "estimate_error": False} | parts
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, **options)
    OWNED.stiffness = STATE["gain"] = 2.0
    rd.simulate(setup, engine="compiled")
    OWNED.stiffness = STATE["gain"] = 3.0
    for method in ("RK4", "DOP853"):
        with pytest.raises(MachineError, match=r"(changing|Law|crosses) differs from the interpreted one"):
            rd.simulate(setup, engine="compiled", method=method)
    assert np.array_equal(rd.simulate(setup).q, rd.simulate(setup, engine="interpreted").q)


@pytest.mark.parametrize(
    "law",
    [
        lambda t, q, v: np.array([-5.0, 0.0]) if v[0] > 0 else 0 * v,
        lambda t, q, v: -v if t < 0.4 else -2 * v,
        lambda t, q, v: np.array([max(-3.0 * v[0], -0.2), 0.0]),
    ],
    ids=["a branch on the velocity", "a branch on the time", "max"],
)
def test_a_branch_is_traced_both_ways(law: Any) -> None:
    """Fixed steps do not end at an undeclared switch, at the same place in both engines but for rounding."""
    assert engine_of(Law(law)) == "compiled"
    made, other = (run(Law(law), engine, duration_s=0.6) for engine in ("auto", "interpreted"))
    np.testing.assert_allclose(made.q, other.q, rtol=0, atol=1e-10)


@dataclass(frozen=True, eq=False)
class Gravity(rd.control.Stateless):
    """A controller whose model is an attribute of any name."""

    robot: Any
    part: float
    n: int = 2

    def thresholds(self, n=0):
        return ()

    def torque(self, t, q, v, z):
        return self.part * self.robot.N(q) - v


def test_two_controllers_with_the_same_model_are_two() -> None:
    """A part that has an attribute `robot` was told by that robot alone."""
    for part in (0.5, 0.9):
        law = Gravity(ARM, part)
        made, other = (run(law, engine) for engine in ("compiled", "interpreted"))
        np.testing.assert_allclose(made.q, other.q, rtol=0, atol=1e-12)


class Windy(rd.effects.Dynamics):
    """Dynamics with equations of their own, around a robot."""

    robot, n, joint_names = ARM, ARM.n, ARM.joint_names

    def _answer(self, name: str, state: Any, out: Any, frame: tuple[str, ...] = (), *, nan: bool = False) -> Any:
        return ARM._answer(name, state, out, frame, nan=nan) + (name == "N")


def test_equations_of_bodies_of_another_class_are_not_those_of_the_robot_in_it() -> None:
    with pytest.raises(TraceError, match="Windy is not a Robot"):
        rd.simulate(rd.Plant(Windy()), Q, V, engine="compiled", duration_s=0.1)  # pyright: ignore[reportArgumentType]


def test_a_compiled_plant_is_not_what_is_simulated() -> None:
    compiled: Any = rd.compiled(rd.Plant(ARM))
    for asked in (rd.simulate, rd.rollouts):
        with pytest.raises(EffectError, match="got a CompiledPlant; pass the Plant itself, with engine='compiled'"):
            asked(compiled, Q)


SCENES = {
    "free": ((), None, "auto"),
    "friction": ([rd.effects.ViscousFriction(0.3), rd.effects.RegularisedCoulombFriction(0.4, 0.1)], None, "auto"),
    "stops": (rd.effects.joint_stops(-0.9, 0.9, 1e4, 10.0), None, "auto"),
    "sticks": ([rd.effects.DryFriction(1.0, 1.2)], None, "auto"),
    "sampled": ((), rd.control.PD(rd.control.hold(Q - 0.3), kp=40.0, kd=4.0, period_s=0.01), "auto"),
    "declared by a user": ([Declared(1.5)], None, "RK4"),
}


@pytest.mark.parametrize("name", SCENES)
def test_auto_takes_the_machine_code_that_is_there_and_both_engines_agree_within_the_estimate(name, tmp_path) -> None:
    effects, controller, integrator = SCENES[name]
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, 0.5, controller, integrator, record_every_s=0.05)
    interpreted = rd.simulate(setup, engine="interpreted")
    compiled, auto = rd.simulate(setup, engine="compiled"), rd.simulate(setup)
    assert auto.statistics.engine == compiled.statistics.engine
    assert f", {auto.statistics.engine}\n" in auto.summary
    assert rd.read(auto.save(tmp_path / "run")).statistics.engine == auto.statistics.engine
    assert np.array_equal(auto.q, compiled.q)
    assert interpreted.error is not None and auto.error is not None
    within = interpreted.error.largest + auto.error.largest
    assert np.abs(auto.q - interpreted.q).max() <= within


def test_auto_has_machine_code_for_other_coefficients_and_none_for_another_structure(monkeypatch) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    base = rd.Setup(rd.Plant(ARM, [rd.effects.Spring(3.0)]), Q, V, 0.2, method="RK4", estimate_error=False)
    rd.simulate(base, engine="compiled")
    assert rd.simulate(replace(base, plant=rd.Plant(ARM, [rd.effects.Spring(5.0)]))).statistics.engine == "compiled"
    other = rd.Plant(ARM.with_(mass_scale=1.07), [rd.effects.Spring(5.0)])
    engine = rd.simulate(replace(base, plant=other)).statistics.engine
    assert engine == "interpreted (the run is too short to compile)"


class _Stiff:
    """PD with gravity compensation of a UR5, light wrists under gains of a thousand."""

    arm = rd.load("ur5")
    start = np.array([0.0, -1.2, 1.5, -0.3, 0.5, 0.0])
    plan = rd.control.quintic(start, start + np.array([1.0, 0.6, -0.7, -0.6, 0.5, 0.6]), duration_s=1.5)
    kp, kd = np.array([900.0, 900.0, 600.0, 100.0, 100.0, 50.0]), np.array([150.0, 150.0, 90.0, 15.0, 12.0, 4.0])


def test_a_smooth_function_that_declares_nothing_is_not_said_to_act_between_steps() -> None:
    """Between steps its torque is looked at where the joints are, not on straight lines between the ends."""

    def follows(t, q, v):
        q_d, v_d, _ = _Stiff.plan.at(t)
        return _Stiff.kp * (q_d - q) + _Stiff.kd * (v_d - v) + _Stiff.arm.N(q)

    def without_velocity(t, q, v):
        return _Stiff.kp * (_Stiff.plan.at(t)[0] - q) - _Stiff.kd * v + _Stiff.arm.N(q)

    for law in (follows, without_velocity):
        run = rd.simulate(_Stiff.arm, _Stiff.start, duration_s=0.6, controller=law, record_every_s=0.01)
        assert "acts between steps" not in str(run.error) and run.error.largest < 1e-9


def test_models_of_ones_own_controller_have_the_right_angles_of_the_machine_code() -> None:
    """Where control and gravity cancel, 5e-12 rad of the file would show."""

    @dataclass(frozen=True, eq=False)
    class Law(rd.control.Stateless):
        plan: rd.control.PiecewisePolynomial
        model: rd.Robot
        n, thresholds = 6, lambda self: ()

        def torque(self, t, q, v, z):
            q_d, v_d, _ = self.plan.at(t)
            return _Stiff.kp * (q_d - q) + _Stiff.kd * (v_d - v) + self.model.N(q)

    options = {"duration_s": 0.5, "record_every_s": 0.01, "engine": "compiled", "estimate_error": False}
    run = rd.simulate(_Stiff.arm, _Stiff.start, controller=Law(_Stiff.plan, _Stiff.arm), **options)
    built_in = rd.control.PDGravity(_Stiff.arm, _Stiff.plan, kp=_Stiff.kp, kd=_Stiff.kd)
    same = rd.simulate(_Stiff.arm, _Stiff.start, controller=built_in, **options)
    assert run.statistics.engine == "compiled" and np.abs(run.q - same.q).max() < 1e-12


METHODS = ("RK4", "GaussLegendre4", "DOP853")
KINDS = (
    rd.control.Controller,
    rd.control.Stateless,
    rd.effects.Conservative,
    rd.effects.Dissipative,
    rd.effects.Active,
    rd.effects.Bound,
)


class LateError(Exception):
    """An exception of a user's own."""


@dataclass(frozen=True, eq=False)
class Fails:
    """Raises the error from a time on."""

    error: type[Exception]
    after: float = 0.05

    def _maybe(self, t: float, value: Any) -> Any:
        if t > self.after:
            raise self.error("own")
        return value


class FailingForce(Fails, rd.effects.Active):
    def torque(self, dynamics, t, q, v):
        return self._maybe(t, 0.1 * v)


class FailingPotential(Fails, rd.effects.Conservative):
    def torque(self, dynamics, t, q, v):
        return 0 * v

    def potential(self, dynamics, t, q):
        return self._maybe(float(np.max(t)), 0.0 * q[..., 0])


class FailingBound(rd.effects.Bound):
    def actuation(self, u):
        if u[0] > 0.05:
            raise LateError("own")
        return u


class FailingController(Fails, rd.control.Controller):
    n, state_size = 2, 1

    def torque(self, t, q, v, z):
        return np.array([t, z[0]])

    def state_rate(self, t, q, v, z):
        return self._maybe(t, np.ones(1))


class FailingSampled(FailingController):
    period_s = 0.01


def ramp(t, q, v):
    return np.array([t, 0.0])


def fails(t, q, v):
    return Fails(LateError)._maybe(t, 0 * v)


ERRORS = (TypeError, ValueError, LateError, ZeroDivisionError, KeyError)
PARTS = [
    *((f"torque of {error.__name__}", "torque of failing_force", {"effects": [FailingForce(error)]})
      for error in ERRORS),
    ("potential", "potential of failing_potential", {"effects": [FailingPotential(LateError)]}),
    ("bound", "actuation of failing_bound", {"effects": [FailingBound()], "controller": ramp}),
    ("states", "state_rate of FailingController", {"controller": FailingController(ValueError)}),
    ("sampled", "next_state of FailingSampled", {"controller": FailingSampled(TypeError)}),
    ("function", "torque of fails", {"controller": fails}),
]  # fmt: skip


@pytest.mark.parametrize(("named", "parts"), [x[1:] for x in PARTS], ids=[x[0] for x in PARTS])
@pytest.mark.parametrize("integrator", METHODS)
def test_an_exception_of_a_users_code_reaches_the_user_with_its_line_and_the_parts_name(
    named, parts, integrator
) -> None:
    plant = rd.Plant(ARM, parts.get("effects", ()))
    setup = rd.Setup(plant, Q, V, 0.2, parts.get("controller"), integrator, engine="interpreted")
    with pytest.raises(ERRORS, match="own") as caught:
        rd.simulate(setup)
    assert not isinstance(caught.value, rd.RobotDynError)
    assert caught.value.__notes__ == [f"in {named}"]
    assert Path(caught.traceback[-1].path).name == Path(__file__).name


@pytest.mark.parametrize("error", [TypeError, ValueError, LateError])
def test_an_exception_at_the_start_and_in_a_query_is_the_users(error: type[Exception]) -> None:
    plant = rd.Plant(ARM, [FailingForce(error, -1.0)])
    for ask in (lambda: rd.Setup(plant, Q), lambda: plant.torque(Q, V, t=0.0), lambda: plant.N(Q, V, t=0.0)):
        with pytest.raises(error, match="own"):
            ask()


class Mistaken(rd.control.Stateless):
    n, period_s = 2, 0.0

    def __init__(self, period_s: float) -> None:
        self.period_s = period_s

    def torque(self, t, q, v, z):
        return ARM.N(q) if t < 0.05 else ARM.N(q[:1])


@pytest.mark.parametrize("period_s", [0.0, 0.01])
@pytest.mark.parametrize("integrator", METHODS)
def test_what_the_library_refuses_a_users_code_is_no_divergence(period_s: float, integrator) -> None:
    setup = rd.Setup(rd.Plant(ARM), Q, V, 0.2, Mistaken(period_s), integrator)
    with pytest.raises(QueryError, match=r"q must have shape .* got \(1,\)"):
        rd.simulate(setup)


def test_an_overflow_in_a_users_code_is_an_outcome_of_the_run() -> None:
    def runaway(t, q, v):
        return ARM.inverse_dynamics(q, v, 1e4 * v)

    run = rd.simulate(ARM, Q, V, duration_s=0.2, controller=runaway, method="RK4")
    assert run.outcome.ending == "diverged" and len(run.t) > 1


def test_a_torque_of_a_wrong_shape_is_an_error_of_the_library() -> None:
    class Wide(rd.effects.Active):
        def torque(self, dynamics, t, q, v):
            return np.ones(3)

    class States(FailingController):
        def state_rate(self, t, q, v, z):
            return np.ones(2)

    with pytest.raises(EffectError, match="wide does not fit 2 joints"):
        rd.Plant(ARM, [Wide()]).torque(Q, V, t=0.0)
    broken, plant = rd.effects.ViscousFriction(0.1), rd.Plant(ARM)
    object.__setattr__(broken, "viscous", np.ones(3))
    object.__setattr__(plant, "effects", (broken,))
    with pytest.raises(EffectError, match="viscous_friction does not fit"):
        plant.torque(Q, V, t=0.0)
    with pytest.raises(ControlError, match=r"States.state_rate returned shape \(2,\) for 1 state"):
        rd.Setup(rd.Plant(ARM), Q, controller=States(LateError))


def opaque(t, q, v):
    return np.array([float(v[0]), 0.0])


class Opaque(rd.effects.Active):
    def torque(self, dynamics, t, q, v):
        table = np.array([0.1, 0.2])
        return table[int(q[0])] * v


class Raises(rd.control.Stateless):
    n = 2

    def torque(self, t, q, v, z):
        if abs(v[0]) > 100.0:
            raise LateError("too fast")
        return -v


@pytest.mark.parametrize(
    ("effects", "controller", "part", "code", "why"),
    [
        ((), opaque, "controller opaque", opaque.__code__, "TypeError"),
        ([Opaque()], None, "effect opaque", Opaque.torque.__code__, "TypeError"),
        ((), Raises(), "controller Raises", Raises.torque.__code__, "LateError: too fast"),
    ],
    ids=["function", "effect", "a branch that raises"],
)
def test_what_cannot_be_traced_says_which_line_stopped_it(effects, controller, part, code, why) -> None:
    line = code.co_firstlineno + (1 if code is opaque.__code__ else 2)
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, 0.1, controller, engine="compiled", method="RK4")
    with pytest.raises(
        TraceError, match=rf"{part} cannot be compiled \(line {line} of test_declarations.py: {why}"
    ) as caught:
        rd.simulate(setup)
    assert caught.value.__cause__ is not None  # with its traceback
    if effects:
        with pytest.raises(TraceError, match=rf"cannot be compiled \(line {line} of test_declarations.py"):
            rd.compiled(setup.plant, cache=False).torque(Q, V, t=0.0)


def test_a_function_is_the_controller_of_the_same_law() -> None:
    def law(t, q, v):
        return 4.0 * (Q - 0.2 - q) - 1.5 * v

    pd = rd.control.PD(rd.control.hold(Q - 0.2), kp=4.0, kd=1.5)
    setup = rd.Setup(rd.Plant(ARM), Q, V, 0.1, pd, "RK4", engine="interpreted")
    run = rd.simulate(ARM, Q, V, duration_s=0.1, controller=law, method="RK4")
    assert np.array_equal(run.q, rd.simulate(setup).q)
    assert run.statistics.engine.startswith("interpreted (law declares no thresholds: give a class")
    compiled = rd.simulate(setup, controller=law, engine="compiled")
    assert compiled.statistics.engine == "compiled"
    np.testing.assert_allclose(compiled.q, run.q, rtol=0, atol=1e-13)  # rounding of 100 steps of states of size 1


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (lambda q, v: q, r"\(q, v\): give a function of \(t, q, v\)"),
        (lambda t, q, v: 0.0, r"returned shape \(\) for 2 joints"),
        (lambda t, q, v: None, "returned"),
        (lambda t, q, v: q * np.nan, "returned nan"),
    ],
)
def test_a_function_that_is_no_controller_is_refused(law, said: str) -> None:
    with pytest.raises(ControlError, match=said):
        rd.Setup(rd.Plant(ARM), Q, controller=law)
    with pytest.raises(QueryError, match="controller"):
        rd.Setup(rd.Plant(ARM), Q, controller=rd.control.PD)  # a class is not a function of (t, q, v)


@pytest.mark.parametrize("engine", [*long(["interpreted"]), "compiled"])
@pytest.mark.parametrize("period_s", [0.0, 0.01])
@pytest.mark.parametrize("canonical", [False, True])
def test_recorded_controller_states_obey_their_equation(
    engine: str, period_s: float, canonical: bool, tmp_path
) -> None:
    """dz/dt = ki e without a limit; sampled, z⁺ = z + T ki e at each tick, exactly."""
    ki = 3.0
    pid = rd.control.PID(rd.control.hold(Q - 0.2), kp=8.0, ki=ki, kd=2.0, period_s=period_s)
    method = "GaussLegendre4" if canonical else "RK4"
    run = rd.simulate(rd.Plant(ARM), q0=Q, v0=V, duration_s=0.2, controller=pid, engine=engine, method=method)
    z, e = run.controller_states, Q - 0.2 - run.q
    assert z is not None and z.shape == (len(run.t), 2)
    if period_s:
        ticks = np.flatnonzero(np.isclose(run.t / period_s, np.rint(run.t / period_s), rtol=0, atol=1e-9))[:-1]
        expected = np.cumsum(period_s * ki * e[ticks], axis=0)
        np.testing.assert_allclose(z[ticks], expected, rtol=0, atol=1e-14)
        assert np.array_equal(z[ticks], z[ticks + 1])  # constant between ticks
    else:  # the trapezoid rule: T h² e'' ki / 12 with |e''| < 50 rad/s²
        steps = np.diff(run.t)[:, None] * (e[1:] + e[:-1]) / 2 * ki
        np.testing.assert_allclose(z[1:], np.cumsum(steps, axis=0), rtol=0, atol=0.2 * 1e-6 * 50 * ki / 12)
    again = rd.read(run.save(tmp_path / "run"))
    assert np.array_equal(again.controller_states, z)  # pyright: ignore[reportArgumentType]
    rows = again.save(tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].endswith("controller state 1,controller state 2")
    assert [float(x) for x in rows[-1].split(",")[-2:]] == z[-1].tolist()


def test_without_controller_states_nothing_is_recorded_of_them(tmp_path) -> None:
    run = rd.simulate(rd.Plant(ARM), q0=Q, duration_s=0.01, controller=ramp)
    assert run.controller_states is None
    assert rd.read(run.save(tmp_path / "run")).controller_states is None


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_interfaces_state_their_contract(kind: type) -> None:
    """Arguments with shapes and units, in the docstring or in that of the base that it names."""
    said = "\n".join(each.__doc__ or "" for each in kind.__mro__ if each.__module__.startswith("robot_dyn"))
    assert kind.__name__ in [*rd.effects.__all__, *rd.control.__all__]
    assert all(word in said for word in ("t: time", "q: position", "v: velocity", "in [s]", "[rad/s]", "symbols"))


class Drag(rd.effects.Dissipative):
    """τ = −c |v| v."""

    def __init__(self, c: Any, on: bool = True) -> None:
        self.c, self.on_ = c, on

    def torque(self, dynamics, t, q, v):
        return -self.c * abs(v) * v if self.on_ else 0 * v


SCENE = 'robot = "planar_2r"\nduration_s = 0.1\n[start]\nq = [0.4, -0.7]\nv = [0.3, 0.9]\n'


@pytest.mark.parametrize(
    ("keys", "c"),
    [*long([("c = 2", 2.0), ("c = [2.0, 3]", np.array([2.0, 3.0]))]), ("c = {joint_2 = 3.0}", np.array([0.0, 3.0]))],
)
def test_a_scene_names_effects_that_its_reader_names(keys: str, c: Any, tmp_path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(f'{SCENE}[[effect]]\nkind = "gravity"\n[[effect]]\nkind = "drag"\n{keys}\n', encoding="utf-8")
    own = rd.read_scene(path, effects={"drag": Drag})
    setup = rd.Setup(rd.Plant(ARM, [Drag(c)]), Q, V, 0.1, method=rd.integrate.Adaptive(rtol=1e-10, atol=1e-12))
    expected = rd.simulate(setup, record_every_s=0.01, engine="interpreted")
    assert np.array_equal(rd.simulate(own).q, expected.q)
    with pytest.raises(SceneError, match=r"line 8: effect 2 \(drag\).kind: no kind 'drag'"):
        rd.read_scene(path)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("", r"effect 1 \(drag\).c: is missing; give it"),
        ("c = 1.0\nd = 2.0", r"effect 1 \(drag\).d: unknown key; known: kind, c, on"),
        ("c = 1.0\nargument_0 = 2.0", r"effect 1 \(drag\).argument_0: unknown key"),
        ("c = 1" + "0" * 400, "c must be .* too large for a float"),
        ("c = inf", "c must be"),
        ("c = {elbow = 1.0}", "elbow"),
    ],
)
def test_wrong_keys_of_an_effect_of_a_users_own_are_told(keys: str, said: str, tmp_path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(f'{SCENE}[[effect]]\nkind = "drag"\n{keys}\n', encoding="utf-8")
    with pytest.raises(SceneError, match=said):
        rd.read_scene(path, effects={"drag": Drag})
    with pytest.raises(SceneError, match="the kind 'spring' exists already"):
        rd.read_scene(path, effects={"spring": Drag})


def test_arguments_of_an_effect_of_a_users_own_have_any_names(tmp_path) -> None:
    """Those of pydantic, too: each reaches the factory as a float; a wrong value is told by its key."""
    path, got = tmp_path / "scene.toml", list[Any]()
    expected = {name: k + 2.0 for k, name in enumerate([*dir(DeclaredEffect), "self", "argument_0", "_c", "__c__"])}
    passed = ", ".join(f"{name!r}: {name}" for name in expected)

    def of_any(**given: Any) -> Drag:
        got.append(given)
        return Drag(0.1)

    of_each = eval(f"lambda {', '.join(expected)}: of_any(**{{{passed}}})", {"of_any": of_any})
    for factory in (of_each, of_any):
        text = "".join(f"{name} = {value:.0f}\n" for name, value in expected.items())
        path.write_text(f'{SCENE}[[effect]]\nkind = "own"\n{text}', encoding="utf-8")
        rd.read_scene(path, effects={"own": factory})
        path.write_text(path.read_text(encoding="utf-8").replace("\ncopy = ", "\ncopy = nan # "), encoding="utf-8")
        with pytest.raises(SceneError, match=r"scene\.toml: line 6: .*: copy must be"):
            rd.read_scene(path, effects={"own": factory})
    assert got == [expected, expected] and {type(value) for given in got for value in given.values()} == {float}


@pytest.mark.parametrize("factory", [lambda kind: Drag(kind), lambda c, /: Drag(c)], ids=["kind", "by position"])
def test_an_argument_that_cannot_be_a_key_of_a_scene_needs_a_default(factory: Any, tmp_path) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    with pytest.raises(SceneError, match=r"'(kind|c)' of 'own' cannot be a key"):
        rd.read_scene(path, effects={"own": factory})


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        (
            {"controller": rd.control.ControlLaw(lambda t, q, v: ARM.N(q), len(Q))},
            "make it an attribute of a rd.control.S",
        ),
        ({"events": [rd.Event(lambda t, q, v: ARM.total_energy(q, v))]}, "use engine='interpreted'"),
    ],
    ids=["controller", "event"],
)
def test_an_arm_inside_a_function_is_named_as_what_cannot_be_traced(options, remedy) -> None:
    with pytest.raises(TraceError, match=rf"a robot inside a function cannot be traced[:;] {remedy}"):
        rd.simulate(rd.Plant(ARM), Q, duration_s=0.1, engine="compiled", **options)


def test_the_example_of_a_controller_can_be_swept_and_is_compiled() -> None:
    """The one of `help(rd.control.Stateless)`: gravity and damping are compensated, so that a motion at rest stays."""
    text = str(rd.control.Stateless.__doc__)
    names: dict[str, Any] = {"rd": rd, "dataclass": dataclass, "field": field}
    exec(dedent(text[text.index("        @dataclass") :]), names)
    setup = rd.Setup(rd.Plant(ARM), Q, duration_s=0.1, controller=names["Damped"](ARM, 3.0), engine="compiled")
    assert "damping" in repr(rd.parameters(setup))
    run = rd.simulate(setup)
    assert run.statistics.engine == "compiled"
    assert np.abs(run.q[-1] - Q).max() < 1e-12
