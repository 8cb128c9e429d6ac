"""Explanations from Python: those of the command for a scene, the same terms for a setup and for a plant."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from lxml import html

import robot_dyn as rd
from robot_dyn.report import Result
from robot_dyn.scene import starter, starter_names
from tests.command import document, said


@pytest.fixture(params=["panda_payload", "cart_pole"])
def scene(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(starter(request.param), encoding="utf-8")
    return path


def test_a_scene_is_explained_as_the_command_does(scene: Path) -> None:
    answer = rd.explain(scene)
    assert said("explain", scene) == f"{answer}\n"
    assert document("explain", scene) == json.loads(answer.to_json())


@pytest.mark.parametrize("name", starter_names())
def test_a_setup_has_the_terms_of_its_scene(name: str, tmp_path: Path) -> None:
    """Equation, kinds, terms and coefficients as they act do not depend on where the setup came from."""
    path = tmp_path / "scene.toml"
    path.write_text(starter(name), encoding="utf-8")
    of_scene, of_setup = rd.explain(path), rd.explain(rd.read_scene(path))
    assert of_setup.equation == of_scene.equation
    assert of_setup.absent == of_scene.absent and of_setup.joints == of_scene.joints
    assert {(x.kind, x.term) for x in of_setup.effects} == {(x.kind, x.term) for x in of_scene.effects}
    acting = {x.coefficients for x in of_scene.effects if x.coefficients}
    assert acting <= {x.coefficients for x in of_setup.effects}


def test_a_plant_names_what_acts_and_nothing_else() -> None:
    arm = rd.load("ur5").with_(gravity=(0, 0, 0), payload=rd.Payload("tool0", 2.0), lock={"elbow_joint": 0.5})
    bench = rd.Plant(arm, [*rd.effects.joint_stops(-1.0, 1.0), rd.effects.ViscousFriction(0.5)])
    answer = rd.explain(bench)
    assert [each.kind for each in answer.effects] == ["lock", "payload", "joint_stops", "viscous_friction"]
    assert answer.equation == ("M(q) a + C(q, v) v + N = τ", "N = −τ_joint_stops − τ_viscous_friction", "τ = u")
    assert not {each.kind for each in answer.effects} & {*answer.absent} and "gravity" in answer.absent
    assert "2 kg on tool0 at (0, 0, 0) m" in repr(answer) and "elbow_joint = 0.5" in repr(answer)
    assert rd.explain(rd.Plant(arm)).equation[1] == "N = 0"
    assert repr(rd.explain(arm)) == repr(rd.explain(rd.Plant(arm)))


def test_the_model_of_a_controller_and_the_span_of_its_reference_are_named() -> None:
    """What differs from the robot of the plant: in the model alone, and in the plant alone; nothing if it is that."""
    arm, q = rd.load("ur5"), np.full(6, 0.1)
    plant = rd.Plant(arm.with_(payload=rd.Payload("tool0", 2.0)))
    plan = rd.control.quintic(q, q + 0.4, duration_s=1.5, start_s=0.5)

    def explained(model: rd.Robot) -> Result:
        controller = rd.control.ComputedTorque(model, plan, kp=100.0, kd=20.0)
        return rd.explain(rd.Setup(plant, q, duration_s=2.5, controller=controller))

    answer = explained(arm.with_(mass_scale=1.2))
    assert "model: ur5, mass_scale 1.2, without payload 2 kg on tool0 at (0, 0, 0) m" in answer.control
    assert "reference: PiecewisePolynomial, 0.5 to 2 s, 1.5 s long" in answer.control
    assert answer.equation[-1] == "u = M̂ (a_d + kd ė + kp e) + Ĉ v + N̂"
    assert "model: ur5, as the plant" in explained(plant.dynamics).control


class Wind(rd.effects.Dissipative):  # pyright: ignore[reportUntypedBaseClass]
    """A user-defined effect without a term."""

    def torque(self, dynamics, t, q, v):
        return -0.1 * v * np.abs(v)


def test_parts_of_the_user_are_named() -> None:
    plant = rd.Plant(rd.load("planar_2r"), [Wind()])

    def swing(t, q, v):
        return -1.0 * q

    setup = rd.Setup(plant, [0.1, 0.2], duration_s=0.1, controller=swing)
    assert "τ_wind" in repr(plant) and "  wind\n" in repr(plant)
    assert "u = swing(t, q, v)" in repr(setup) and "control: swing, continuously" in repr(setup)


def test_other_formulations_are_explained_alike() -> None:
    arm = rd.load("planar_2r").with_(armature=0.1)
    assert repr(rd.explain(rd.Lagrangian(arm))) == repr(rd.explain(arm))


def test_plant_and_setup_show_their_equation() -> None:
    arm = rd.load("planar_2r")
    plant = rd.Plant(arm, [rd.effects.ViscousFriction([0.5, 0.2])])
    law = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=9.0, kd=6.0, period_s=0.01)
    setup = rd.Setup(plant, [0.1, 0.2], duration_s=0.1, controller=rd.control.Loop(law, measurement_delay_periods=1.0))
    assert repr(plant).startswith("<Plant: planar_2r: 2 joints, joint_1, joint_2\n")
    assert repr(setup).startswith("<Setup: planar_2r: 2 joints, joint_1, joint_2\n")
    for value in (plant, setup):
        page = html.fragment_fromstring(value._repr_html_())
        for line in ("N = ∂V/∂q − τ_viscous_friction", "b = 0.5 N m s/rad, 0.2 N m s/rad"):
            assert line in repr(value) and line in page.text_content()
        assert "<script" not in value._repr_html_() and len(value._repr_html_()) < 5_000
    assert "u = kp (q_d − q) + kd (v_d − v)" in repr(setup) and "kp = 9 N m/rad" in repr(setup)
    assert "measurement_delay_periods = 1" in repr(setup)
