"""A part earns machine code and "order seen" by what it declares, whoever wrote it; nothing is lost in silence."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import isabstract
from typing import Any, ClassVar

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Trajectory
from robot_dyn.control import Block, Controller
from robot_dyn.effects import Effect
from robot_dyn.foundations import EffectError, TraceError, tanh
from robot_dyn.simulation import MachineError, Verdict
from robot_dyn.simulation.diagnostics.smoothness import LOOKS
from robot_dyn.simulation.dynamics.declarations import undeclared
from robot_dyn.simulation.engine.choice import choose
from tests.effect_examples import EFFECTS, example

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.9])


def setup_of(part: Any, **options: Any) -> rd.Setup:
    """Of an effect or a controller."""
    effects, controller = ([part], None) if isinstance(part, Effect) else ((), part)
    steps = {"duration_s": 0.5, "integrator": "rk4", "step_s": 1e-3, "estimate_error": False}
    return rd.Setup(rd.Plant(ARM, effects), Q, V, controller=controller, **steps | options)


def run(part: Any, engine: str, **options: Any) -> Trajectory:
    return rd.simulate(setup_of(part, engine=engine, **options))


def engine_of(part: Any) -> str:
    """The engine that a run of six seconds takes, which is worth compiling."""
    setup = setup_of(part, duration_s=6.0)
    return choose(setup).label


@dataclass(frozen=True, eq=False)
class Drag(rd.effects.Dissipative):
    """τ = −c tanh(v): what is written outside of the library, and declared."""

    c: Any = field(metadata=rd.effects.coefficient("N m", symbol="c", least=0))

    def thresholds(self, n=0):
        return ()

    calls: ClassVar[int] = 0

    def torque(self, dynamics, t, q, v):
        Drag.calls += 1
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
    assert engine_of(Drag(2.0)) == "compiled"
    made = run(Drag(1.5), "auto", estimate_error=True)
    assert made.statistics.engine == "compiled" and made.error is not None
    assert made.error.verdict is Verdict.ORDER
    np.testing.assert_allclose(made.q, run(Drag(1.5), "interpreted").q, rtol=0, atol=1e-12)


def test_a_declared_effect_is_not_looked_at_between_steps_and_an_undeclared_one_is() -> None:
    counts = []
    for kind in (Drag, Silent):
        kind.calls = 0
        plant = rd.Plant(ARM, [kind(1.5)])
        made = rd.simulate(plant, Q, V, duration_s=0.3, engine="interpreted", record_period_s=0.1)
        counts.append(kind.calls - made.statistics.evaluations - made.statistics.companion_evaluations)
    assert made.error is not None and made.error.verdict is Verdict.BOUND
    assert "Silent declares no thresholds" in made.error.reason
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
    c: Any = field(default=2.0, metadata=rd.effects.coefficient("N m s/rad", least=0))

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
        ([Remembers()], None, "may change what its attribute 'memory' holds"),
        ((), Halved(), "does not declare whether its output jumps: define rounds"),
        ([Cached()], None, ""),
    ],
)
def test_what_may_change_unseen_is_not_declared(effects: Any, block: Any, said: str) -> None:
    pd = rd.control.PD(rd.control.hold(Q), 4.0, 1.0, period_s=0.01)
    controller = None if block is None else rd.control.Loop(pd, velocity=[block])
    found = undeclared(rd.Plant(ARM, effects), controller)
    assert [why for _, why in found] == [] if not said else said in found[0][1]
    if not block and not said:
        assert engine_of(effects[0]) == "compiled"


def test_what_follows_from_a_coefficient_is_not_kept_where_that_is_swept() -> None:
    """A cached property stayed what it was for the first run of a batch, and for other values of machine code."""
    setup = setup_of(Cached(1.0))
    rd.simulate(setup, engine="interpreted")  # which keeps c² = 1
    runs = rd.rollouts(setup, params={"cached.c": [1.0, 3.0]})
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
    sampled = rd.control.PD(rd.control.hold(Q), 4.0, 1.0, period_s=0.01)
    blocks = [rd.control.Noise(0.1), rd.control.LowPass(3.0), rd.control.Quantisation(0.1)]
    loop = rd.control.Loop(
        sampled,
        velocity=[rd.control.Differences(), *blocks],
        actuation=rd.control.RateLimit(1.0),
    )
    effects = [example(name) for name in EFFECTS]
    for controller in (
        loop,
        rd.control.PID(rd.control.hold(Q), 4.0, 1.0, 1.0),
        rd.control.FeedForward(ARM, rd.control.hold(Q), 4.0, 1.0),
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
    options = {"duration_s": 0.1, "integrator": "rk4", "estimate_error": False} | parts
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, **options)
    OWNED.stiffness = STATE["gain"] = 2.0
    rd.simulate(setup, engine="compiled")
    OWNED.stiffness = STATE["gain"] = 3.0
    for method in ("rk4", "DOP853"):
        with pytest.raises(MachineError, match=r"(changing|Law|crosses) differs from the interpreted one"):
            rd.simulate(setup, engine="compiled", integrator=method)
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

    def _answer(self, name: str, state: Any, out: Any, errors: str, frame: tuple[str, ...] = ()) -> Any:
        return ARM._answer(name, state, out, errors, frame) + (name == "N")


def test_equations_of_bodies_of_another_class_are_not_those_of_the_robot_in_it() -> None:
    with pytest.raises(TraceError, match="Windy comes from no robot's file"):
        rd.simulate(rd.Plant(Windy()), Q, V, engine="compiled", duration_s=0.1)  # pyright: ignore[reportArgumentType]


def test_a_compiled_plant_is_not_what_is_simulated() -> None:
    compiled: Any = rd.Compiled(rd.Plant(ARM))
    for asked in (rd.simulate, rd.rollouts):
        with pytest.raises(EffectError, match="got a CompiledPlant; pass the Plant itself, with engine='compiled'"):
            asked(compiled, Q)


SCENES = {
    "free": ((), None, "auto"),
    "friction": ([rd.effects.ViscousFriction(0.3), rd.effects.RegularisedCoulombFriction(0.4, 0.1)], None, "auto"),
    "stops": (rd.effects.joint_stops(-0.9, 0.9, 1e4, 10.0), None, "auto"),
    "sticks": ([rd.effects.DryFriction(1.0, 1.2)], None, "auto"),
    "sampled": ((), rd.control.PD(rd.control.hold(Q - 0.3), 40.0, 4.0, period_s=0.01), "auto"),
    "declared by a user": ([Drag(1.5)], None, "rk4"),
}


@pytest.mark.parametrize("name", SCENES)
def test_auto_takes_the_machine_code_that_is_there_and_both_engines_agree_within_the_estimate(name, tmp_path) -> None:
    effects, controller, integrator = SCENES[name]
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, 0.5, controller, integrator, record_period_s=0.05)
    interpreted = rd.simulate(setup, engine="interpreted")
    compiled, auto = rd.simulate(setup, engine="compiled"), rd.simulate(setup)
    assert auto.statistics.engine == compiled.statistics.engine
    assert f", {auto.statistics.engine}\n" in auto.summary
    assert rd.load_run(rd.save_run(auto, tmp_path / "run")).statistics.engine == auto.statistics.engine
    assert np.array_equal(auto.q, compiled.q)
    assert interpreted.error is not None and auto.error is not None
    within = interpreted.error.largest + auto.error.largest
    assert np.abs(auto.q - interpreted.q).max() <= within


def test_auto_has_machine_code_for_other_coefficients_and_none_for_another_structure(monkeypatch) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    base = rd.Setup(rd.Plant(ARM, [rd.effects.Spring(3.0)]), Q, V, 0.2, integrator="rk4", estimate_error=False)
    rd.simulate(base, engine="compiled")
    assert rd.simulate(replace(base, plant=rd.Plant(ARM, [rd.effects.Spring(5.0)]))).statistics.engine == "compiled"
    other = rd.Plant(ARM.with_(mass_scale=1.07), [rd.effects.Spring(5.0)])
    engine = rd.simulate(replace(base, plant=other)).statistics.engine
    assert engine == "interpreted (short: compiling is not worthwhile)"


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
        run = rd.simulate(_Stiff.arm, _Stiff.start, duration_s=1.2, controller=law, record_period_s=0.01)
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

    options = {"duration_s": 0.5, "record_period_s": 0.01, "engine": "compiled", "estimate_error": False}
    run = rd.simulate(_Stiff.arm, _Stiff.start, controller=Law(_Stiff.plan, _Stiff.arm), **options)
    built_in = rd.control.PDGravity(_Stiff.arm, _Stiff.plan, _Stiff.kp, _Stiff.kd)
    same = rd.simulate(_Stiff.arm, _Stiff.start, controller=built_in, **options)
    assert run.statistics.engine == "compiled" and np.abs(run.q - same.q).max() < 1e-12
