"""The contract of effects, and the plant that sums them: M a + C v + N(t, q, v) = τ."""

from __future__ import annotations

import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from flint import arb

import robot_dyn as rd
from robot_dyn import Plant
from robot_dyn.effects import Active, Bound, Conservative, Dissipative, Force, Stateful
from robot_dyn.foundations import QueryError
from robot_dyn.scene import BY_KIND
from tests.effect_examples import EFFECTS, arguments, example
from tests.user_parts import counted

ROBOT = rd.load("cart_pole")
B, F, V_S = np.array([0.7, 0.2]), np.array([1.4, 0.3]), np.array([0.05, 0.2])

K, Q0 = np.array([3.0, 0.4]), np.array([0.2, -0.5])
LOWER, UPPER = np.array([-0.3, -np.inf]), np.array([0.5, 0.9])
WRENCH = np.array([1.0, -2.0, 0.7, 0.3, 0.5, -0.4])


def pole(q: np.ndarray) -> np.ndarray:
    """J of the pole's frame of cart_pole, by hand: it sits on the hinge, which slides along x and turns about y."""
    J = np.zeros((*q.shape[:-1], 6, 2))
    J[..., 0, 0] = J[..., 4, 1] = 1.0
    return J


STRUT = {"point": [0.3, -0.2, 0.6], "other_point": [-0.7, 0.4, 0.9]}


def strut(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """ℓ and ∂ℓ/∂q of a line from a point of the pole to one of the world, by hand."""
    (x, y, z), c, s = STRUT["point"], np.cos(q[..., 1]), np.sin(q[..., 1])
    zero = np.zeros_like(c)
    line = np.stack([q[..., 0] + c * x + s * z, y + zero, c * z - s * x], axis=-1)
    line = line + ROBOT.placement(np.zeros(2), "pole")[:3, 3] - STRUT["other_point"]
    columns = np.stack([np.stack([1 + zero, zero, zero], -1), np.stack([c * z - s * x, zero, -s * z - c * x], -1)], -1)
    length = np.sqrt((line**2).sum(axis=-1))[..., None]
    return length, np.vecmat(line / length, columns)


def along(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """ℓ' (..., 1)."""
    return (strut(q)[1] * v).sum(axis=-1, keepdims=True)


def depth(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return np.maximum(LOWER - q, 0), np.maximum(q - UPPER, 0)


# forces of the library, with their formulas written out once more; others have theirs in tests of their own
FORMULAS = {
    rd.effects.ViscousFriction(B): lambda t, q, v: -B * v,
    rd.effects.RegularisedCoulombFriction(F, V_S): lambda t, q, v: (
        -F * (np.exp(v / V_S) - np.exp(-v / V_S)) / (np.exp(v / V_S) + np.exp(-v / V_S))
    ),
    rd.effects.DryFriction(F): lambda t, q, v: -F * np.sign(v),
    rd.effects.DryFriction(F, 2 * F, V_S): lambda t, q, v: -F * (1 + np.exp(-((v / V_S) ** 2))) * np.sign(v),
    rd.effects.Spring(K, Q0): lambda t, q, v: K * (Q0 - q),
    rd.effects.JointStopSpring(LOWER, UPPER, K): lambda t, q, v: K * (depth(q)[0] - depth(q)[1]),
    rd.effects.JointStopDamper(LOWER, UPPER, B): lambda t, q, v: -B * (depth(q)[0] + depth(q)[1]) * v,
    rd.effects.LineSpring("pole", None, **STRUT, stiffness=3.0, length=0.7): lambda t, q, v: (
        -3.0 * (strut(q)[0] - 0.7) * strut(q)[1]
    ),
    rd.effects.LineDamper("pole", None, **STRUT, damping=0.9): lambda t, q, v: -0.9 * along(q, v) * strut(q)[1],
    rd.effects.ExternalWrench("pole", WRENCH): lambda t, q, v: np.vecmat(WRENCH, pole(q)),
}
FORCES = [name for name, kind in EFFECTS.items() if issubclass(kind, Force)]
WITHOUT_STATES = [name for name in FORCES if not issubclass(EFFECTS[name], Stateful | rd.effects.RigidStops)]
ARM = rd.load("planar_2r")


def states(count: int = 200) -> np.ndarray:
    """Positions and velocities of many sizes, both signs."""
    rng = np.random.default_rng(11)
    return rng.normal(size=(2, count, ROBOT.n)) * rng.choice([0.01, 0.1, 1.0, 3.0], size=(2, count, 1))


@pytest.mark.parametrize("name", EFFECTS)
def test_an_effect_states_what_it_is(name: str) -> None:
    """Its equation, and each argument in its docstring and in the example, which tests of all effects use."""
    kind, attributes = EFFECTS[name], str(EFFECTS[name].__doc__).partition("Attributes:")[2]
    declared = [each.name for each in fields(kind) if each.init]  # pyright: ignore[reportArgumentType]  a dataclass
    assert list(arguments(kind)) == declared
    assert set(declared) <= set(re.findall(r"\w+", " ".join(re.findall(r"^    +([\w, ]+):", attributes, re.MULTILINE))))
    assert all(part.term for part in example(name).parts)


def test_no_effect_escapes_its_formula() -> None:
    """Each is written out once more here, or in the test of its file; those with states in test_effect_states."""
    own = {path.stem.removeprefix("test_") for path in Path(__file__).parent.glob("test_*.py")}
    without = {kind for kind in EFFECTS.values() if kind.__module__.rpartition(".")[2] not in own}
    here = {*map(type, FORMULAS), rd.effects.EffortLimit, rd.effects.ActuatorLag}
    here |= {rd.effects.LuGreFriction, rd.effects.DahlFriction}
    assert without <= here


@pytest.mark.parametrize("name", FORCES)
def test_effect_is_of_exactly_one_kind(name: str) -> None:
    assert sum(issubclass(EFFECTS[name], kind) for kind in (Conservative, Dissipative, Active)) == 1


@pytest.mark.parametrize("effect", FORMULAS, ids=lambda e: type(e).__name__)
def test_torque_is_that_of_the_formula(effect: Force) -> None:
    """A handful of roundings of the largest value: 1e-14 of it."""
    q, v = states()
    expected = FORMULAS[effect](0.3, q, v)
    got = effect.torque(ROBOT, 0.3, q, v)
    np.testing.assert_allclose(got, expected, rtol=1e-14, atol=1e-14 * np.abs(expected).max())
    one_by_one = [effect.torque(ROBOT, 0.3, *state) for state in zip(q, v, strict=True)]
    np.testing.assert_allclose(one_by_one, got, rtol=1e-15)


@pytest.mark.parametrize("name", WITHOUT_STATES)
def test_effect_keeps_what_its_kind_declares(name: str) -> None:
    """Dissipative: τᵀ v ≤ 0 at any state, but for rounding. Conservative: −∂E/∂q, by differences."""
    effect, (q, v) = example(name), states()
    assert isinstance(effect, Force)
    torque = effect.torque(ARM, 0.0, q, v)
    one_by_one = [effect.torque(ARM, 0.0, *state) for state in zip(q, v, strict=True)]
    np.testing.assert_allclose(one_by_one, torque, rtol=1e-14, atol=1e-14 * np.abs(torque).max())
    if isinstance(effect, Dissipative):
        assert np.all((torque * v).sum(axis=-1) <= 1e-15 * np.abs(torque * v).sum(axis=-1))
        assert np.any((torque * v).sum(axis=-1) < 0)
    if isinstance(effect, Conservative):
        h = 1e-6
        for i, step in enumerate(h * np.eye(ARM.n)):
            slope = (effect.potential(ARM, 0.0, q + step) - effect.potential(ARM, 0.0, q - step)) / (2 * h)
            np.testing.assert_allclose(torque[..., i], -slope, atol=1e-6)


OF_JOINTS = [name for name in WITHOUT_STATES if "frame" not in arguments(EFFECTS[name])]  # others use J of the dynamics


@pytest.mark.parametrize("name", OF_JOINTS)
def test_effect_runs_in_every_arithmetic(name: str) -> None:
    """The same lines in longdouble, and in balls that hold the float64 value to its rounding (1e-15)."""
    effect, (_, v) = example(name), states(3)
    assert isinstance(effect, Force)
    expected = effect.torque(ARM, 0.0, v, v)
    wide = effect.torque(ARM, 0.0, *[v.astype(np.longdouble)] * 2)
    assert wide.dtype == np.longdouble
    np.testing.assert_allclose(wide.astype(float), expected, rtol=1e-14, atol=1e-15)
    ball = rd.accuracy.Ball(100)
    with ball.scope():
        got = effect.torque(ARM, 0.0, ball.array(v), ball.array(v))
        assert isinstance(got.flat[0], arb)
    np.testing.assert_allclose(rd.accuracy.midpoint(got), expected, rtol=1e-14, atol=1e-15)


def test_a_wrench_is_the_same_in_every_axes() -> None:
    """Power is: F in base axes at the frame, turned into the body's or moved to the base, gives one torque."""
    robot = rd.load("skew_tree")
    q = np.linspace(-0.4, 0.6, robot.n)
    g = robot.placement(q, "left_tool")
    R, p, force, torque = g[:3, :3], g[:3, 3], WRENCH[:3], WRENCH[3:]
    body = np.concatenate([R.T @ force, R.T @ torque])
    world = np.concatenate([force, torque + np.cross(p, force)])
    expected = rd.effects.ExternalWrench("left_tool", WRENCH).torque(robot, 0.0, q, q)
    for wrench, axes in ((body, "body"), (world, "world")):
        got = rd.effects.ExternalWrench("left_tool", wrench, axes).torque(robot, 0.0, q, q)
        np.testing.assert_allclose(got, expected, rtol=1e-13)
    own = rd.effects.ExternalWrench("left_tool", WRENCH).torque(rd.Lagrangian(robot), 0.0, q, q)
    np.testing.assert_allclose(own, expected, rtol=1e-13)


def test_a_wrench_acts_in_its_window_only() -> None:
    push = rd.effects.ExternalWrench("pole", WRENCH, start_s=1.0, end_s=2.0)
    q = np.array([0.1, 0.2])
    assert push.switches == (1.0, 2.0)
    assert [bool(push.torque(ROBOT, t, q, q).any()) for t in (0.5, 1.0, 1.5, 2.0)] == [False, True, True, False]


def test_effort_limit_cuts_the_actuation() -> None:
    bound = rd.effects.EffortLimit([1.0, np.inf])
    assert isinstance(bound, Bound)
    np.testing.assert_array_equal(bound.actuation(np.array([[3.0, 99.0], [-2.0, -99.0]])), [[1.0, 99.0], [-1.0, -99.0]])
    plant, still = Plant(ROBOT, [bound]), np.zeros(2)
    cut = plant.forward_dynamics(still, still, [3.0, 2.0], t=0.0)
    assert np.array_equal(cut, ROBOT.forward_dynamics(still, still, np.array([1.0, 2.0])))


def test_an_effect_is_evaluated_once_in_a_query_that_has_torques() -> None:
    on, calls = counted()
    (q,), (v,) = states(1)
    plant = Plant(ROBOT, [on])
    plant.forward_dynamics(q, v, v, t=1.5)
    assert calls == [1.5]
    plant.inverse_dynamics(q, v, v, t=2.0)
    plant.N(q, v, t=2.5)
    assert calls == [1.5, 2.0, 2.5]
    plant.M(q)
    plant.C(q, v)
    assert len(calls) == 3


@pytest.mark.parametrize("engine", [ROBOT, rd.Lagrangian(ROBOT)], ids=["Robot", "Lagrangian"])
@pytest.mark.parametrize("batch", [(), (4,), (2, 3)])
def test_plant_keeps_the_equation_of_motion(engine, batch) -> None:
    """M a + C v + N = τ with the deck's full N, and forward dynamics inverts it; κ < 100, so 1e-13."""
    rng = np.random.default_rng(2)
    q, v, a = rng.normal(size=(3, *batch, ROBOT.n))
    plant = Plant(engine, list(FORMULAS))
    u = plant.inverse_dynamics(q, v, a, t=0.2)
    terms = np.matvec(plant.M(q), a) + np.matvec(plant.C(q, v), v) + plant.N(q, v, t=0.2)
    np.testing.assert_allclose(u, terms, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(plant.forward_dynamics(q, v, u, t=0.2), a, rtol=1e-12, atol=1e-12)
    full_N = engine.N(q) - sum(FORMULAS[effect](0.2, q, v) for effect in FORMULAS)
    np.testing.assert_allclose(plant.N(q, v, t=0.2), full_N, rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("method", ["N", "forward_dynamics", "inverse_dynamics", "torque"])
def test_a_velocity_of_the_wrong_shape_is_refused(method: str) -> None:
    plant = Plant(ROBOT, list(FORMULAS))
    arguments = (np.ones(2),) if method in ("forward_dynamics", "inverse_dynamics") else ()
    with pytest.raises(QueryError, match="v must have shape"):
        getattr(plant, method)(np.ones(2), np.ones(3), *arguments, t=0.0)


def only(effect):
    return rd.Plant(ROBOT, [effect]).effects[0]


def test_what_is_not_named_is_free() -> None:
    """No friction, no spring, no stop and no limit at a joint that is not named."""
    np.testing.assert_array_equal(only(rd.effects.ViscousFriction({"hinge": 0.3})).viscous, [0.0, 0.3])
    spring = only(rd.effects.Spring({"slide": 2.0}, rest={"slide": 0.1}))
    np.testing.assert_array_equal([spring.stiffness, spring.rest], [[2.0, 0.0], [0.1, 0.0]])
    np.testing.assert_array_equal(only(rd.effects.EffortLimit({"slide": 3.0})).limit, [3.0, np.inf])
    stop = only(rd.effects.JointStopSpring({"slide": -1.0}, {"slide": 1.0}, 10.0))
    assert stop.torque(ROBOT, 0.0, np.array([0.5, 99.0]), np.zeros(2)).tolist() == [0.0, 0.0]
    assert stop.torque(ROBOT, 0.0, np.array([1.5, 99.0]), np.zeros(2)).tolist() == [-5.0, 0.0]


def test_urdf_is_what_the_file_states() -> None:
    viscous, dry = rd.Plant(ROBOT, "urdf").effects
    np.testing.assert_array_equal([viscous.viscous, dry.coulomb], [[0.8, 0.02], [1.5, 0.01]])
    assert rd.Plant(rd.load("ur5"), effects="urdf").effects == ()
    np.testing.assert_array_equal(only(rd.effects.ViscousFriction("urdf")).viscous, [0.8, 0.02])
    np.testing.assert_array_equal(only(rd.effects.RegularisedCoulombFriction("urdf")).coulomb, [1.5, 0.01])
    np.testing.assert_array_equal(only(rd.effects.EffortLimit("urdf")).limit, [100.0, np.inf])
    np.testing.assert_array_equal(only(rd.effects.JointStopSpring("urdf", "urdf", 1.0)).upper[0], 2.0)


def test_an_effect_given_by_name_is_left_as_it_was() -> None:
    effect = rd.effects.ViscousFriction({"hinge": 0.3})
    only(effect)
    assert effect.viscous == {"hinge": 0.3}


def test_an_effect_has_one_name_in_python_scene_ledger_and_rollouts() -> None:
    """The kinds of a scene are the names of the effects listed; those that work have them in the ledger."""
    effects = [example(name) for name in EFFECTS if not issubclass(EFFECTS[name], rd.effects.LineSpringDamper)]
    assert set(BY_KIND) == {effect.name for effect in effects} | {
        "gravity",
        "lock",
        "payload",
        "armature",
        "mass_scales",
    }
    assert len({effect.name for effect in effects}) == len(effects) - 2  # stops and lines have two parts each
    together = [effect for effect in effects if not isinstance(effect, rd.effects.TorqueSpeedLimit)]  # not with drives
    run = rd.simulate(rd.Plant(rd.load("planar_2r"), together), q0=[0.3, 0.4], duration_s=0.01, estimate_error=False)
    assert set(run.power) - {"control", "pick_up"} == {
        effect.name for effect in effects if not isinstance(effect, rd.effects.Conservative | rd.effects.Bound)
    }


def test_a_stop_that_differs_from_run_to_run_moves_both_of_its_parts() -> None:
    """Each run as by itself with its stop, in lock step as well, where steps are not cut, 1e-12; both are reached."""
    robot = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))
    upper = np.array([0.3, 0.4])

    def stops(at: float) -> rd.Setup:
        plant = rd.Plant(robot, rd.effects.joint_stops([-1.0], [at], 1e3, 1e2))
        return rd.Setup(plant, [0.2], [2.0], duration_s=0.2, record_every_s=0.1, estimate_error=False, method="RK4")

    runs = rd.rollouts(stops(0.5), vary={"joint_stops.upper": upper})
    for k, at in enumerate(upper):
        assert rd.simulate(stops(at)).q[:, 0].max() > at
        alone = rd.rollouts(stops(at), q0=[[0.2]])
        np.testing.assert_allclose(runs.q[k], alone.q[0], atol=1e-12)
