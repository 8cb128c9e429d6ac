"""Compiled robots against Pinocchio, and compiled plants against the interpreted ones."""

from __future__ import annotations

import gc
import platform
import re
import weakref
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics, CompiledPlant, Kernel, SelfCheckError, SizeWarning, Trace
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.foundations import QueryError, SingularError
from robot_dyn.lagrange import floored, magnitudes
from robot_dyn.queries import EQUATION
from robot_dyn.queries import QUANTITIES as QUERIES
from tests.codegen.arms import ARMS, compiled, states
from tests.long import third
from tests.random_trees import RandomTree, trees
from tests.user_parts import Push

QUANTITIES = list(EQUATION)
HEAVY = {
    "skew_tree": ("M", "inverse_dynamics"),
    "mimic_chain": ("C", "M", "forward_dynamics"),
    "panda": ("forward_dynamics", "inverse_dynamics", "M"),
}
CASES = [(arm, name) for arm in ARMS for name in QUANTITIES if name in HEAVY.get(arm, QUANTITIES)]
SOME = [
    *(("planar_2r", name) for name in QUANTITIES),
    ("ur5", "C"),
    ("panda", "M"),
    ("mimic_chain", "forward_dynamics"),
]
SOME += [("ur5", "forward_dynamics"), ("skew_tree", "inverse_dynamics")]  # six joints, coupled, a tree


@pytest.mark.parametrize(("arm", "quantity"), [*SOME, *third(case for case in CASES if case not in SOME)])
def test_each_quantity_agrees_with_pinocchio(arm: str, quantity: str) -> None:
    """One state: to 1e-12 of the terms added into it; forward dynamics to 8 n u κ more, κ ≤ 1e4 for these."""
    engine, asked = compiled(arm), EQUATION[quantity]
    for row in zip(*states(engine.n, 8), strict=True):
        state = dict(zip(asked.arguments, row, strict=False))
        ours, size = np.asarray(asked.evaluate(engine, state)), magnitudes(rd.Lagrangian(engine.robot).linkage, row[0])
        terms = np.asarray(asked.terms(size, {name: np.abs(x) for name, x in state.items()}))
        if asked.solves:
            back = engine.robot.inverse_dynamics(row[0], row[1], ours)
            assert np.all(np.abs(back - row[2]) <= 1e-11 * (size.inverse_dynamics(row[1], ours) + np.abs(row[2])))
        else:
            assert np.all(np.abs(ours - asked.evaluate(engine.robot, state)) <= 1e-12 * floored(terms))


@pytest.mark.parametrize(
    ("arm", "quantity"),
    [*SOME, *third(case for case in CASES if case[0] in ("ur5", "mimic_chain") and case not in SOME)],
)
def test_a_batch_is_its_states_one_by_one(arm: str, quantity: str) -> None:
    """The same instructions, fused and ordered otherwise: to 1e-13 of the largest; a last tile that overlaps too."""
    engine = compiled(arm)
    arguments = states(engine.n, 150)[: len(EQUATION[quantity].arguments)]
    method = getattr(engine, quantity)
    batch = method(*(x.reshape(3, 50, -1) for x in arguments)).reshape(150, -1)
    single = np.array([np.ravel(method(*row)) for row in zip(*arguments, strict=True)])
    assert np.max(np.abs(batch - single)) <= 1e-13 * np.max(np.abs(single))
    assert np.array_equal(method(*(x[:20] for x in arguments)).reshape(20, -1), batch[:20])
    assert len(method(*(x[:0] for x in arguments))) == 0


AXES = "world_aligned", "body", "world"
FRAMED = [name for name, quantity in QUERIES.items() if quantity.framed]


@pytest.mark.parametrize(("arm", "some"), [("planar_2r", 2), ("ur5", 2), ("skew_tree", 3), ("mimic_chain", 3)])
@pytest.mark.parametrize("name", FRAMED)
def test_a_batch_of_frames_is_machine_code_and_agrees_with_the_lagrangian(arm: str, some: int, name: str) -> None:
    """To 1e-12 of the terms added into an entry, at links and a joint, with all axes; Pinocchio's in the self-check."""
    engine, quantity = compiled(arm), QUERIES[name]
    own, (q, v, _) = rd.Lagrangian(engine.robot), states(engine.n, 40)
    frames = {link: link for link in (engine.robot.frame_names[0], *engine.robot.frame_names[-some:])}
    joint = engine.joint_names[-1]
    frames[joint] = engine.robot.description.joint_frames[joint]
    for frame, link in frames.items():
        for axes in AXES if quantity.directed else ("",):
            options = {"expressed_in": axes} if axes else {}
            ours, theirs = (quantity.evaluate(x, {"q": q, "v": v}, frame, **options) for x in (engine, own))
            rows = [(magnitudes(own.linkage, q[i]), {"q": abs(q[i]), "v": abs(v[i])}) for i in range(len(q))]
            terms = np.array([quantity.terms(*row, link) for row in rows])
            assert np.all(np.abs(ours - theirs) <= 1e-12 * np.maximum(terms, terms.max(axis=0)))
            assert f"{name} of {', '.join((link, *options.values()))}" in engine.instructions


def test_a_batch_of_frames_has_the_errors_and_the_type_of_other_batches() -> None:
    engine, narrow = compiled("ur5"), compiled("ur5", "float32")
    q = states(6, 20)[0]
    q[7, 2] = np.nan
    with pytest.raises(QueryError, match="row 7"):
        engine.placement(q, "tool0")
    rows = engine.nan_rows.placement(q, "tool0")
    assert np.flatnonzero(np.isnan(rows).any(axis=(1, 2))).tolist() == [7]
    for frame in ("tool", ["tool0"], None):
        with pytest.raises(QueryError, match="frame"):
            engine.placement(q[:5], frame)  # pyright: ignore[reportArgumentType]
        with pytest.raises(QueryError, match="frame"):
            engine.placement(q[8:], frame)  # pyright: ignore[reportArgumentType]
    with pytest.raises(QueryError, match="expressed_in"):
        engine.jacobian(q[8:], "tool0", expressed_in="tool")
    for batch in (q[0], q[:5], q[8:]):
        out = np.empty((*batch.shape[:-1], 6, 6), np.float32)
        assert narrow.jacobian(batch, "tool0", out=out) is out
        assert np.max(np.abs(out - engine.jacobian(batch, "tool0"))) <= 2e-5 * np.max(np.abs(out))
    far = q[8:] + 2 * np.pi * 1_600_000
    assert np.max(np.abs(engine.placement(far, "tool0") - engine.robot.placement(far, "tool0"))) < 1e-11


def test_threads_give_the_same_numbers() -> None:
    """Tiles do not know who computes them."""
    q, v, tau = states(6, 1000)
    one, two = compiled("ur5"), CompiledDynamics(compiled("ur5").original, threads=2, cache=False)
    assert np.array_equal(one.forward_dynamics(q, v, tau), two.forward_dynamics(q, v, tau))


def test_results_go_into_out() -> None:
    """Without a fresh array."""
    engine = compiled("ur5")
    q, v, tau = states(6, 1)[:, 0]
    expected = engine.forward_dynamics(q, v, tau)
    out = np.empty(6)
    assert engine.forward_dynamics(q, v, tau, out=out) is out
    assert np.array_equal(out, expected)
    M = np.empty((6, 6), order="F")
    assert engine.M(q, out=M) is M
    assert np.array_equal(M, engine.M(q))
    for wrong in (np.empty(5), np.empty(6, np.float32), [0.0] * 6):
        with pytest.raises(QueryError, match="out must be an array"):
            engine.inverse_dynamics(q, v, tau, out=wrong)  # pyright: ignore[reportArgumentType]


def test_a_singular_robot_has_no_forward_dynamics() -> None:
    """The error of Robot, which names the joint; nothing is compiled for it."""
    with pytest.warns(rd.ModelWarning):
        engine = CompiledDynamics(rd.load("massless_tip"), cache=False)
    with pytest.raises(SingularError, match="'pointer_joint'"):
        engine.forward_dynamics(*np.ones((3, engine.n)))


def test_angles_beyond_the_fast_range_are_exact() -> None:
    """At 10⁷ rad the C library's sine answers: Pinocchio's N at the same q, to 1e-11 of some 50 N m."""
    engine = compiled("ur5")
    q = states(6, 100)[0]
    far = q + 2 * np.pi * 1_600_000
    for each in (far, far[0]):
        assert np.max(np.abs(engine.N(each) - engine.robot.N(each))) < 1e-11


def test_float32_agrees_to_its_precision() -> None:
    """Its u is 5e8 times larger: 2e-5 of the largest entry."""
    narrow, wide = compiled("ur5", "float32"), compiled("ur5")
    q, v, a = states(6, 100)
    for quantity in ("M", "inverse_dynamics"):
        arguments = (q, v, a)[: len(EQUATION[quantity].arguments)]
        ours, theirs = getattr(narrow, quantity)(*arguments), getattr(wide, quantity)(*arguments)
        assert ours.dtype == np.float32
        assert np.max(np.abs(ours - theirs)) <= 2e-5 * np.max(np.abs(theirs))


@pytest.mark.parametrize("arm", ["ur5"])
def test_derivatives_agree_with_pinocchio(arm: str) -> None:
    """pin.computeABADerivatives shares neither M⁻¹ ∂ID nor the trace: 1e-10 of the largest, κ(M) being 1e3."""
    engine = compiled(arm)
    q, v, tau = states(engine.n, 3)
    ours = engine.forward_dynamics_derivatives(q, v, tau)
    data = engine.robot.model.createData()
    for i in range(3):
        theirs = pin.computeABADerivatives(engine.robot.model, data, q[i], v[i], tau[i])
        alone = engine.forward_dynamics_derivatives(q[i], v[i], tau[i])
        for one, same, other in zip(ours, alone, theirs, strict=True):
            assert np.max(np.abs(one[i] - other)) <= 1e-10 * np.max(np.abs(other))
            assert np.max(np.abs(same - other)) <= 1e-10 * np.max(np.abs(other))


def test_derivatives_of_coupled_joints_are_differences_of_forward_dynamics() -> None:
    """∂a/∂x to the O(h²) and u/h of central differences, h = 1e-6: so 1e-8 of a."""
    engine = compiled("mimic_chain")
    q, v, tau = states(engine.n, 1)[:, 0]
    ours = engine.forward_dynamics_derivatives(q, v, tau)
    for which in range(3):
        for k in range(engine.n):
            state = [q, v, tau]
            ends = []
            for h in (1e-6, -1e-6):
                state[which] = (q, v, tau)[which] + h * np.eye(engine.n)[k]
                ends.append(engine.robot.forward_dynamics(*state))
            slope = (ends[0] - ends[1]) / 2e-6
            assert np.max(np.abs(ours[which][:, k] - slope)) <= 1e-8 * (1 + np.max(np.abs(ends)))


# Instructions on several doubles at once, by the architecture that `platform.machine()` names.
PACKED = {
    "x86_64": r"(mul|add|sub)\w*pd\b.*[xyz]mm",
    "aarch64": r"\bf(mul|add|sub|mla|mls)(\.2d\s|\s+(v\d+\.2d|z\d+\.d))",
}
PACKED |= {"AMD64": PACKED["x86_64"], "arm64": PACKED["aarch64"]}


@pytest.mark.skipif(
    platform.machine() not in PACKED, reason="an architecture whose vector instructions are not known here"
)
def test_the_batch_kernel_is_vectorised() -> None:
    """Vector registers multiply packed numbers; a silent fall back to scalar code would show none."""
    engine = compiled("ur5")
    engine.forward_dynamics(*states(6, 100))
    kernel: Kernel = engine.engine.kernels["forward_dynamics"]
    packed = [line for line in kernel.assembly().splitlines() if re.search(PACKED[platform.machine()], line)]
    assert len(packed) > 300


def test_a_wrong_kernel_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """A trace with one entry of 1e-9 too much is not handed out, and the report says by how much."""
    traced = Trace.quantity

    def wrong(self: Trace, name: str) -> object:
        from dataclasses import replace

        import casadi as ca

        right = traced(self, name)
        q = ca.SX.sym("q", 6)
        return replace(right, function=ca.Function("f", [q], [right.function(q) * (1 + 1e-9)]))

    monkeypatch.setattr(Trace, "quantity", wrong)
    engine = CompiledDynamics(compiled("ur5").original, cache=False)
    for q in (np.ones(6), np.ones((100, 6))):
        with pytest.raises(SelfCheckError, match=r"compiled N .* is not Pinocchio's .* of its terms"):
            engine.N(q)


def test_the_fewest_instructions_win() -> None:
    """Every formulation is counted, and the least served."""
    engine = compiled("ur5")
    engine.M(np.ones(6))
    counts = engine.instructions["M"]
    assert set(counts) == {"recursion", "energies"}
    assert engine.served_by("M") == min(counts, key=counts.__getitem__) == next(iter(counts))
    assert counts["recursion"] < 200
    assert len(engine.right_angles) == 5  # the UR5's 1.57079632679


def test_past_the_size_where_compiling_pays_pinocchio_serves(monkeypatch: pytest.MonkeyPatch) -> None:
    """And it is said, in a warning and by `served_by`."""
    monkeypatch.setattr("robot_dyn.codegen.engine.LARGEST_KERNEL", 10)
    engine = CompiledDynamics(compiled("ur5").original, cache=False)
    q = states(6, 20)[0]
    with pytest.warns(SizeWarning, match="M needs 187 instructions, too many .*10.* Pinocchio computes it"):
        assert np.array_equal(engine.M(q), engine.robot.M(q))
    assert np.array_equal(engine.M(q[0]), engine.robot.M(q[0]))  # said once
    assert engine.served_by("M") == "Pinocchio"
    assert not engine.engine.kernels


@settings(max_examples=4)
@given(trees(most_joints=4), st.integers(0, 2**32 - 1))
def test_random_trees_agree(tree: RandomTree, seed: int) -> None:
    """Any axis, branches, couplings: each kernel passes its self check, and a state of our own agrees."""
    robot = tree.robot
    engine = CompiledDynamics(robot, cache=False)
    q, v, a = np.random.default_rng(seed).normal(size=(3, robot.n))
    ours, theirs = engine.inverse_dynamics(q, v, a), engine.robot.inverse_dynamics(q, v, a)
    size = magnitudes(rd.Lagrangian(engine.robot).linkage, q).inverse_dynamics(v, a)
    assert np.all(np.abs(ours - theirs) <= 1e-12 * size)
    back = engine.robot.inverse_dynamics(q, v, engine.forward_dynamics(q, v, ours))
    assert np.all(np.abs(back - ours) <= 1e-9 * size)


ROBOT = rd.load("planar_2r")
WINDOW = rd.effects.ExternalWrench(ROBOT.frame_names[-1], [1, 2, 3, 0.1, 0.2, 0.3], start_s=0.2, end_s=0.7)


def kick(t: float, q: Any, v: Any) -> Any:
    """A force with an if, which is in the kernel and not decided while tracing, and a comparison of arrays."""
    return np.where(v > 0, 1.0, -2.0) * q if t > 0.5 and q[..., 0] < 1 else 0 * q


EFFECTS: dict[str, list[Any]] = {
    "viscous": [rd.effects.ViscousFriction([0.3, 0.1])],
    "coulomb": [rd.effects.RegularisedCoulombFriction(0.5, 0.1)],
    "spring": [rd.effects.Spring(2.0, 0.1)],
    "stops": [*rd.effects.joint_stops(-1.0, 1.0)],
    "wrench": [WINDOW],
    "bound": [rd.effects.EffortLimit(5.0)],
    "none": [],
    "branches": [Push(kick)],
}
EFFECTS["all"] = [effect for effects in EFFECTS.values() for effect in effects]


def plant(effects: list[Any]) -> CompiledPlant:
    compiled = rd.compiled(rd.Plant(ROBOT, effects), cache=False)
    assert isinstance(compiled, CompiledPlant)
    return compiled


@pytest.mark.parametrize("name", EFFECTS)
def test_a_compiled_plant_is_the_interpreted_one(name: str) -> None:
    """At times before, within and after a window, inside the stops and beyond: 1e-12 of the largest, κ(M) small."""
    compiled = plant(EFFECTS[name])
    q, v, u = states(2, 12)
    for t in (0.0, 0.3, 0.9):
        for method in ("N", "torque", "forward_dynamics"):
            rest = (9 * u,) if method == "forward_dynamics" else ()
            ours, theirs = (
                np.array([getattr(each, method)(*row, t=t) for row in zip(q, v, *rest, strict=True)])
                for each in (compiled, compiled.interpreted)
            )
            assert np.max(np.abs(ours - theirs)) <= 1e-12 * np.max(np.abs(theirs))


def test_a_batch_of_a_plant_is_its_states_one_by_one() -> None:
    """With tanh, branches and stops in the tile; each state may have its own time."""
    compiled = plant(EFFECTS["all"])
    q, v, u = states(2, 100)
    t = np.linspace(0, 1, 100)
    batch = compiled.forward_dynamics(q, v, u, t=t)
    single = np.array([compiled.forward_dynamics(*row, t=time) for time, *row in zip(t, q, v, u, strict=True)])
    assert np.max(np.abs(batch - single)) <= 1e-12 * np.max(np.abs(single))
    back = compiled.inverse_dynamics(q, v, batch, t=t)
    assert np.max(np.abs(back - np.clip(u, -5, 5))) <= 1e-9


def test_plants_that_differ_in_numbers_share_their_machine_code(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other coefficients, an infinite limit, gravity and a payload: nothing is compiled, and each answer is its own."""
    q, v, u = states(2, 40)
    t = np.linspace(0, 1, 40)

    def answers(damping: Any, limit: Any, gravity: float, mass: float) -> None:
        robot = ROBOT.with_(gravity=(0, 0, gravity), payload=rd.Payload(ROBOT.frame_names[-1], mass, (0.1, 0, 0)))
        effects = [
            rd.effects.ViscousFriction(damping),
            rd.effects.EffortLimit(limit),
            rd.effects.RegularisedCoulombFriction(mass, 0.1),
        ]
        compiled = rd.compiled(rd.Plant(robot, effects), cache=False)
        expected = np.array(
            [compiled.interpreted.forward_dynamics(*row, t=time) for time, *row in zip(t, q, v, u, strict=True)]
        )
        batch = compiled.forward_dynamics(q, v, u, t=t)
        single = [compiled.forward_dynamics(*row, t=time) for time, *row in zip(t, q, v, u, strict=True)]
        for ours in (batch, single):
            assert np.max(np.abs(ours - expected)) <= 1e-12 * np.max(np.abs(expected))

    answers([0.3, 0.1], [0.2, np.inf], -9.81, 0.5)
    monkeypatch.setattr(machine_code, "object_file", None)  # from here on nothing can be compiled
    answers(0.7, [np.inf, 3.0], -1.62, 1.5)
    answers([0.0, 2.0], 0.6, -9.81, 0.1)


def test_what_is_off_costs_no_instruction() -> None:
    """A plant without effects has the instructions of the robot."""
    bare, full = plant([]), plant(EFFECTS["all"])
    for engine in (bare, full):
        engine.forward_dynamics(*np.ones((3, 2)), t=0.0)
    (without,), (with_all,) = (each.instructions["forward_dynamics"].values() for each in (bare, full))
    assert without == min(Trace(bare.dynamics.robot).quantity("forward_dynamics").counts.values())
    assert with_all > without
    assert set(full.instructions_by_effect) == {effect.name for effect in full.plant.forces}


def test_machine_code_does_not_keep_the_plant_that_it_was_made_for() -> None:
    """What stays loaded is known by its instructions alone."""
    made = plant([rd.effects.ViscousFriction([0.31, 0.12])])
    q, v, u = states(2, 12)
    made.forward_dynamics(q[0], v[0], u[0], t=0.0)
    made.forward_dynamics(q, v, u, t=0.0)
    left = weakref.ref(made.plant), weakref.ref(made.plant.effects[0]), weakref.ref(made.engine)
    del made
    gc.collect()
    assert [each() for each in left] == [None, None, None]


def test_numpy_clip_is_the_minimum_of_a_maximum() -> None:
    """Of six joints with two bounds each: as branches these would be 3⁶."""
    most = np.array([6.0] * 3 + [1.2] * 3)
    law = rd.control.ControlLaw(lambda t, q, v: np.clip(-40.0 * (q - 0.3) - 10.0 * v, -2.0, most), 6)
    setup = rd.Setup(rd.Plant(rd.load("ur5")), [0.1] * 6, duration_s=0.05, method="RK4", controller=law)
    interpreted, compiled = (rd.simulate(setup, engine=each) for each in ("interpreted", "compiled"))
    assert compiled.statistics.engine == "compiled"
    np.testing.assert_allclose(compiled.q, interpreted.q, rtol=0, atol=1e-12)
    assert (interpreted.u.max(axis=0) == most).any(), "a bound acts"
