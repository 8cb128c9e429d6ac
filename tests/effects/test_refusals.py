"""What no effect means, and what no method, query or plant takes of one, is refused by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import (
    CarriedPayload,
    DryFriction,
    EffortLimit,
    ExternalWrench,
    JointStopDamper,
    JointStopSpring,
    LineSpringDamper,
    LuGreFriction,
    RegularisedCoulombFriction,
    RigidBacklash,
    RigidStops,
    SeriesElastic,
    Spring,
    ViscousFriction,
)
from robot_dyn.foundations import EffectError, QueryError

ARM, TREE, CART, UR5 = (rd.load(name) for name in ("planar_2r", "skew_tree", "cart_pole", "ur5"))
Q = np.array([0.3, -0.5])
LINE = {"stiffness": 1.0, "damping": 1.0, "length": 1.0}
DRY, PLAY, SOFT = DryFriction(1.0), RigidBacklash(0.01, 0.1), SeriesElastic(9.0, 0.1)
BODY = CarriedPayload(rd.Payload("tip", 0.8), 0.1, 0.2)
STOPS = RigidStops([-1.0, -1.0], [1.0, 1.0])


def plant(*effects: Any, arm: Any = ARM) -> rd.Plant:
    return rd.Plant(arm, effects)


def setup(*effects: Any, **options: Any) -> rd.Setup:
    return rd.Setup(plant(*effects), Q, duration_s=0.3, **options)


CONSTRUCTED = [
    (lambda: ViscousFriction(-0.1), "viscous must not be negative"),
    (lambda: ViscousFriction([0.1, np.nan]), "viscous must be finite"),
    (lambda: ViscousFriction("much"), "viscous must be real numbers"),
    (lambda: RegularisedCoulombFriction(1.0, 0.0), "velocity_scale must be positive"),
    (lambda: JointStopSpring(1.0, 0.5, 3.0), "lower must be less than upper"),
    (lambda: ExternalWrench("pole", [1, 2, 3]), r"shape \(6,\)"),
    (lambda: ExternalWrench("pole", np.ones(6), start_s=2.0, end_s=1.0), "end_s must lie after"),
    (lambda: EffortLimit(-1.0), "limit must not be negative"),
    (lambda: RigidStops(-1.0, 1.0, 1.5), "restitution must not be greater than 1"),
    (lambda: RigidStops(1.0, -1.0), "lower must be less than upper"),
    (lambda: DryFriction(2.0, 1.0), "static must not be less"),
    (lambda: DryFriction(2.0, stribeck_velocity=0.1), "no effect without static"),
    (lambda: RigidBacklash(0.1, 0.1, restitution=1.5), "restitution must not be greater than 1"),
    (lambda: SeriesElastic(9.0, 0.0), "inertia must be positive"),
    (lambda: LuGreFriction(1.0, 1.0, 1.0, 2.0, 1.5, 0.1), "static must not be less than coulomb"),
    (lambda: LineSpringDamper("torso", "torso", **LINE), "both points are fixed to 'torso'"),
    (lambda: LineSpringDamper("torso", None, **LINE | {"stiffness": -1.0}), "stiffness must not be negative"),
    (lambda: CarriedPayload(BODY.payload, 0.2, 0.1), "end_s must lie after start_s, got 0.2 and 0.1"),
]
IN_A_PLANT = [
    *(
        (
            lambda effect=effect: plant(effect, arm=CART),
            f"{effect.name}: {name} has values for [13] joints?, but the arm has 2",
        )
        for effect, name in (
            (ViscousFriction([1.0, 2.0, 3.0]), "viscous"),
            (RegularisedCoulombFriction(1.0, [1.0, 2.0, 3.0]), "velocity_scale"),
            (Spring(1.0, [1.0, 2.0, 3.0]), "rest"),
            (JointStopSpring([-1.0, -1.0, -1.0], 1.0, 1.0), "lower"),
            (JointStopDamper(-1.0, [1.0, 1.0, 1.0], 1.0), "upper"),
            (EffortLimit([1.0, 2.0, 3.0]), "limit"),
            (ViscousFriction([1.0]), "viscous"),
        )
    ),
    (lambda: plant(Spring({"slid": 1.0}), arm=CART), "stiffness: no joint 'slid'; nearest: slide"),
    (lambda: plant(ViscousFriction({"slide": -1.0}), arm=CART), "viscous must not be negative"),
    (lambda: plant(EffortLimit({"slide": -1.0}), arm=CART), "limit must not be negative"),
    (lambda: plant(RegularisedCoulombFriction(1.0, {"slide": 0.0}), arm=CART), "velocity_scale must be positive"),
    (lambda: plant(JointStopSpring({"slide": 1.0}, {"slide": -1.0}, 1.0), arm=CART), "lower must be less than upper"),
    (lambda: plant(ViscousFriction("urdf"), arm=rd.Lagrangian(CART)), "viscous='urdf' needs a Robot"),
    (lambda: plant(ViscousFriction("file"), arm=CART), "viscous must be real numbers"),
    (lambda: rd.Plant(CART, "friction"), "list of effects, or 'urdf'"),
    (lambda: plant(3), "3 is neither a Force nor a Bound"),
    (lambda: rd.Plant(object(), "urdf"), "must be a robot, such as rd.load"),
    (lambda: plant(RigidStops(7.0, "urdf"), arm=UR5), "lower must be less than upper"),
    (lambda: plant(RigidBacklash(0.0, 0.1)), "rigid_backlash: half_gap is 0 for all joints"),
    (lambda: plant(SeriesElastic(0.0, 0.1)), "series_elastic: stiffness is 0 for all joints"),
    (lambda: plant(LineSpringDamper("left_tol", None, **LINE), arm=TREE), "line_spring_damper: no frame 'left_tol'"),
    (lambda: plant(CarriedPayload(rd.Payload("tipp", 1.0))), "carried_payload: .*'tipp'"),
    (lambda: plant(BODY, arm=rd.Lagrangian(ARM)), "carried_payload needs a Robot, got Lagrangian"),
    (lambda: setup(SeriesElastic({"joint_2": 9.0}, 1.0), SOFT), "joint 'joint_2' has two drives; keep one"),
    (lambda: setup(PLAY, SOFT), "joint 'joint_1' has two drives"),
]
IN_A_RUN = [
    (lambda: rd.simulate(plant(STOPS), [0.3, 1.2]), r"q0: 'joint_2' is 0\.2 beyond its upper stop"),
    (lambda: setup(PLAY, method="GaussLegendre4"), "rigid_backlash: "),
    (lambda: setup(PLAY, method="MoreauJean"), "rigid_backlash: "),
    (lambda: setup(SOFT, method="MoreauJean"), "series_elastic: MoreauJean cannot integrate the motors of a drive"),
    (
        lambda: setup(BODY, method="GaussLegendre4"),
        "carried_payload: .* changes momenta, which GaussLegendre4 integrates",
    ),
    (lambda: rd.advise(plant(PLAY), Q), "advise: rigid_backlash couples and releases motors in turn"),
    (lambda: rd.advise(plant(BODY), Q), "advise: carried_payload changes the bodies"),
    *(
        (lambda ask=ask, method=method: ask(plant(DRY), Q, method=method), f"dry_friction: .* {why}.*DOP853")
        for ask in (rd.simulate, rd.rollouts)
        for method, why in (("GaussLegendre4", "momenta"), ("Euler", "order 1"))
    ),
    *(
        (lambda effect=effect: rd.rollouts(plant(effect), Q, method="RK4", uncut=True), f"uncut: {why}")
        for effect, why in (
            (DRY, "dry_friction stops and releases joints, where steps must"),
            (PLAY, "rigid_backlash stops and releases joints"),
            (BODY, "carried_payload is attached and detached, where steps must end"),
        )
    ),
]
REFUSED = [(make, EffectError, message) for make, message in CONSTRUCTED + IN_A_PLANT]
REFUSED += [(make, QueryError, message) for make, message in IN_A_RUN]


@pytest.mark.parametrize(("make", "error", "message"), REFUSED)
def test_what_has_no_meaning_is_refused(make: Callable[[], Any], error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make()
