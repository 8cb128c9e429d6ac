"""Coefficients by joint name or as the file states become arrays when the plant is known."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import EffectError
from robot_dyn.scene import BY_KIND
from tests.effect_examples import EFFECTS, example

ROBOT = rd.load("cart_pole")


def only(effect):
    return rd.Plant(ROBOT, [effect]).effects[0]


def test_what_is_not_named_is_free() -> None:
    """No friction, no spring, no stop and no limit at a joint that is not named."""
    np.testing.assert_array_equal(only(rd.effects.ViscousFriction({"hinge": 0.3})).damping, [0.0, 0.3])
    spring = only(rd.effects.Spring({"slide": 2.0}, rest={"slide": 0.1}))
    np.testing.assert_array_equal([spring.stiffness, spring.rest], [[2.0, 0.0], [0.1, 0.0]])
    np.testing.assert_array_equal(only(rd.effects.EffortLimit({"slide": 3.0})).limit, [3.0, np.inf])
    stop = only(rd.effects.JointStopSpring({"slide": -1.0}, {"slide": 1.0}, 10.0))
    assert stop.torque(ROBOT, 0.0, np.array([0.5, 99.0]), np.zeros(2)).tolist() == [0.0, 0.0]
    assert stop.torque(ROBOT, 0.0, np.array([1.5, 99.0]), np.zeros(2)).tolist() == [-5.0, 0.0]


def test_urdf_is_what_the_file_states() -> None:
    viscous, dry = rd.Plant(ROBOT, "urdf").effects
    np.testing.assert_array_equal([viscous.damping, dry.friction], [[0.8, 0.02], [1.5, 0.01]])
    assert rd.Plant(rd.load("ur5"), effects="urdf").effects == ()
    np.testing.assert_array_equal(only(rd.effects.ViscousFriction("urdf")).damping, [0.8, 0.02])
    np.testing.assert_array_equal(only(rd.effects.RegularisedCoulombFriction("urdf")).friction, [1.5, 0.01])
    np.testing.assert_array_equal(only(rd.effects.EffortLimit("urdf")).limit, [100.0, np.inf])
    np.testing.assert_array_equal(only(rd.effects.JointStopSpring("urdf", "urdf", 1.0)).upper[0], 2.0)


def test_an_effect_given_by_name_is_left_as_it_was() -> None:
    effect = rd.effects.ViscousFriction({"hinge": 0.3})
    only(effect)
    assert effect.damping == {"hinge": 0.3}


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: only(rd.effects.Spring({"slid": 1.0})), "stiffness: no joint 'slid'; nearest: slide"),
        (lambda: only(rd.effects.ViscousFriction({"slide": -1.0})), "damping must not be negative"),
        (lambda: only(rd.effects.EffortLimit({"slide": -1.0})), "limit must not be negative"),
        (lambda: only(rd.effects.RegularisedCoulombFriction(1.0, {"slide": 0.0})), "velocity_scale must be positive"),
        (lambda: only(rd.effects.JointStopSpring({"slide": 1.0}, {"slide": -1.0}, 1.0)), "lower stops must lie below"),
        (lambda: rd.Plant(rd.Lagrangian(ROBOT), [rd.effects.ViscousFriction("urdf")]), "damping='urdf' needs a Robot"),
        (lambda: only(rd.effects.ViscousFriction("file")), "damping must be real numbers"),
    ],
)
def test_names_and_values_are_checked_when_the_joints_are_known(make, message: str) -> None:
    with pytest.raises(EffectError, match=message):
        make()


def test_an_effect_has_one_name_in_python_scene_ledger_and_rollouts() -> None:
    """The kinds of a scene are the names of the effects listed; those that work have them in the ledger."""
    effects = [example(name) for name in EFFECTS if not issubclass(EFFECTS[name], rd.effects.LineSpringDamper)]
    assert set(BY_KIND) == {effect.name for effect in effects} | {"gravity", "lock", "payload", "armature"}
    assert len({effect.name for effect in effects}) == len(effects) - 2  # stops and lines have two parts each
    run = rd.simulate(rd.Plant(rd.load("planar_2r"), effects), q0=[0.3, 0.4], duration_s=0.01, estimate_error=False)
    assert set(run.power) - {"control", "pick_up"} == {
        effect.name for effect in effects if not isinstance(effect, rd.effects.Conservative | rd.effects.Bound)
    }


def test_a_stop_that_differs_from_run_to_run_moves_both_of_its_parts() -> None:
    """Each run as by itself with its stop, in lock step as well, where steps are not cut, 1e-12; both are reached."""
    robot = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))
    upper = np.array([0.3, 0.4])

    def stops(at: float) -> rd.Setup:
        plant = rd.Plant(robot, rd.effects.joint_stops([-1.0], [at], 1e3, 1e2))
        return rd.Setup(
            plant, [0.2], [2.0], duration_s=0.2, record_period_s=0.1, estimate_error=False, integrator="rk4"
        )

    runs = rd.rollouts(stops(0.5), params={"joint_stops.upper": upper})
    for k, at in enumerate(upper):
        assert rd.simulate(stops(at)).q[:, 0].max() > at
        alone = rd.rollouts(stops(at), q0=[[0.2]])
        np.testing.assert_allclose(runs.q[k], alone.q[0], atol=1e-12)
