"""The causes of a torque add up to it: τ = Σ_links (M a + C v + N) − Σ τ_effect, each by an independent way."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from lxml import html

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.command import run

BODY = rd.Payload("tool0", 5.0, (0.1, 0.0, 0.2))


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
        tau = plant.inverse_dynamics(t, q, v, a)
        for i, joint in enumerate(plant.dynamics.joint_names):
            cause = rd.why(plant, q, v, a, joint, t=t)
            parts = [x for share in cause.shares for x in (share.inertia, share.coriolis, share.gravity)]
            parts += cause.effects.values()
            assert cause.tau == tau[i] and cause.at_rest == 0.0
            assert abs(sum(parts) - tau[i]) <= 1e-13 * (1.0 + sum(map(abs, parts)))


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
    assert run(*words).stdout.endswith(f"\n\n{cause}\n")
    assert json.loads(run(*words, "--json").stdout)["why"] == json.loads(cause.to_json())


def test_a_robot_is_a_plant_without_effects_and_an_unknown_joint_has_near_names() -> None:
    arm, q = rd.load("ur5"), np.zeros(6)
    assert repr(rd.why(arm, q, q, q, "elbow_joint")) == repr(rd.why(rd.Plant(arm), q, q, q, "elbow_joint"))
    with pytest.raises(QueryError, match="why: no joint 'elbow'; nearest: elbow_joint"):
        rd.why(arm, q, q, q, "elbow")
    for a, tau in ((None, None), (q, q)):
        with pytest.raises(QueryError, match="give one of a and tau"):
            rd.why(arm, q, q, a, "elbow_joint", tau=tau)
    with pytest.raises(QueryError, match=r"q must be one state of shape \(6,\)"):
        rd.why(arm, np.zeros((2, 6)), q, q, "elbow_joint")
    with pytest.raises(QueryError, match="plant: give the plant of a robot"):
        rd.why(rd.Plant(rd.Lagrangian(arm)), q, q, q, "elbow_joint")


def test_bars_are_as_long_as_the_causes() -> None:
    """One bar for each number that is not 0, cause by cause, the positive ones first and to the right."""
    plant = plants()["ur5 with payload"]
    q, v, a = np.random.default_rng(6).uniform(-1.5, 1.5, (3, 6))
    cause = rd.why(plant, q, v, a, "elbow_joint")
    text = cause._repr_html_()
    assert "<script" not in text and len(text) < 20_000  # a third is the table
    page = html.fragment_fromstring(text)
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
