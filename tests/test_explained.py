"""What `help` shows: every public method of every public class has its text, queries with shapes and units."""

from __future__ import annotations

import inspect
import pkgutil
from functools import cached_property
from importlib import import_module
from types import FunctionType

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics
from robot_dyn.foundations import QueryError
from robot_dyn.queries import QUANTITIES

ENGINES = (rd.Robot, rd.Lagrangian, CompiledDynamics)


def public_classes() -> list[type]:
    """All classes of the library without a leading underscore, and without those of private modules."""
    found = []
    for module in pkgutil.walk_packages(rd.__path__, "robot_dyn."):
        members = vars(import_module(module.name)).values()
        found += [each for each in members if inspect.isclass(each) and each.__module__ == module.name]
    return [each for each in found if not each.__name__.startswith("_")]


def members(cls: type) -> list[str]:
    """The public methods and properties that a class defines."""
    kinds = (FunctionType, property, cached_property, classmethod, staticmethod)
    return [name for name, value in vars(cls).items() if not name.startswith("_") and isinstance(value, kinds)]


def text(cls: type, name: str) -> str:
    """What help(cls.name) shows."""
    return inspect.getdoc(inspect.getattr_static(cls, name)) or ""


def test_every_public_class_and_member_has_its_text() -> None:
    silent = [each.__qualname__ for each in public_classes() if not inspect.getdoc(each)]
    silent += [
        f"{each.__qualname__}.{name}" for each in public_classes() for name in members(each) if not text(each, name)
    ]
    assert silent == []


def test_every_public_name_has_its_text() -> None:
    assert [name for name in rd.__all__ if callable(getattr(rd, name)) and not inspect.getdoc(getattr(rd, name))] == []


@pytest.mark.parametrize("engine", ENGINES, ids=lambda each: each.__name__)
def test_every_query_says_shapes_and_units(engine: type) -> None:
    """Of each argument and of the answer."""
    for name in (*QUANTITIES, "total_energy"):
        said = text(engine, name)
        arguments, _, answer = said.partition("Returns:")
        for argument in set(inspect.signature(getattr(engine, name)).parameters) & {"q", "v", "a", "tau"}:
            line = next(line for line in arguments.splitlines() if line.strip().startswith(f"{argument}: "))
            assert "shape (..., n)" in line and "[" in line, (name, line)
        assert "shape (..." in answer and "[" in answer, name


@pytest.mark.parametrize("name", ["planar_2r", "cart_pole", "ur5", "mimic_chain"])
def test_random_configurations_fill_the_limits_and_keep_them(name: str) -> None:
    """Of 2000 uniform draws the extremes miss 2 % of the range with a chance of about e⁻⁴⁰ · 40."""
    robot, rng = rd.load(name), np.random.default_rng(1)
    q = np.array([robot.random_configuration(rng) for _ in range(2000)])
    assert (robot.lower <= q).all() and (q <= robot.upper).all()
    slides = np.array([kind == "prismatic" for kind in robot.joint_types])
    whole = np.where(slides, np.where(np.isfinite(robot.upper - robot.lower), np.inf, 2.0), 2 * np.pi)
    np.testing.assert_allclose(np.ptp(q, axis=0), np.minimum(robot.upper - robot.lower, whole), rtol=0.02)


def test_a_random_configuration_needs_a_generator_and_repeats_with_its_seed() -> None:
    one, two = (rd.load("ur5").random_configuration(np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(one, two)
    with pytest.raises(QueryError, match=r"rng: got .*; give a generator, for example numpy"):
        rd.load("ur5").random_configuration(3)  # pyright: ignore[reportArgumentType]


def test_gravity_and_types_of_joints_are_those_of_file_and_edits() -> None:
    robot = rd.load("cart_pole")
    assert robot.joint_types == ("prismatic", "continuous")
    np.testing.assert_array_equal(robot.gravity, rd.STANDARD_GRAVITY)
    np.testing.assert_array_equal(robot.with_(gravity=(1.0, -2.0, 3.0)).gravity, [1.0, -2.0, 3.0])
    with pytest.raises(ValueError, match="read-only"):
        robot.gravity[0] = 1.0


@pytest.mark.parametrize(
    "engine", [rd.load, lambda name: rd.Lagrangian(rd.load(name)), lambda name: rd.compiled(rd.load(name))]
)
def test_total_energy_changes_by_the_power_of_the_torque(engine) -> None:
    """dE/dt = vᵀ τ; a central difference along the motion, h = 1e-5: error some 200 h² and 1e-16 E/h, below 1e-6."""
    arm = engine("planar_2r")
    q, v, tau = np.random.default_rng(2).normal(size=(3, 2))
    a, h = arm.forward_dynamics(q, v, tau), 1e-5
    after, before = (arm.total_energy(q + s * v + s**2 / 2 * a, v + s * a) for s in (h, -h))
    assert (after - before) / (2 * h) == pytest.approx(v @ tau, abs=1e-6)
    assert arm.total_energy(np.tile(q, (3, 1)), v).shape == (3,)


@pytest.mark.parametrize("engine", [lambda robot: robot, rd.Lagrangian, rd.compiled], ids=["Robot", "own", "compiled"])
def test_the_frame_of_a_joint_is_that_of_its_child_link(engine) -> None:
    """Also of fixed and locked joints."""
    robot = rd.load("ur5").with_(lock={"elbow_joint": 0.4})
    q, v = np.random.default_rng(5).normal(size=(2, robot.n))
    asked = engine(robot)
    for joint, link in (
        ("elbow_joint", "forearm_link"),
        ("wrist_2_joint", "wrist_2_link"),
        ("ee_fixed_joint", "ee_link"),
    ):
        np.testing.assert_array_equal(asked.placement(q, joint), asked.placement(q, link))
        np.testing.assert_array_equal(asked.jacobian(q, joint), asked.jacobian(q, link))
        np.testing.assert_array_equal(asked.jacobian_rate(q, v, joint), asked.jacobian_rate(q, v, link))


def test_a_name_that_a_link_and_a_joint_share_is_the_links() -> None:
    """Joint `a` moves link `b`, and the link `a` is the base: its placement is the identity."""
    urdf = (
        '<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/><origin xyz="0.3 0 0"/>'
        '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>'
        '<joint name="a" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0.2 0"/><axis xyz="0 0 1"/>'
        '<limit effort="1" velocity="1" lower="-1" upper="1"/></joint></robot>'
    )
    robot = rd.Robot.from_text(urdf)
    for engine in (robot, rd.Lagrangian(robot)):
        np.testing.assert_array_equal(engine.placement([0.5], "a"), np.eye(4))


def test_a_wrench_on_the_frame_of_a_joint_is_drawn_on_its_link() -> None:
    robot, force = rd.load("planar_2r"), [1.0, 0.0, 2.0, 0.0, 0.0, 0.0]
    frames, options = ("joint_2", robot.description.joint_frames["joint_2"]), {"engine": "interpreted"}
    plants = [rd.Plant(robot, [rd.effects.ExternalWrench(frame, force)]) for frame in frames]
    runs = [rd.simulate(plant, [0.3, 0.4], duration_s=0.01, **options) for plant in plants]
    np.testing.assert_array_equal(runs[0].q, runs[1].q)
    assert runs[0].wrenches.keys() == runs[1].wrenches.keys()
