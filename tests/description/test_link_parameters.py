"""Mass and inertia of single links: as edits of a robot, and as sweep parameters of rollouts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import EditError, QueryError
from robot_dyn.simulation import robot_of

TREE = rd.load("skew_tree")
LINK = "left_lower"
INERTIA = np.array([[0.021, 0.002, -0.001], [0.002, 0.034, 0.003], [-0.001, 0.003, 0.028]])
STATES = np.random.default_rng(7).normal(size=(3, TREE.n))


def edited(robot: rd.Robot, link: str, mass: float | None = None, inertia: np.ndarray | None = None) -> rd.Robot:
    """The robot of a file in which the numbers of a link are written over; with the edits of the robot."""
    file = etree.fromstring(robot.description.xml)
    inertial = next(each for each in file.iterfind("link") if each.get("name") == link).find("inertial")
    if mass is not None:
        inertial.find("mass").set("value", repr(float(mass)))
    if inertia is not None:
        for key, (i, j) in {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}.items():
            inertial.find("inertia").set(f"i{key}", repr(float(inertia[i, j])))
    made = rd.Robot.from_text(etree.tostring(file, encoding="unicode"))
    return rd.Robot(made.description, robot.edits)


def test_a_link_with_another_mass_and_inertia_is_that_of_an_edited_file() -> None:
    """By both implementations, in M, C, N and inverse dynamics, with a factor on all masses and a payload besides."""
    more = {"mass_scale": 1.3, "payload": rd.Payload("left_tool", 0.7, (0.1, 0.0, 0.2))}
    ours = TREE.with_(masses={LINK: 2.7}, inertias={LINK: INERTIA}, **more)
    theirs = edited(TREE, LINK, 2.7, INERTIA).with_(**more)
    q, v, a = STATES
    for ask in (lambda x: x.M(q), lambda x: x.C(q, v), lambda x: x.N(q), lambda x: x.inverse_dynamics(q, v, a)):
        expected = ask(theirs)
        np.testing.assert_allclose(ask(ours), expected, rtol=1e-14, atol=1e-14)
        np.testing.assert_allclose(ask(rd.Lagrangian(ours)), expected, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(ask(rd.compiled(ours)), expected, rtol=1e-12, atol=1e-12)
    assert np.abs(ours.M(q) - TREE.with_(**more).M(q)).max() > 0.01
    assert ours.total_mass == pytest.approx(theirs.total_mass, rel=1e-14)


def stated(robot: rd.Robot, link: str) -> tuple[float, np.ndarray]:
    """Mass and moments of a link in the file of a robot."""
    file = etree.fromstring(robot.description.xml)
    inertial = next(each for each in file.iterfind("link") if each.get("name") == link).find("inertial")
    x = {key: float(text) for key, text in inertial.find("inertia").items()}
    rows = [["ixx", "ixy", "ixz"], ["ixy", "iyy", "iyz"], ["ixz", "iyz", "izz"]]
    return float(inertial.find("mass").get("value")), np.array([[x[key] for key in row] for row in rows])


def test_a_link_of_another_density_has_its_mass_and_moments_scaled_together(tmp_path) -> None:
    """Mass and moments times 1.7, as in an edited file: in both implementations, with other edits, and written out."""
    mass, inertia = stated(TREE, LINK)
    more = {"mass_scale": 1.3, "payload": rd.Payload("left_lower", 0.7, (0.1, 0.0, 0.2))}
    q, v, a = STATES
    for start, m, moments in (
        (TREE, mass, inertia),
        (TREE.with_(masses={LINK: 2.7}, inertias={LINK: INERTIA}), 2.7, INERTIA),
    ):
        ours = start.with_(mass_scales={LINK: 1.7}, **more)
        theirs = edited(TREE, LINK, 1.7 * m, 1.7 * moments).with_(**more)
        for ask in (lambda x: x.M(q), lambda x: x.C(q, v), lambda x: x.N(q), lambda x: x.inverse_dynamics(q, v, a)):
            expected = ask(theirs)
            np.testing.assert_allclose(ask(ours), expected, rtol=1e-14, atol=1e-14)
            np.testing.assert_allclose(ask(rd.Lagrangian(ours)), expected, rtol=1e-12, atol=1e-12)
            np.testing.assert_allclose(ask(rd.compiled(ours)), expected, rtol=1e-12, atol=1e-12)
        alone = start.with_(masses={LINK: 1.7 * m}, **more)  # the moments of the lighter link stay
        assert np.abs(alone.M(q) - ours.M(q)).max() > 1e-4
        written = rd.load(ours.to_urdf(tmp_path / "scaled.urdf"))
        np.testing.assert_allclose(written.M(q), ours.M(q), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("link", TREE.body_names[:5])
def test_the_difference_of_two_densities_is_the_link_itself(link: str) -> None:
    """M and N are affine in the density of a link: M(2) − M(1) = M(3) − M(2), and 1 changes nothing."""
    q, v, _ = STATES
    name = next(x for x in TREE.frame_names if x == link) if link in TREE.frame_names else LINK
    one, two, three = (TREE.with_(mass_scales={name: x}) for x in (1.0, 2.0, 3.0))
    for of in (lambda arm: arm.M(q), lambda arm: arm.N(q), lambda arm: arm.C(q, v)):
        np.testing.assert_array_equal(of(one), of(TREE))
        np.testing.assert_allclose(of(two) - of(one), of(three) - of(two), rtol=0, atol=1e-12 * np.abs(of(three)).max())
    assert two.total_mass - one.total_mass == pytest.approx(stated(TREE, name)[0], rel=1e-12)


def setup(robot: rd.Robot, model: rd.Robot | None = None) -> rd.Setup:
    plan = rd.control.quintic(STATES[0], STATES[0] + 0.4, 0.2)
    control = None if model is None else rd.control.ComputedTorque(model, plan, kp=50.0, kd=9.0)
    return rd.Setup(
        rd.Plant(robot, [rd.effects.ViscousFriction(0.3)]), STATES[0], STATES[1], duration_s=0.2, controller=control,
        method="RK4", step_s=1e-3, record_every_s=0.02, estimate_error=False,
    )  # fmt: skip


def test_masses_and_inertias_of_links_are_sweep_parameters() -> None:
    """Each run is that of a robot loaded from a file with these numbers; two links and an inertia at once."""
    masses, torso = np.array([1.1, 2.9]), np.array([4.0, 7.5])
    inertias = np.stack([INERTIA, 1.7 * INERTIA])
    params = {f"{LINK}.mass": masses, f"{LINK}.inertia": inertias, "torso.mass": torso}
    runs = rd.rollouts(setup(TREE), vary=params)
    for k in range(2):
        robot = edited(edited(TREE, LINK, masses[k], inertias[k]), "torso", torso[k])
        alone = rd.simulate(setup(robot), engine="interpreted")
        np.testing.assert_allclose(runs.q[k], alone.q, atol=1e-12)
        one = runs[k]
        np.testing.assert_allclose(one.a, alone.a, atol=1e-9)
        np.testing.assert_allclose(one.ledger.kinetic, alone.ledger.kinetic, rtol=1e-10)
    assert np.abs(runs.q[1] - runs.q[0]).max() > 1e-4


def test_mass_scales_of_links_are_sweep_parameters() -> None:
    """Of the arm and of the controller's model, and of a link called "model" whose name could be that of a factor."""
    scales = np.array([0.6, 1.8])
    assert f"{LINK}.mass_scale" in {x.name for x in rd.parameters(setup(TREE)).parameters}
    runs = rd.rollouts(setup(TREE), vary={f"{LINK}.mass_scale": scales})
    models = rd.rollouts(setup(TREE, TREE), vary={f"model.{LINK}.mass_scale": scales})
    for k, factor in enumerate(scales):
        scaled = TREE.with_(mass_scales={LINK: factor})
        np.testing.assert_allclose(runs.q[k], rd.simulate(setup(scaled), engine="interpreted").q, atol=1e-12)
        alone = rd.simulate(setup(TREE, scaled), engine="interpreted")
        np.testing.assert_allclose(models.q[k], alone.q, atol=1e-12)
    named = rd.Robot.from_text(TREE.description.xml.decode().replace(f'"{LINK}"', '"model"'))
    both = rd.rollouts(setup(named, named), vary={"model.mass_scale": scales})
    for k, factor in enumerate(scales):
        alone = rd.simulate(setup(named, named.with_(mass_scale=factor)), engine="interpreted")
        np.testing.assert_allclose(both.q[k], alone.q, atol=1e-12)


def test_the_links_of_a_controllers_model_are_its_own() -> None:
    values = np.array([1.1, 2.9])
    runs = rd.rollouts(setup(TREE, TREE), vary={f"model.{LINK}.mass": values})
    for k, mass in enumerate(values):
        alone = rd.simulate(setup(TREE, edited(TREE, LINK, mass)), engine="interpreted")
        np.testing.assert_allclose(runs.q[k], alone.q, atol=1e-12)


def test_two_parameters_of_one_size_are_not_taken_for_each_other() -> None:
    """Machine code of one that was swept before is not that of another: of one joint, and of two links."""
    swing = rd.load("pendulum")
    base = replace(setup(TREE), plant=rd.Plant(swing), q0=[1.0], v0=[0.0])
    for name, values, change in (
        ("armature", [0.1, 0.3], lambda x: swing.with_(armature=x)),
        ("mass_scale", [0.5, 1.3], lambda x: swing.with_(mass_scale=x)),
        ("rod.mass", [0.5, 1.3], lambda x: swing.with_(masses={"rod": x})),
        ("rod.mass_scale", [0.5, 1.3], lambda x: swing.with_(mass_scales={"rod": x})),
    ):
        runs = rd.rollouts(base, vary={name: values})
        for k, x in enumerate(values):
            alone = rd.simulate(replace(base, plant=rd.Plant(change(x))), engine="interpreted")
            np.testing.assert_allclose(runs.q[k], alone.q, atol=1e-13)


def test_other_masses_are_kept_in_run_files(tmp_path) -> None:
    expected = TREE.with_(masses={LINK: 2.7}, inertias={LINK: INERTIA}, mass_scales={LINK: 1.5, "torso": 0.8})
    run = rd.simulate(setup(expected))
    again = rd.read(run.save(tmp_path / "run"))
    assert run.acting is not None and f"mass 2.7 kg of {LINK}" in run.acting
    assert "mass_scale 0.8 of torso" in run.acting
    np.testing.assert_array_equal(robot_of(again).M(STATES[0]), expected.M(STATES[0]))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"mass_scales": {LINK: 0.0}}, "mass_scale of 'left_lower' must be positive"),
        ({"mass_scales": {"left_lowr": 1.0}}, "mass_scales: no link 'left_lowr'"),
        ({"masses": {LINK: 0.0}}, "mass of 'left_lower' must be positive"),
        (
            {"masses": {"left_lowr": 1.0}},
            "no link 'left_lowr' with a mass in the file; nearest: left_lower",
        ),
        ({"masses": 2.0}, "masses must map link names to values"),
        (
            {"inertias": {LINK: np.diag([1.0, 1.0, 3.0])}},
            "is not physical: its inertia breaks the triangle inequality",
        ),
        ({"inertias": {LINK: np.diag([1.0, -1.0, 1.0])}}, "is not physical: its inertia is indefinite"),
        ({"inertias": {LINK: INERTIA + np.triu(INERTIA)}}, "must be symmetric"),
        ({"inertias": {LINK: 1.0}}, r"shape \(3, 3\)"),
    ],
)
def test_numbers_that_no_link_has_are_refused(change, message: str) -> None:
    with pytest.raises(EditError, match=message):
        TREE.with_(**change)


@pytest.mark.parametrize(
    ("params", "message"),
    [
        ({f"{LINK}.mass": [1.0, 0.0]}, "left_lower.mass must be positive"),
        ({"left_lowr.mass": [1.0]}, "no parameter 'left_lowr.mass'; nearest: left_lower.mass"),
        ({f"{LINK}.inertia": [np.diag([1.0, 1.0, 3.0])]}, "is not physical"),
        ({f"{LINK}.inertia": [1.0]}, "left_lower.inertia"),
    ],
)
def test_swept_numbers_that_no_link_has_are_refused(params, message: str) -> None:
    with pytest.raises(RobotDynError, match=message) as found:
        rd.rollouts(setup(TREE), vary=params)
    assert isinstance(found.value, QueryError | EditError)
