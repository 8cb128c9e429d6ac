"""docs/reference/scenes.md is written from the schema; gains of a scene are stated, or follow from ω and ζ."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.scene import BY_KIND, Part, control, effects, references, scene, starter, starter_names
from robot_dyn.scene.manual import manual

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "scenes.md"
PARTS = [
    each
    for module in (scene, control, effects, references)
    for each in vars(module).values()
    if isinstance(each, type) and issubclass(each, Part) and each is not Part
]


def test_the_page_is_that_of_the_schema() -> None:
    command = "python -m robot_dyn.scene.manual > docs/reference/scenes.md"
    assert PAGE.read_text(encoding="utf-8") == manual(), f"the page is out of date; write it by {command}"


@pytest.mark.parametrize("part", PARTS, ids=lambda each: each.__name__)
def test_every_key_is_explained(part: type[Part]) -> None:
    assert part.__doc__
    assert [key for key, field in part.model_fields.items() if not field.description and key != "kind"] == []


def test_every_kind_and_every_key_of_the_starters_is_on_the_page() -> None:
    page = PAGE.read_text(encoding="utf-8")
    assert all(f'### `kind = "{kind}"`' in page for kind in BY_KIND)
    text = "\n".join(starter(name) for name in starter_names())
    stated = {line.partition("=")[0].strip() for line in text.splitlines() if "=" in line and line[0] not in "#["}
    assert stated and all(f"`{key}`" in page or key == "kind" for key in stated)


SCENE = """
robot = "planar_2r"
duration_s = 0.1
[start]
q = [0.3, -0.4]
[[effect]]
kind = "gravity"
[control]
kind = "{kind}"
{gains}
"""
JOINT = ["pd", "pid", "pd_gravity", "feed_forward", "computed_torque"]


def built(tmp_path: Path, kind: str, gains: str):
    path = tmp_path / "scene.toml"
    path.write_text(SCENE.format(kind=kind, gains=gains), encoding="utf-8")
    return rd.read_scene(path).controller


@pytest.mark.parametrize("kind", JOINT)
def test_kp_and_kd_are_the_gains(tmp_path, kind: str) -> None:
    law = built(tmp_path, kind, "kp = [30.0, 20.0]\nkd = {joint_1 = 4.0}")
    np.testing.assert_array_equal(law.kp, [30.0, 20.0])
    np.testing.assert_array_equal(law.kd, [4.0, 0.0])
    if kind == "pid":
        np.testing.assert_array_equal(law.ki, [30.0, 20.0])


@pytest.mark.parametrize("kind", JOINT)
def test_frequency_and_damping_ratio_are_kp_and_kd(tmp_path, kind: str) -> None:
    """ω² and 2 ζ ω, times the diagonal of M without a model in the loop."""
    law = built(tmp_path, kind, "frequency_rad_per_s = 7.0\ndamping_ratio = 0.6")
    inertia = 1.0 if kind == "computed_torque" else np.diag(rd.load("planar_2r").M([0.3, -0.4]))
    np.testing.assert_allclose(law.kp, 49.0 * inertia * np.ones(2), rtol=1e-15)
    np.testing.assert_allclose(law.kd, 8.4 * inertia * np.ones(2), rtol=1e-15)


def test_operational_space_takes_gains_of_the_frame(tmp_path) -> None:
    circle = 'frame = "tip"\n[reference]\nkind = "circle"\nradius_m = 0.1\nperiod_s = 1.0\nnormal = [0.0, 1.0, 0.0]'
    circle += "\nto_centre = [1.0, 0.0, 0.0]"
    law = built(tmp_path, "operational_space", f"kp = 100.0\nkd = 20.0\n{circle}")
    assert (law.kp, law.kd, law.posture_kp) == (100.0, 20.0, 10.0)
