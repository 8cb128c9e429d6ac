"""The contract of fixed-step methods: tableaus, batches, every float, counted evaluations, quadratures."""

from __future__ import annotations

from dataclasses import FrozenInstanceError, replace
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from flint import arb

import robot_dyn as rd
from robot_dyn.foundations import Ball, QueryError
from robot_dyn.integrate import (
    FIXED_STEP,
    METHODS,
    ButcherTableau,
    ExplicitRungeKutta,
    GaussLegendre,
    Integrator,
    Surd,
    System,
    method,
)
from robot_dyn.integrate.integrator import arithmetic_like
from robot_dyn.scene import parse_scene

ALL = [method(name) for name in FIXED_STEP]
STIFF = [each for each in ALL if each.stiff]
ANY_ARITHMETIC = [each for each in ALL if not each.stiff]
RNG = np.random.default_rng(5)


def name_of(integrator: Integrator) -> str:
    return integrator.name


def pendulum(t: Any, y: np.ndarray) -> np.ndarray:
    """Driven by u = t/4, with the power as quadrature: q' = v, v' = −sin q − v/5 + u, w' = u v."""
    q, v = y[..., 0], y[..., 1]
    u = t / 4
    return np.stack([v, -np.sin(q) - v / 5 + u, u * v], axis=-1)


def oscillator(t: Any, y: np.ndarray) -> np.ndarray:
    return np.stack([y[..., 1], -y[..., 0]], axis=-1)


PENDULUM, OSCILLATOR = System(pendulum, 1), System(oscillator, 1)


def test_tableau_is_checked_when_it_is_made() -> None:
    half = Fraction(1, 2)
    assert ButcherTableau(((), (half,)), (0, 1), (0, half), 2) == ButcherTableau(((), (half,)), (0, 1), (0, half), 2)
    with pytest.raises(QueryError, match=r"sum of b must be 1\.0, got 1\.5"):
        ButcherTableau(((), (half,)), (half, 1), (0, half), 2)
    with pytest.raises(QueryError, match=r"sum of a\[1\] must be 0.75, got 0.5"):
        ButcherTableau(((), (half,)), (0, 1), (0, 0.75), 2)
    with pytest.raises(QueryError, match="2 nodes and rows of up to 2 entries"):
        ButcherTableau(((),), (0, 1), (0, half), 2)
    with pytest.raises(QueryError, match="sum of b"):
        ButcherTableau(((),), (float("nan"),), (0,), 1)
    with pytest.raises(QueryError, match="order must be positive"):
        ButcherTableau(((),), (1,), (0,), 0)


def test_an_engine_refuses_a_tableau_it_cannot_run() -> None:
    implicit = ButcherTableau(((1,),), (1,), (1,), 1)
    with pytest.raises(QueryError, match="up to i entries"):
        ExplicitRungeKutta("wrong", implicit)
    with pytest.raises(QueryError, match="must be 2, 4 or 6"):
        GaussLegendre(3)


def test_methods_are_values() -> None:
    assert GaussLegendre(4) == GaussLegendre(4)
    rk4 = method("RK4")
    assert hash(rk4) == hash(replace(rk4))
    with pytest.raises(FrozenInstanceError):
        rk4.name = "other"  # pyright: ignore[reportAttributeAccessIssue]


def test_a_surd_is_as_fine_as_its_arithmetic() -> None:
    """Gauss nodes x = 1/2 ± √3/6 satisfy 6 x² − 6 x + 1 = 0, to the rounding of each kind of number."""
    tableau = ButcherTableau(
        ((Surd(Fraction(1, 2), Fraction(1, 6), 3),),), (1,), (Surd(Fraction(1, 2), Fraction(1, 6), 3),), 1
    )
    for kind in (np.float32, np.float64, np.longdouble):
        x = tableau.arrays(arithmetic_like(np.zeros(1, kind))).c[0]
        assert type(x) is kind
        assert abs(6 * x * x - 6 * x + 1) <= 8 * np.finfo(kind).eps
    with Ball(300).scope():
        x = tableau.arrays(Ball(300)).c[0]
        assert (6 * x * x - 6 * x + 1).contains(arb(0))
        assert float(x.rad()) < 1e-85


def test_names_and_traits_of_the_table() -> None:
    assert {each.name for each in ALL} == set(FIXED_STEP)
    assert {each.name for each in ALL if each.canonical} == {"GaussLegendre2", "GaussLegendre4", "GaussLegendre6"}
    assert {each.name for each in STIFF} == {"Rodas5PFixed"}


@pytest.mark.parametrize("integrator", ALL, ids=name_of)
def test_batch_equals_one_at_a_time(integrator: Integrator) -> None:
    """Iterations of a batch end together, so some run a round longer: a few roundings of stages, 1e-14 allows them."""
    y = RNG.normal(size=(2, 3, 3))
    got = integrator.step(PENDULUM, 0.3, y, 0.05)
    single = [[integrator.step(PENDULUM, 0.3, each, 0.05) for each in row] for row in y]
    np.testing.assert_allclose(got, single, rtol=1e-14, atol=1e-14)


@pytest.mark.parametrize("integrator", ALL, ids=name_of)
def test_inputs_are_left_alone_and_the_result_is_fresh(integrator: Integrator) -> None:
    y = RNG.normal(size=3)
    before = y.copy()
    y.setflags(write=False)
    got = integrator.step(PENDULUM, 0.3, y, 0.05)
    assert np.array_equal(y, before)
    assert got.flags.writeable
    assert not np.shares_memory(got, y)
    assert np.array_equal(got, integrator.step(PENDULUM, 0.3, y, 0.05))  # no state is left from the first


@pytest.mark.parametrize(
    ("integrator", "kind"),
    [*((each, np.float32) for each in ALL), *((each, np.longdouble) for each in ANY_ARITHMETIC)],
)
def test_a_float_stays_of_its_kind(integrator: Integrator, kind: Any) -> None:
    """And agrees with float64 to its rounding, or to that of float64."""
    y = RNG.normal(size=3).astype(np.float32).astype(kind)
    got = integrator.step(PENDULUM, kind(0.25), y, 0.05)
    assert got.dtype == kind
    bounds = {"atol": 1e-5} if kind is np.float32 else {"rtol": 1e-14, "atol": 1e-15}
    np.testing.assert_allclose(got.astype(float), integrator.step(PENDULUM, 0.25, y.astype(float), 0.05), **bounds)


@pytest.mark.parametrize("integrator", ALL, ids=name_of)
def test_a_state_of_integers_is_refused(integrator: Integrator) -> None:
    with pytest.raises(QueryError, match="float32"):
        integrator.step(OSCILLATOR, 0.0, np.array([1, 0]), 0.1)


@pytest.mark.parametrize("integrator", STIFF, ids=name_of)
def test_implicit_methods_say_which_floats_they_take(integrator: Integrator) -> None:
    states = [Ball().array([1, 0])] + [np.ones(2, np.longdouble)] * (not integrator.plain)
    for y in states:
        if y.dtype != np.float64:
            with pytest.raises(QueryError, match="supports float"):
                integrator.step(OSCILLATOR, 0.0, y, 0.1)


@pytest.mark.parametrize("integrator", [each for each in ALL if each.evaluations_per_step], ids=name_of)
def test_evaluations_are_as_declared(integrator: Integrator) -> None:
    calls: list[Any] = []

    def counted(t: Any, y: np.ndarray) -> np.ndarray:
        calls.append(t)
        return pendulum(t, y)

    exact = System(pendulum, 1)
    system = System(counted, 1, exact=lambda t, y: exact.derivatives(t, y, t + 0.05))  # a Jacobian counts apart
    integrator.step(system, 0.3, RNG.normal(size=3), 0.05)
    assert len(calls) == integrator.evaluations_per_step


def test_only_iterative_methods_leave_their_evaluations_open() -> None:
    known = {each.name: each.evaluations_per_step for each in ALL if each.evaluations_per_step}
    assert known == {
        "Euler": 1, "SemiImplicitEuler": 1, "Midpoint": 2, "RK4": 4, "Rodas5PFixed": 8, "MoreauJean": 1,
        "DP8": 12,
    }  # fmt: skip


@pytest.mark.parametrize("integrator", ALL, ids=name_of)
def test_quadratures_integrate_power(integrator: Integrator) -> None:
    """E(t) − E(0) = ∫ u v dt for the undamped pendulum; the residual is of the method's order, 5 hᵖ over 2 s here."""

    def undamped(t: Any, y: np.ndarray) -> np.ndarray:
        return pendulum(t, y) + np.stack([0 * y[..., 1], y[..., 1] / 5, 0 * y[..., 1]], axis=-1)

    def energy(y: np.ndarray) -> Any:
        return y[1] ** 2 / 2 - np.cos(y[0])

    start, h = np.array([0.4, 0.7, 0.0]), 1 / 64
    y = start
    for i in range(128):
        y = integrator.step(System(undamped, 1), i * h, y, h)
    assert abs(energy(y) - energy(start) - y[2]) < 5 * h**integrator.order + 1e-13
    assert abs(y[2]) > 0.02


def test_one_list_of_names_serves_all_that_take_a_method() -> None:
    """Setup, and with it simulate and rollouts, scenes and rd.integrate.method."""
    plant = rd.Plant(rd.load("pendulum"))
    for name in METHODS:
        assert method(name).name == name
        assert rd.Setup(plant, [0.1], method=name).method.name == name
        text = f'robot = "pendulum"\nduration_s = 1.0\nmethod = "{name}"\n'
        assert parse_scene(text, "scene.toml").built_method().name == name
    with pytest.raises(QueryError, match="no integration method 'rk44'; nearest: RK4"):
        rd.Setup(plant, [0.1], method="rk44")
    with pytest.raises(QueryError, match=r"method: got 4; give a name, such as 'RK4' or 'DOP853'"):
        rd.Setup(plant, [0.1], method=4)


def test_scenes_and_python_have_the_same_defaults() -> None:
    scene = parse_scene('robot = "pendulum"\nduration_s = 1.0\n', "scene.toml")
    setup = rd.Setup(rd.Plant(rd.load("pendulum")), [0.1])
    assert scene.built_method() == setup.method == rd.integrate.Adaptive("auto")
    assert scene.step_s == setup.nominal_step_s
    for name in ("estimate_error", "engine"):
        assert getattr(scene, name) == getattr(setup, name), name
