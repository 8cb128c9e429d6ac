"""Effects and controllers written outside the library: their errors, their names and lines, their states, functions."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from textwrap import dedent
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import export
from robot_dyn.foundations import ControlError, EffectError, QueryError, SceneError, TraceError
from robot_dyn.scene.effects import DeclaredEffect
from tests.long import long

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, -0.7]), np.array([0.3, 0.9])
METHODS = ("rk4", "gauss_4", "DOP853")
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
    for ask in (lambda: rd.Setup(plant, Q), lambda: plant.torque(0.0, Q, V), lambda: plant.N(0.0, Q, V)):
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

    run = rd.simulate(ARM, Q, V, duration_s=0.2, controller=runaway, integrator="rk4")
    assert run.outcome.ending == "diverged" and len(run.t) > 1


def test_a_torque_of_a_wrong_shape_is_an_error_of_the_library() -> None:
    class Wide(rd.effects.Active):
        def torque(self, dynamics, t, q, v):
            return np.ones(3)

    class States(FailingController):
        def state_rate(self, t, q, v, z):
            return np.ones(2)

    with pytest.raises(EffectError, match="wide does not fit 2 joints"):
        rd.Plant(ARM, [Wide()]).torque(0.0, Q, V)
    broken, plant = rd.effects.ViscousFriction(0.1), rd.Plant(ARM)
    object.__setattr__(broken, "damping", np.ones(3))
    object.__setattr__(plant, "effects", (broken,))
    with pytest.raises(EffectError, match="viscous_friction does not fit"):
        plant.torque(0.0, Q, V)
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
    setup = rd.Setup(rd.Plant(ARM, effects), Q, V, 0.1, controller, engine="compiled", integrator="rk4")
    with pytest.raises(
        TraceError, match=rf"{part} cannot be compiled \(line {line} of test_user_code.py: {why}"
    ) as caught:
        rd.simulate(setup)
    assert caught.value.__cause__ is not None  # with its traceback
    if effects:
        with pytest.raises(TraceError, match=rf"cannot be compiled \(line {line} of test_user_code.py"):
            rd.Compiled(setup.plant, cache=False).torque(0.0, Q, V)


def test_a_function_is_the_controller_of_the_same_law() -> None:
    def law(t, q, v):
        return 4.0 * (Q - 0.2 - q) - 1.5 * v

    pd = rd.control.PD(rd.control.hold(Q - 0.2), 4.0, 1.5)
    setup = rd.Setup(rd.Plant(ARM), Q, V, 0.1, pd, "rk4", engine="interpreted")
    run = rd.simulate(ARM, Q, V, duration_s=0.1, controller=law, integrator="rk4")
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
    pid = rd.control.PID(rd.control.hold(Q - 0.2), 8.0, ki, 2.0, period_s=period_s)
    method = "gauss_4" if canonical else "rk4"
    run = rd.simulate(rd.Plant(ARM), q0=Q, v0=V, duration_s=0.2, controller=pid, engine=engine, integrator=method)
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
    again = rd.load_run(rd.save_run(run, tmp_path / "run"))
    assert np.array_equal(again.controller_states, z)  # pyright: ignore[reportArgumentType]
    rows = export(again, tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()
    assert rows[0].endswith("controller state 1,controller state 2")
    assert [float(x) for x in rows[-1].split(",")[-2:]] == z[-1].tolist()


def test_without_controller_states_nothing_is_recorded_of_them(tmp_path) -> None:
    run = rd.simulate(rd.Plant(ARM), q0=Q, duration_s=0.01, controller=ramp)
    assert run.controller_states is None
    assert rd.load_run(rd.save_run(run, tmp_path / "run")).controller_states is None


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
    setup = rd.Setup(rd.Plant(ARM, [Drag(c)]), Q, V, 0.1, integrator=rd.integrate.Adaptive(rtol=1e-10, atol=1e-12))
    expected = rd.simulate(setup, record_period_s=0.01, engine="interpreted")
    assert np.array_equal(rd.simulate(own).q, expected.q)
    with pytest.raises(SceneError, match=r"line 8: effect 2 \(drag\).kind: no kind 'drag'"):
        rd.read_scene(path)


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("", r"effect 1 \(drag\).c: is missing; give it"),
        ("c = 1.0\nd = 2.0", r"effect 1 \(drag\).d: is not a key here; known: kind, c, on"),
        ("c = 1.0\nargument_0 = 2.0", r"effect 1 \(drag\).argument_0: is not a key here"),
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
    with pytest.raises(SceneError, match="'spring' is a kind that scenes have"):
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
        ({"events": [rd.Event(lambda t, q, v: ARM.total_energy(q, v))]}, "take engine='interpreted'"),
    ],
    ids=["controller", "event"],
)
def test_an_arm_inside_a_function_is_named_as_what_cannot_be_traced(options, remedy) -> None:
    with pytest.raises(TraceError, match=rf"an arm inside a function cannot be traced[:;] {remedy}"):
        rd.simulate(rd.Plant(ARM), Q, duration_s=0.1, engine="compiled", **options)


def test_the_example_of_a_controller_can_be_swept_and_is_compiled() -> None:
    """The one of `help(rd.control.Stateless)`: gravity and damping are compensated, so that a motion at rest stays."""
    text = str(rd.control.Stateless.__doc__)
    names: dict[str, Any] = {"rd": rd, "dataclass": dataclass, "field": field}
    exec(dedent(text[text.index("        @dataclass") :]), names)
    setup = rd.Setup(rd.Plant(ARM), Q, duration_s=0.1, controller=names["Damped"](ARM, 3.0), engine="compiled")
    assert "damping" in repr(rd.sweepable(setup))
    run = rd.simulate(setup)
    assert run.statistics.engine == "compiled"
    assert np.abs(run.q[-1] - Q).max() < 1e-12
