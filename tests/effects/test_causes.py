"""The torque by cause, along a motion and at a state: τ = M a + C v + ∂V/∂q − Σ τ_effect, each by another way."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from lxml import html

import robot_dyn as rd
from robot_dyn.effects import torques_by_cause
from robot_dyn.foundations import EffectError, QueryError
from tests.command import run as command
from tests.random_trees import RandomTree, trees

BODY = rd.Payload("tool0", 5.0, (0.1, 0.0, 0.2))
CAUSES = "inertia", "Coriolis", "gravity"
ROUNDING = 1e-12  # of the largest torque: some thousand units of rounding


def motion(n: int, k: int = 9, seed: int = 4) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """General states, without zeros."""
    q, v, a = np.random.default_rng(seed).uniform(-1.5, 1.5, (3, k, n))
    return np.linspace(0.1, 0.9, k), q, v, a


@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(tree=trees(most_joints=7), seed=st.integers(0, 1000))
def test_causes_of_random_arms_add_up_to_inverse_dynamics(tree: RandomTree, seed: int) -> None:
    """With a payload in the hand, viscous and dry friction and springs: to 1e-12 of the largest torque."""
    arm = tree.robot
    frame = list(arm.frame_names)[-1]
    arm = arm.with_(payload=rd.Payload(frame, 1.7, (0.1, -0.2, 0.05)))
    friction = rd.effects.ViscousFriction(0.4), rd.effects.DryFriction(0.7, 0.9, 0.05)
    plant = rd.Plant(arm, [*friction, rd.effects.Spring(2.0, 0.1)])
    t, q, v, a = motion(arm.n, seed=seed)
    split = torques_by_cause(plant, t, q, v, a)
    tau = np.array([plant.inverse_dynamics(*row, t=time) for time, *row in zip(t.tolist(), q, v, a, strict=True)])
    largest = max(np.abs(each).max() for each in split.torques.values())
    assert np.abs(split.tau - tau).max() <= ROUNDING * largest
    assert np.abs(sum(split.torques.values()) - tau).max() <= ROUNDING * largest
    assert list(split.torques) == ["inertia", "Coriolis", "gravity", "viscous_friction", "dry_friction", "spring"]


@pytest.mark.parametrize("arm", ["ur5", "panda", "mimic_chain", "cart_pole"])
def test_each_cause_is_its_term_of_the_equation(arm: str) -> None:
    """M a, C v and ∂V/∂q of matrices of the closed form, which shares no code with the recursion; laws of effects."""
    robot = rd.load(arm)
    own = rd.Lagrangian(robot)
    plant = rd.Plant(robot, [rd.effects.ViscousFriction(0.4), rd.effects.Spring(2.0, 0.1)])
    t, q, v, a = motion(robot.n)
    found = torques_by_cause(plant, t, q, v, a).torques
    expected = {
        "inertia": np.einsum("kij,kj->ki", own.M(q), a),
        "Coriolis": np.einsum("kij,kj->ki", own.C(q, v), v),
        "gravity": own.N(q),
        "viscous_friction": 0.4 * v,
        "spring": 2.0 * (q - 0.1),
    }
    for name, torque in expected.items():
        np.testing.assert_allclose(found[name], torque, rtol=1e-10, atol=1e-11, err_msg=name)  # digits of two engines


def test_causes_are_differences_of_the_energies() -> None:
    """∂V/∂q, and d/dt ∂K/∂v − ∂K/∂q = M a + C v, by central differences: O(h²) and rounding / h, 1e-8 at h = 1e-5."""
    arm, h = rd.load("panda"), 1e-5
    t, q, v, a = motion(arm.n, 3)
    found = torques_by_cause(arm, t, q, v, a).torques
    ways = h * np.eye(arm.n)

    def slope(f):
        return np.stack([(f(+way) - f(-way)) / (2 * h) for way in ways], axis=-1)

    def momentum(s):  # after a time s of the motion q + v s + a s²/2
        return arm.momentum(q + v * s + a * s**2 / 2, v + a * s)

    gravity = slope(lambda way: arm.potential_energy(q + way))
    kinetic = (momentum(h) - momentum(-h)) / (2 * h) - slope(lambda way: arm.kinetic_energy(q + way, v))
    np.testing.assert_allclose(found["gravity"], gravity, atol=1e-8)
    np.testing.assert_allclose(found["inertia"] + found["Coriolis"], kinetic, atol=1e-8)


def test_a_payload_that_comes_and_goes_is_one_cause() -> None:
    """While it is carried, what the arm with that body in its hand needs more; two of them by a number."""
    arm, t_carried = rd.load("ur5"), (0.3, 0.7)
    second = rd.Payload("forearm_link", 2.0, (0.0, 0.1, 0.0))
    plant = rd.Plant(arm, [rd.effects.CarriedPayload(BODY, *t_carried), rd.effects.CarriedPayload(second, 0.5)])
    t, q, v, a = motion(6)
    split = torques_by_cause(plant, t, q, v, a)
    carried = (t >= t_carried[0]) & (t < t_carried[1])
    needs = arm.with_(payload=BODY).inverse_dynamics(q, v, a) - arm.inverse_dynamics(q, v, a)
    expected = np.where(carried[:, None], needs, 0.0)
    np.testing.assert_allclose(split.torques["carried_payload"], expected, rtol=1e-11, atol=1e-11)
    lifted = split.torques["carried_payload 2"][:, :2]  # the joints below the link that carries it
    assert not lifted[t < 0.5].any() and lifted[t >= 0.5].all()
    tau = np.array([plant.inverse_dynamics(*row, t=time) for time, *row in zip(t.tolist(), q, v, a, strict=True)])
    assert np.abs(split.tau - tau).max() <= ROUNDING * np.abs(tau).max()
    assert np.abs(split.unexplained).max() <= ROUNDING * np.abs(tau).max()


def test_what_a_motion_does_not_determine_is_refused() -> None:
    plant = rd.Plant(rd.load("ur5"), [rd.effects.DahlFriction(50.0, 0.4)])
    t, q, v, a = motion(6)
    with pytest.raises(EffectError, match=r"does not determine the states of dahl_friction; simulate it"):
        torques_by_cause(plant, t, q, v, a)
    with pytest.raises(QueryError, match=r"v must have shape \(k, 6\) for times t of shape \(k,\)"):
        torques_by_cause(plant.dynamics, t, q, v[:3], a)
    with pytest.raises(QueryError, match="a must be finite"):
        torques_by_cause(plant.dynamics, t, q, v, a * np.nan)


def test_the_table_names_the_time_of_the_largest_torque() -> None:
    split = torques_by_cause(rd.load("ur5"), *motion(6))
    heading, *lines = repr(split).splitlines()[1:]
    assert heading.split() == ["joint", "t", "[s]", "unit", "torque", "inertia", "Coriolis", "gravity"]
    k = int(np.abs(split.tau[:, 2]).argmax())
    name, t, *_, torque, inertia, coriolis, gravity = lines[2].split()
    shown = [float(x) for x in (t, torque, inertia, coriolis, gravity)]
    expected = [split.t[k], split.tau[k, 2], *(each[k, 2] for each in split.torques.values())]
    assert name == "elbow_joint" and shown == pytest.approx(expected, rel=1e-5)


def plants() -> dict[str, rd.Plant]:
    """Arms that turn, slide, are coupled, carry and rub."""
    ur5, fingers, cart = rd.load("ur5"), rd.load("mimic_chain"), rd.load("cart_pole")
    dry = rd.effects.DryFriction(0.7, 0.9, 0.05)
    push = rd.effects.ExternalWrench("tool0", [3.0, -2.0, 1.0, 0.1, 0.2, -0.3], start_s=0.5, end_s=1.0)
    return {
        "ur5 with payload": rd.Plant(ur5.with_(payload=BODY, armature=0.2), [rd.effects.ViscousFriction(0.5), dry]),
        "ur5 carries": rd.Plant(ur5, [rd.effects.CarriedPayload(BODY, 0.5, 1.0), push]),
        "mimic_chain": rd.Plant(fingers, [rd.effects.ViscousFriction(0.3), rd.effects.Spring(2.0, 0.1)]),
        "cart_pole": rd.Plant(cart, "urdf"),
        "panda in a lift": rd.Plant(rd.load("panda").with_(gravity=(0.3, 0.0, -12.0), mass_scale=1.1)),
    }


@pytest.mark.parametrize("name", plants())
def test_causes_add_up_to_inverse_dynamics(name: str) -> None:
    """To rounding: 1e-13 of the sum of all causes, at general states, for every joint and two times."""
    plant, rng = plants()[name], np.random.default_rng(5)
    for t in (0.0, 0.7):
        q, v, a = rng.uniform(-1.5, 1.5, (3, plant.dynamics.n))
        tau = plant.inverse_dynamics(q, v, a, t=t)
        for i, joint in enumerate(plant.dynamics.joint_names):
            why = rd.why(plant, q, v, a, joint, t=t)
            parts = [x for share in why.shares for x in (share.inertia, share.coriolis, share.gravity)]
            parts += why.effects.values()
            assert why.tau == tau[i] and why.at_rest == 0.0
            assert abs(sum(parts) - tau[i]) <= 1e-13 * (1.0 + sum(map(abs, parts)))
            if name == "ur5 carries":  # its payload is a cause of its own, or a part of its links
                continue
            split = torques_by_cause(plant, [t], q[None], v[None], a[None]).torques
            sums = {x: sum(getattr(share, x.lower()) for share in why.shares) for x in CAUSES}
            for cause, torque in (sums | why.effects).items():
                assert split[cause][0, i] == pytest.approx(torque, rel=1e-13, abs=1e-11)


def test_from_the_torque_of_a_joint_at_rest_friction_is_the_rest() -> None:
    """λ = u − N of one that sticks; a torque given as `tau` is the torque that is split."""
    plant = rd.Plant(rd.load("planar_2r"), [rd.effects.DryFriction(50.0)])
    q, v, u = np.array([0.3, 0.4]), np.zeros(2), np.array([1.0, 2.0])
    load = u - rd.load("planar_2r").N(q)
    for i, joint in enumerate(plant.dynamics.joint_names):
        assert rd.why(plant, q, v, None, joint, tau=u).at_rest == pytest.approx(load[i], rel=1e-12)


def test_the_value_is_what_the_command_prints() -> None:
    q, v, a = "0.3,-1.1,0.9,-0.6,1.2,0.4", "0.5,0.4,-0.3,0.2,0.6,-0.5", "1,2,0,0.3,0.2,-0.1"
    words = ("query", "ur5", "--q", q, "--v", v, "--a", a, "--payload", "tool0=5kg@0.1,0,0.2", "--why", "elbow_joint")
    at, speed, acceleration = (np.array([float(x) for x in text.split(",")]) for text in (q, v, a))
    cause = rd.why(rd.load("ur5").with_(payload=BODY), at, speed, acceleration, "elbow_joint")
    assert command(*words).stdout.endswith(f"\n\n{cause}\n")
    assert json.loads(command(*words, "--json").stdout)["why"] == json.loads(cause.to_json())


def test_a_robot_is_a_plant_without_effects_and_an_unknown_joint_has_near_names() -> None:
    arm, q = rd.load("ur5"), np.zeros(6)
    assert repr(rd.why(arm, q, q, q, "elbow_joint")) == repr(rd.why(rd.Plant(arm), q, q, q, "elbow_joint"))
    with pytest.raises(QueryError, match="why: no joint 'elbow'; nearest: elbow_joint"):
        rd.why(arm, q, q, q, "elbow")
    for a, tau in ((None, None), (q, q)):
        with pytest.raises(QueryError, match="give either a or tau"):
            rd.why(arm, q, q, a, "elbow_joint", tau=tau)
    with pytest.raises(QueryError, match=r"q must be one state of shape \(6,\)"):
        rd.why(arm, np.zeros((2, 6)), q, q, "elbow_joint")
    with pytest.raises(QueryError, match=r"plant: got .*; give the plant of a robot"):
        rd.why(rd.Plant(rd.Lagrangian(arm)), q, q, q, "elbow_joint")


def test_bars_are_as_long_as_the_causes() -> None:
    """One bar for each number that is not 0, cause by cause, the positive ones first and to the right."""
    plant = plants()["ur5 with payload"]
    q, v, a = np.random.default_rng(6).uniform(-1.5, 1.5, (3, 6))
    cause = rd.why(plant, q, v, a, "elbow_joint")
    page = html.fragment_fromstring(cause._repr_html_())
    columns = ([getattr(share, name) for share in cause.shares] for name in ("inertia", "coriolis", "gravity"))
    columns = [np.array(x) for x in (*columns, [*cause.effects.values()])]
    expected = np.concatenate([part for x in columns for part in (x[x > 0], x[x < 0])])
    paths = [next(bar.iter("path")).get("d") for bar in page.iter("g") if bar.get("id") == "bar"]
    at = [np.array(re.findall(r"-?[\d.]+", path), float).reshape(-1, 2)[:, 0] for path in paths]
    drawn = np.array([x[1] - x[0] for x in at])
    assert drawn / np.abs(drawn).sum() == pytest.approx(expected / np.abs(expected).sum(), abs=1e-3)
    assert all(x.min() >= 0 for x in at)
    assert [cell.text_content() for cell in page.iter("th")] == [
        "from", "inertia", "Coriolis", "gravity", "effect", "sum"
    ]  # fmt: skip
    (drawing,) = page.iter("svg")
    (label,) = [each for each in drawing.iter("text") if "N m" in (each.text or "")]
    assert drawing.get("aria-label") == label.text == "torque of elbow_joint [N m]"
