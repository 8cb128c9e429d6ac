"""How a scene reads the file of its robot: `[load]` does what options of `rd.load` do, and a run says what was done."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import SceneError

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
LOAD = {
    "total": ('inertia = "from_shapes"\ntotal_mass_kg = 7.0', {"total_mass": 7.0}),
    "density": ('inertia = "from_shapes"\ndensity_kg_per_m3 = 900.0', {"density": 900.0}),
    "overlap": (
        'inertia = "from_shapes"\ndensity_kg_per_m3 = 900.0\nallow_overlap = true',
        {"density": 900.0, "allow_overlap": True},
    ),
    "mass": ('inertia = "from_shapes"\nmass_kg = {one = 2.0, two = 3.0}', {"mass": {"one": 2.0, "two": 3.0}}),
}
LINK = '<collision><origin xyz="0.2 0.01 0.02"/><geometry><box size="0.4 0.1 0.08"/></geometry></collision>'
URDF = f"""<robot name="rig"><link name="base"/><link name="one">{LINK}</link><link name="two">{LINK}</link>
<joint name="a" type="continuous"><parent link="base"/><child link="one"/><axis xyz="0 1 0.2"/></joint>
<joint name="b" type="continuous"><parent link="one"/><child link="two"/><axis xyz="0 1 0"/>
<origin xyz="0.4 0 0"/></joint>
</robot>"""
MJCF = """<mujoco model="rig"><option gravity="0.3 -0.2 -9.7"/><worldbody><body name="one">
<joint name="a" axis="0 1 0.2" armature="0.05" damping="0.4"/>
<geom type="capsule" fromto="0 0 0 0.4 0.02 0" size="0.05"/>
<body name="two" pos="0.4 0 0"><joint name="b" axis="0 1 0" armature="0.02"/><geom size="0.06" pos="0.2 0 0"/></body>
</body></worldbody><tendon><fixed name="cable"><joint joint="a" coef="1"/></fixed></tendon></mujoco>"""
Q = np.array([0.3, -0.7])


def scene(folder: Path, file: str, load: str, effects: str = "") -> Path:
    (folder / "rig.urdf").write_text(URDF, encoding="utf-8")
    (folder / "rig.xml").write_text(MJCF, encoding="utf-8")
    path = folder / "scene.toml"
    path.write_text(f'robot = "{file}"\nduration_s = 0.02\n[load]\n{load}\n{effects}', encoding="utf-8")
    return path


@pytest.mark.parametrize("key", LOAD)
def test_inertias_from_shapes_are_those_of_load(key: str, tmp_path: Path) -> None:
    text, options = LOAD[key]
    robot = rd.read_scene(scene(tmp_path, "rig.urdf", text)).plant.dynamics
    theirs = rd.load(tmp_path / "rig.urdf", inertia="from_shapes", **options)
    assert np.array_equal(robot.M(Q), theirs.M(Q))


def test_what_is_estimated_is_told_by_run_file_and_explanation(tmp_path: Path) -> None:
    path = scene(tmp_path, "rig.urdf", LOAD["total"][0])
    run = rd.simulate(rd.read_scene(path))
    again = rd.read(run.save(tmp_path / "run.npz"))
    for text in (run.summary, again.summary, repr(rd.explain(path))):
        assert "links 'one', 'two': mass or inertia is estimated from shapes, so torques are rough" in text


def test_what_is_left_out_of_mjcf_is_told_by_run_file_batch_and_explanation(tmp_path: Path) -> None:
    """The URDF in a run does not have it: the run carries it beside, and so does its robot."""
    path = scene(tmp_path, "rig.xml", 'without = ["tendon"]')
    setup = rd.read_scene(path)
    run = rd.simulate(setup)
    again = rd.read(run.save(tmp_path / "run.npz"))
    for text in (run.summary, again.summary, rd.rollouts(setup, q0=Q[None]).summary, repr(rd.explain(path))):
        assert "tendon 'cable': tendons are not supported; left out" in text
    with pytest.raises(SceneError, match=r"tendon 'cable'.*without=\{'tendon'\}"):
        rd.read_scene(scene(tmp_path, "rig.xml", ""))


def test_armature_and_gravity_of_mjcf_act_where_the_scene_names_them(tmp_path: Path) -> None:
    """Nothing acts unless it is named: M without armature is that of the bodies alone."""
    load = 'without = ["tendon"]'
    nothing = rd.read_scene(scene(tmp_path, "rig.xml", load)).plant.dynamics
    of_file = rd.load(tmp_path / "rig.xml", without={"tendon"})
    np.testing.assert_allclose(of_file.M(Q) - nothing.M(Q), np.diag([0.05, 0.02]), rtol=0, atol=1e-14)
    assert np.array_equal(nothing.N(Q), [0, 0])
    effects = '[[effect]]\nkind = "armature"\ninertia_kg_m2 = "urdf"\n'
    effects += '[[effect]]\nkind = "gravity"\nacceleration_m_s2 = "urdf"\n'
    path = scene(tmp_path, "rig.xml", load, effects)
    named = rd.read_scene(path).plant.dynamics
    assert np.array_equal(named.M(Q), of_file.M(Q)) and np.array_equal(named.N(Q), of_file.N(Q))
    told = {each.kind: each.coefficients for each in rd.explain(path).effects}
    assert told == {"armature": ("a 0.05", "b 0.02"), "gravity": ("g = (0.3, -0.2, -9.7) m/s²",)}


def test_a_scene_scales_mass_and_moments_of_a_link(tmp_path: Path) -> None:
    text = '[[effect]]\nkind = "mass_scales"\nfactors = {two = 1.5}\n'
    plain = rd.read_scene(scene(tmp_path, "rig.xml", 'without = ["tendon"]')).plant.dynamics
    path = scene(tmp_path, "rig.xml", 'without = ["tendon"]', text)
    scaled = rd.read_scene(path).plant.dynamics
    assert isinstance(plain, rd.Robot)
    assert np.array_equal(scaled.M(Q), plain.with_(mass_scales={"two": 1.5}).M(Q))
    assert np.abs(scaled.M(Q) - plain.with_(masses={"two": 1.5 * plain.model.inertias[2].mass}).M(Q)).max() > 1e-6
    (term,) = rd.explain(path).effects
    assert (term.kind, [number.key for number in term.numbers]) == ("mass_scales", ["factors"])


def test_explanations_of_a_scene_name_what_acts_of_its_file(tmp_path: Path) -> None:
    """Armature that a file of MJCF states and a scene does not name is not simulated, and listed so."""
    answer = rd.explain(scene(tmp_path, "rig.xml", 'without = ["tendon"]'))
    assert {"armature", "gravity"} <= {*answer.absent}


DRY = '[[effect]]\nkind = "dry_friction"\ncoulomb_N_m = 1.0'


@pytest.mark.parametrize(
    ("stated", "at", "key"),
    [
        ({"duration_s = 1.0": 'duration_s = 1e9\nmethod = "RK4"\nstep_s = 1e-3'}, 4, "step_s"),
        ({"duration_s = 1.0": "duration_s = 1e18"}, 2, "duration_s"),
        ({"duration_s = 1.0": "duration_s = 1.0\naccuracy = 1e-6\nestimate_error = false"}, 3, "accuracy"),
        ({"gravity": "rigid_stops", "#": "lower_rad = 0.5\nupper_rad = 0.6"}, 3, "start"),
        ({"duration_s = 1.0": 'duration_s = 1.0\nmethod = "GaussLegendre4"', "#": DRY}, 8, "effect 2 (dry_friction)"),
        ({"#": '[control]\nkind = "pd"\nkp = 1.0\nkd = 1.0\nperiod_s = 1e-12'}, 7, "control"),
    ],
)  # fmt: skip
def test_an_error_of_the_setup_has_the_line_and_the_key_of_the_scene(
    tmp_path: Path, stated: dict[str, str], at: int, key: str
) -> None:
    """Such as a run of too many steps, or a start beyond a stop, which the tables by themselves do not show."""
    text = 'robot = "planar_2r"\nduration_s = 1.0\n[start]\nq = [0.4, 0.9]\n[[effect]]\nkind = "gravity"\n#\n'
    for old, new in stated.items():
        text = text.replace(old, new)
    (path := tmp_path / "scene.toml").write_text(text, encoding="utf-8")
    with pytest.raises(SceneError) as caught:
        rd.read_scene(path)
    assert str(caught.value).startswith(f"{path}: line {at}: {key}: ")
