"""Options of a run: simulate and rollouts take the same, show them, and refuse what has no effect."""

from __future__ import annotations

from dataclasses import replace
from inspect import Parameter, signature
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.simulation.setup.options import Options
from tests.own_method import OwnImplicit

ARM = rd.load("planar_2r")
PLANT = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
Q, V = np.array([0.3, -0.4]), np.array([0.2, 0.5])
OPTIONS: dict[str, Any] = {
    "duration_s": 0.05, "controller": rd.control.PD(rd.control.hold([0.1, 0.2]), kp=[20.0, 9.0], kd=2.0),
    "method": "RK4", "step_s": 2e-3, "record_every_s": 0.01, "metadata": {"author": "me"},
}  # fmt: skip


@pytest.mark.parametrize("function", [rd.simulate, rd.rollouts])
def test_the_signature_shows_every_attribute_of_a_setup_with_its_default(function) -> None:
    shown, stated = signature(function).parameters, signature(rd.Setup).parameters
    tolerances = {"rtol", "atol"}
    assert Options.__annotations__.keys() == stated.keys() - {"plant", "q0", "v0"} | tolerances
    for name in tolerances:
        assert (shown[name].kind, shown[name].default) == (Parameter.KEYWORD_ONLY, None)
    for name in Options.__annotations__.keys() - tolerances:
        assert shown[name].kind is Parameter.KEYWORD_ONLY
        built = {} if name == "metadata" else stated[name].default  # of the factory, which says nothing
        assert shown[name].default == built, name
    assert list(shown)[:3] == ["system", "q0", "v0"]
    assert not any(each.kind is Parameter.VAR_KEYWORD for each in shown.values())


def test_a_robot_a_plant_and_a_setup_give_the_same_run() -> None:
    setup = rd.Setup(PLANT, Q, V, **OPTIONS)
    runs = [
        rd.simulate(setup, engine="interpreted"),
        rd.simulate(PLANT, Q, V, **OPTIONS, engine="interpreted"),
        rd.simulate(
            replace(setup, duration_s=9.0, method="GaussLegendre2", step_s=0.1), engine="interpreted", **OPTIONS
        ),
    ]
    bare = [rd.simulate(each, q0=Q, v0=V, **OPTIONS, engine="interpreted") for each in (ARM, rd.Plant(ARM))]
    for same in (runs, bare):
        for run in same[1:]:
            np.testing.assert_array_equal(run.q, same[0].q)
            np.testing.assert_array_equal(run.u, same[0].u)
            assert run.metadata["author"] == "me"


@pytest.mark.parametrize("method", ["auto", "DOP853", rd.integrate.Adaptive("Rodas5P", atol=1e-3)], ids=str)
@pytest.mark.parametrize(
    "what", [ARM, PLANT, rd.Setup(PLANT, Q, V, method="RK4", step_s=1e-3)], ids=lambda x: type(x).__name__
)
def test_tolerances_of_a_call_are_those_of_its_method(what, method) -> None:
    built = replace(method if isinstance(method, rd.integrate.Adaptive) else rd.integrate.Adaptive(method), rtol=1e-7)
    options: dict[str, Any] = {"duration_s": 0.05, "estimate_error": False, "engine": "interpreted"}
    expected = rd.simulate(what, Q, V, method=built, **options)
    for _ in range(2):  # the second call takes the setup of the first
        run = rd.simulate(what, Q, V, method=method, rtol=1e-7, **options)
        np.testing.assert_array_equal(run.q, expected.q)
    finer = rd.simulate(what, Q, V, method=method, rtol=1e-12, atol=1e-13, **options)
    assert finer.statistics.steps > run.statistics.steps


def test_tolerances_alone_change_those_of_the_method_of_a_setup() -> None:
    setup = rd.Setup(PLANT, Q, V, 0.05, method=rd.integrate.Adaptive("Rodas5P", 1e-3, 1e-5), engine="interpreted")
    run = rd.rollouts(setup, [Q, Q], atol=1e-9)
    expected = rd.rollouts(replace(setup, method=rd.integrate.Adaptive("Rodas5P", 1e-3, 1e-9)), [Q, Q])
    np.testing.assert_array_equal(run.q, expected.q)


def test_rollouts_take_the_same() -> None:
    setup, q0 = rd.Setup(PLANT, Q, V, **OPTIONS), Q + 0.1 * np.arange(6.0).reshape(3, 2)
    expected = rd.rollouts(setup, q0, record=("q", "v", "u"))
    other = replace(setup, duration_s=9.0, method="DOP853", step_s=None)
    for made in (
        rd.rollouts(PLANT, q0, V, record=("q", "v", "u"), **OPTIONS),
        rd.rollouts(other, q0=q0, record=("q", "v", "u"), **OPTIONS),
    ):
        np.testing.assert_array_equal(made.q, expected.q)
        np.testing.assert_array_equal(made.u, expected.u)
    one = rd.rollouts(ARM, Q, **OPTIONS)
    assert one.q is not None and one.q.shape == (1, 6, 2)
    np.testing.assert_array_equal(one.q[0, 0], Q)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: rd.simulate(ARM, Q, duration=1.0), r"simulate: no option 'duration'; nearest: duration_s"),
        (lambda: rd.simulate(rd.Setup(PLANT, Q), duration=1.0), r"simulate: no option 'duration'; nearest: duration_s"),
        (lambda: rd.rollouts(ARM, Q, duration=1.0), r"rollouts: no option 'duration'; nearest: duration_s"),
        (lambda: rd.simulate(ARM, Q, method="RK4", rtol=1e-12), "rtol: no effect on RK4, .* step_s"),
        (lambda: rd.rollouts(ARM, Q, method="RK4", atol=1e-12), "atol: no effect on RK4, .* step_s"),
        (lambda: rd.simulate(rd.Setup(PLANT, Q, method="Euler"), rtol=1e-9, atol=1e-9), "rtol and atol: .* Euler"),
        (lambda: rd.simulate(ARM, Q, rtol=1e-16), "rtol must be between"),
        (lambda: rd.simulate(ARM, Q, accuracy=1e-6, rtol=1e-8), "leave out method, rtol and atol"),
        (lambda: rd.simulate(ARM, plant=PLANT, q0=Q), "simulate: no option 'plant'"),
        (lambda: rd.simulate(ARM, duration_s=1.0), r"simulate: give q0, the position at the start, of shape \(2,\)"),
        (lambda: rd.rollouts(ARM, method="RK4"), r"rollouts: give q0, the position at the start, of shape \(2,\)"),
        (lambda: rd.rollouts(ARM, np.zeros((0, 2)), method="RK4"), "the same number of runs"),
        (
            lambda: rd.rollouts(ARM, Q, method="RK4", events=[rd.Event(lambda t, q, v: v[0])], uncut=True),
            "uncut: steps end at events, so the runs are not in lock step",
        ),
        (lambda: rd.rollouts(ARM, Q, uncut=True), "uncut: DOP853 chooses its steps"),
        (lambda: rd.rollouts(ARM, Q, method="RK4", uncut="no"), "uncut must be True or False, got 'no'"),
        (
            lambda: rd.rollouts(rd.Setup(PLANT, Q, accuracy=1e-6)),
            r"accuracy has no effect, simulate one of the runs.*dataclasses.replace\(setup, accuracy=None\)",
        ),
        (
            lambda: rd.rollouts(ARM, Q, method=OwnImplicit()),
            "own_implicit, .*: give method='RK4' and its step_s",
        ),
        (lambda: rd.rollouts(ARM, Q, estimate_error=True), "estimate_error has no effect, simulate one of the runs"),
        (lambda: rd.simulate(ARM, Q, step_s=2e-3), "step_s has no effect on auto, .* method='RK4'"),
        (lambda: rd.simulate(ARM, Q, step_s=1e-3), "step_s has no effect on auto"),
        (lambda: rd.simulate(rd.Setup(PLANT, Q), step_s=1e-3), "step_s has no effect on auto"),
        (lambda: rd.simulate(ARM, Q, accuracy=1e-6, step_s=1e-3), "step_s has no effect on auto"),
        (
            lambda: rd.Setup(PLANT, Q, method="DOP853", step_s=1e-3),
            r"step_s has no effect on DOP853, .* rd.integrate.Adaptive\(max_step_s=…\)",
        ),
        (lambda: rd.simulate(ARM, Q, method="RK4", step_s="1 ms"), "step_s must be a real number"),
        (lambda: rd.simulate(ARM, Q, method="Rodas5P", step_s=1e-3), "step_s has no effect on Rodas5P"),
        (lambda: rd.rollouts("ur5", Q), r"dynamics must be a robot, such as rd.load\('ur5'\)"),
    ],
)
def test_what_means_nothing_is_refused(ask, message: str) -> None:
    with pytest.raises(rd.RobotDynError, match=message):
        ask()


def test_a_step_that_was_not_given_is_one_millisecond_and_stands_in_the_way_of_no_other_method() -> None:
    setup = rd.Setup(PLANT, Q, duration_s=0.05, method="RK4", estimate_error=False)
    assert setup.taken_step_s == pytest.approx(1e-3, rel=1e-12)
    assert rd.simulate(replace(setup, method="DOP853")).statistics.method == "DOP853"
    stepped = replace(setup, step_s=2e-3)  # a step for the other method
    assert rd.simulate(stepped, method="DOP853").statistics.step_s == 0


@pytest.mark.parametrize("dtype", [np.float32, np.dtype(np.float32), np.float64, np.dtype("f8")], ids=str)
def test_types_of_numpy_are_taken_where_their_names_are(dtype) -> None:
    name = np.dtype(dtype).name
    for what in (ARM, PLANT):
        given, named = (rd.compiled(what, dtype=each) for each in (dtype, name))
        assert given == named or what is PLANT
        x = Q.astype(dtype)
        answer = given.M(x)
        assert answer.dtype == np.dtype(dtype)
        np.testing.assert_array_equal(answer, named.M(x))


@pytest.mark.parametrize("dtype", [np.float16, np.int32, np.dtype(">f8"), None, Q, "f4", [("x", "f4")]], ids=str)
def test_other_types_are_refused(dtype) -> None:
    with pytest.raises(QueryError, match="no dtype"):
        rd.compiled(ARM, dtype=dtype)
