"""Every parameter that is listed can vary: with the value that is listed the run is the run of the setup."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import html

import robot_dyn as rd
from robot_dyn.scene import starter
from tests.command import document, said
from tests.long import long


def setup() -> rd.Setup:
    arm = rd.load("cart_pole").with_(payload=rd.Payload("pole", 0.3, (0.0, 0.0, 0.1)))
    effects = [*rd.Plant(arm, "urdf").effects, rd.effects.Spring(2.0), rd.effects.Spring([1.0, 0.0], 0.1)]
    law = rd.control.PDGravity(
        arm.with_(mass_scale=1.2), rd.control.hold([0.1, 0.2]), kp=9.0, kd=[6.0, 2.0], period_s=0.01
    )
    loop = rd.control.Loop(law, position=(rd.control.Quantisation(1e-3),))
    return rd.Setup(rd.Plant(arm, effects), [0.2, 0.3], duration_s=0.03, controller=loop, method="RK4")


def end(given: rd.Setup, **options: Any) -> np.ndarray:
    """Positions at the end of the only run."""
    q: Any = rd.rollouts(given, **options).q
    return q[0, -1]


@pytest.mark.parametrize("every", [4, *long([1])])
def test_each_one_can_be_swept_and_has_the_value_of_the_setup(every: int) -> None:
    """To the rounding of the same equations, in which a number is an input and not a constant."""
    given = setup()
    alone = end(given)
    known = rd.parameters(given).parameters
    for each in known[::every]:
        swept = end(given, vary={each.name: each.value[None]})
        np.testing.assert_allclose(swept, alone, rtol=0, atol=1e-13, err_msg=each.name)
    assert {"kp", "spring 2.rest", "payload_mass:pole", "pole.mass", "model.mass_scale"} <= {x.name for x in known}


def test_units_are_those_of_the_joints() -> None:
    """cart_pole slides and turns."""
    units = {each.name: each.unit for each in rd.parameters(setup()).parameters}
    assert units["viscous_friction.viscous"] == "N s/m or N m s/rad"
    assert units["position.quantisation.resolution"] == "m or rad"
    assert (units["gravity"], units["mass_scale"], units["pole.inertia"]) == ("m/s²", "", "kg m²")


def test_the_value_is_what_the_command_prints(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(starter("cart_pole"), encoding="utf-8")
    answer = rd.parameters(rd.read_scene(scene))
    assert said("parameters", scene) == f"{answer}\n"
    assert document("parameters", scene) == json.loads(answer.to_json())
    text = answer._repr_html_()
    assert "<script" not in text and len(text) < 10_000
    assert len(list(html.fragment_fromstring(text).iter("tr"))) == len(answer.parameters) + 1
