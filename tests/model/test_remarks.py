"""Order of q, states by joint name, joints without a torque of gravity, angles in degrees."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects.plant_state import plant_state
from robot_dyn.foundations import DescriptionError, QueryError
from robot_dyn.model.remarks import degree_lines

LINK = '<inertial><origin xyz="0.3 0 0"/><mass value="{mass}"/>\
<inertia ixx="0.01" iyy="0.02" izz="0.02" ixy="0" ixz="0" iyz="0"/></inertial>'


def link(name: str, mass: float) -> str:
    return f'<link name="{name}">{LINK.format(mass=mass)}</link>'


def joint(name: str, parent: str, child: str, axis: str, kind: str = "revolute") -> str:
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="3"/></joint>'
    )


def robot(*parts: str) -> rd.Robot:
    return rd.Robot.from_text(f'<robot name="two"><link name="base"/>{"".join(parts)}</robot>')


TWO = robot(
    joint("shoulder_b", "base", "lb", "0 1 0"),
    link("lb", 1.0),
    joint("shoulder_a", "base", "la", "0 1 0"),
    link("la", 5.0),
)
STATE = {"shoulder_b": 0.2, "shoulder_a": 0.9}
IN_ORDER = np.array([STATE[name] for name in TWO.joint_names])


def test_the_order_of_the_file_is_that_of_its_joints() -> None:
    assert TWO.file_order == ("shoulder_b", "shoulder_a") and TWO.joint_names == ("shoulder_a", "shoulder_b")
    assert rd.info(TWO).file_order == TWO.file_order
    assert any("shoulder_b, shoulder_a" in line for line in plant_state(TWO, IN_ORDER, [0, 0], [0, 0]).remarks)
    assert not plant_state(rd.load("planar_2r"), [0, 0], [0, 0], [0, 0]).remarks


@pytest.mark.parametrize(
    ("file", "q"),
    [
        ("ab", "ab"),
        ("ba", "ab"),  # two joints on the base: by name
        ("cab", "abc"),
        ("acb", "abc"),
        ("cba", "abc"),
    ],
)
def test_joints_of_one_link_are_in_the_order_of_their_names(file: str, q: str) -> None:
    arm = robot(*(part for x in file for part in (joint(x, "base", f"l{x}", "0 1 0"), link(f"l{x}", 1.0))))
    assert (arm.file_order, arm.joint_names) == (tuple(file), tuple(q))
    remarks = plant_state(arm, *[np.zeros(arm.n)] * 3).remarks
    assert any("order of q" in line for line in remarks) is (file != q) is ("order of q" in repr(arm))


@pytest.mark.parametrize("name", ["panda", "ur5", "talos_left_arm", "baxter"])
def test_the_order_of_the_file_has_the_joints_of_q(name: str) -> None:
    arm = rd.load(name)
    assert sorted(arm.file_order) == sorted(arm.joint_names)


@pytest.mark.parametrize(
    "engine", [TWO, rd.Lagrangian(TWO), rd.compiled(TWO), TWO.nan_rows], ids=lambda x: type(x).__name__
)
def test_a_state_by_joint_names_is_that_in_the_order_of_q(engine: Any) -> None:
    speed = {"shoulder_a": 0.4}  # 0 for the other
    v = np.array([0.4, 0.0])
    np.testing.assert_array_equal(engine.M(STATE), engine.M(IN_ORDER))
    np.testing.assert_array_equal(engine.C(STATE, speed), engine.C(IN_ORDER, v))
    np.testing.assert_array_equal(engine.N(STATE), engine.N(IN_ORDER))
    # closed form: m g x_c cos q, turned by +y
    expected = {"shoulder_b": -1.0 * 9.80665 * 0.3 * np.cos(0.2), "shoulder_a": -5.0 * 9.80665 * 0.3 * np.cos(0.9)}
    np.testing.assert_allclose(engine.N(STATE), [expected[name] for name in TWO.joint_names], rtol=1e-14)


def test_a_batch_by_joint_names_has_one_shape() -> None:
    angles = np.linspace(0.0, 1.0, 5)
    rows = TWO.N({"shoulder_b": angles, "shoulder_a": 0.3})
    np.testing.assert_array_equal(rows, TWO.N(np.column_stack([np.full(5, 0.3), angles])))
    with pytest.raises(QueryError, match="one shape"):
        TWO.N({"shoulder_b": np.zeros(2), "shoulder_a": np.zeros(3)})


def test_runs_start_by_joint_names() -> None:
    plant = rd.Plant(TWO)
    options: dict[str, Any] = {"duration_s": 0.1, "method": "RK4", "step_s": 1e-3}
    alone = rd.simulate(plant, STATE, {"shoulder_a": 0.1}, estimate_error=False, **options)
    np.testing.assert_array_equal(alone.q, rd.simulate(plant, IN_ORDER, [0.1, 0.0], estimate_error=False, **options).q)
    several = rd.rollouts(plant, {"shoulder_b": [0.2, 0.3], "shoulder_a": 0.9}, **options)
    np.testing.assert_allclose(several.q[0, 0], IN_ORDER, rtol=0)  # type: ignore[index]
    np.testing.assert_array_equal(rd.linearise(plant, STATE).A, rd.linearise(plant, IN_ORDER).A)


@pytest.mark.parametrize("wrong", [{}, {"shoulder": 0.1}, {0: 0.1}, {"shoulder_a": "x"}, {"shoulder_a": np.nan}])
def test_other_names_and_values_are_refused(wrong: dict[Any, Any]) -> None:
    with pytest.raises(QueryError):
        TWO.M(wrong)


def test_gravity_exerts_no_torque_about_its_direction_nor_force_across_it() -> None:
    """Axis z carries y: free about z on a table, loaded on a wall; a slide across gravity is free, one along it not."""
    arm = robot(
        joint("pan", "base", "l1", "0 0 1"), link("l1", 2.0), joint("lift", "l1", "l2", "0 1 0"), link("l2", 1.0)
    )
    assert arm.gravity_free == ("pan",) and arm.gravity_acts
    assert arm.with_(gravity=(-9.81, 0.0, 0.0)).gravity_free == ()
    assert arm.with_(gravity=(0.0, 0.0, 0.0)).gravity_free == ("pan", "lift")
    table = robot(
        joint("along", "base", "l1", "1 0 0", "prismatic"), link("l1", 2.0),
        joint("up", "l1", "l2", "0 0 1", "prismatic"), link("l2", 1.0),
    )  # fmt: skip
    assert table.gravity_free == ("along",)
    assert any("along" in line for line in plant_state(table, [0, 0], [0, 0], [0, 0]).remarks)


BALANCED = LINK.format(mass=2.0).replace('"0.3 0 0"', '"0 0 0"')  # the centre of mass on the axis of its joint


@pytest.mark.parametrize(
    ("parts", "mounted", "balanced"),
    [
        ((joint("pan", "base", "l1", "0 0 1"), link("l1", 2.0)), ("pan",), ()),  # vertical: loaded on a wall
        ((joint("spin", "base", "l1", "0 1 0"), f'<link name="l1">{BALANCED}</link>'), (), ("spin",)),
        ((joint("x", "base", "l1", "1 0 0", "prismatic"), link("l1", 2.0)), ("x",), ()),
        # a balanced wheel on a vertical column
        (
            (joint("pan", "base", "l1", "0 0 1"), link("l1", 2.0), joint("wheel", "l1", "l2", "0 1 0"),
             f'<link name="l2">{BALANCED}</link>'),
            ("pan",), ("wheel",),
        ),
        # a wheel with a weight at its rim
        (
            (joint("wheel", "base", "l1", "0 1 0"), f'<link name="l1">{BALANCED}</link>',
             '<joint name="rim" type="fixed"><parent link="l1"/><child link="l2"/></joint>', link("l2", 0.1)),
            (), (),
        ),
        ((joint("roll", "base", "l1", "1 0 0"), link("l1", 2.0)), (), ("roll",)),  # the centre of mass along the axis
    ],
)  # fmt: skip
def test_a_balanced_joint_is_free_of_gravity_in_every_mounting(
    parts: tuple[str, ...], mounted: tuple[str, ...], balanced: tuple[str, ...]
) -> None:
    """ω · (c × m g) = 0 for all g if and only if c lies on the axis."""
    arm = robot(*parts)
    assert arm.balanced == rd.info(arm).balanced == balanced
    assert set(arm.gravity_free) == {*mounted, *balanced}
    for gravity in ((9.81, 0.0, 0.0), (0.0, -9.81, 0.0), (1.0, 2.0, 3.0)):
        turned = rd.Robot(arm.description, arm.edits.with_(arm.joint_names, gravity=gravity))
        assert turned.balanced == balanced
    remarks = plant_state(arm, np.zeros(arm.n), np.zeros(arm.n), np.zeros(arm.n)).remarks
    assert len(remarks) == (bool(mounted) + bool(balanced) if len(arm.gravity_free) < arm.n else 1)


def test_the_order_of_q_is_part_of_the_line_of_a_robot() -> None:
    assert "shoulder_a, shoulder_b" in repr(TWO) and "\n" not in repr(TWO)
    assert "order of q" not in repr(rd.load("ur5"))


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
def test_the_line_of_a_robot_of_many_joints_is_short() -> None:
    assert len(repr(rd.load("talos_full_v2"))) < 400


def test_a_light_finger_on_a_heavy_arm_feels_gravity() -> None:
    """1 µg at 0.3 m below 1500 kg: a torque of 3e-9 N m, 1e-12 of that at the shoulder, is no rounding error."""
    arm = robot(
        joint("shoulder", "base", "l1", "0 1 0"),
        link("l1", 1500.0),
        joint("finger", "l1", "l2", "0 1 0"),
        link("l2", 1e-9),
    )
    assert arm.gravity_free == ()


@pytest.mark.parametrize(
    ("q", "seen"),
    [
        ([90.0, -45.0], True),
        ([90.0, 0.0], True),
        ([0.5, -2.0], False),
        ([3.5, 0.0], False),  # beyond the limits, but within a turn
        ([400.0, 0.0], False),  # beyond the limits as degrees, too
    ],
)
def test_angles_beyond_the_limits_that_are_within_as_degrees_are_remarked(q: list[float], seen: bool) -> None:
    lines = [*degree_lines(TWO.joint_names, TWO.joint_types, np.array(q), TWO.lower, TWO.upper)]
    assert bool(lines) is seen and set(lines) <= set(plant_state(TWO, q, [0, 0], [0, 0]).remarks)


@pytest.mark.parametrize(
    ("owner", "name", "near"),
    [
        (TWO, "inverse_dynamic", "inverse_dynamics"),
        (rd.Plant(TWO), "forward_dynamic", "forward_dynamics"),
        (rd.compiled(TWO), "coriolis", "coriolis_torque"),
        (rd.compiled(rd.Plant(TWO)), "forward_dynamic", "forward_dynamics"),
        (rd.Lagrangian(TWO), "jacob", "jacobian"),
        (TWO.nan_rows, "forward", "forward_dynamics"),
    ],
)
def test_an_unknown_attribute_names_the_nearest(owner: Any, name: str, near: str) -> None:
    with pytest.raises(AttributeError, match=f"nearest:.* {near}"):
        getattr(owner, name)
    assert not hasattr(owner, name) and getattr(owner, name, 7) == 7


@pytest.mark.parametrize("owner", [TWO, rd.Plant(TWO), rd.Lagrangian(TWO), rd.compiled(rd.Plant(TWO))])
def test_values_that_name_the_nearest_are_copied_and_pickled(owner: Any) -> None:
    for twin in (copy.copy(owner), copy.deepcopy(owner), pickle.loads(pickle.dumps(owner))):
        assert type(twin) is type(owner)
    assert not hasattr(owner, "_repr_of_nobody_") and not hasattr(owner, "__array__")


ARM = joint("a", "base", "l1", "0 0 1"), link("l1", 1.0), joint("b", "l1", "l2", "0 1 0"), link("l2", 1.0)


@pytest.mark.parametrize(
    ("parts", "joints"),
    [
        ((joint("first", "base", "l1", "0 0 1"), joint("second", "base", "l1", "0 0 1"), link("l1", 1.0)),
         ("first", "second")),
        ((*ARM, joint("rod", "base", "l2", "0 1 0")), ("b", "rod")),  # a palletiser
        ((joint("rod", "base", "l2", "0 1 0"), *ARM), ("rod", "b")),
        ((*ARM, joint("weld", "base", "l2", "0 1 0", "fixed")), ("b", "weld")),
        ((*ARM, joint("slide", "l1", "l2", "1 0 0", "prismatic")), ("b", "slide")),
    ],
)  # fmt: skip
def test_both_joints_of_a_link_with_two_parents_are_named(parts: tuple[str, ...], joints: tuple[str, str]) -> None:
    with pytest.raises(DescriptionError, match=rf"'{joints[0]}'.*'{joints[1]}'.*mimic"):
        robot(*parts)
