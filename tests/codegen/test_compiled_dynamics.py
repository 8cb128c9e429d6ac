"""Compiled robots against Pinocchio, and against themselves."""

from __future__ import annotations

import pickle
import platform
import re

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.codegen import CompiledDynamics, Kernel, SelfCheckError, SizeWarning, Trace
from robot_dyn.foundations import OverflowedError, QueryError, SingularError
from robot_dyn.lagrange import floored, magnitudes
from robot_dyn.queries import EQUATION
from tests.codegen.arms import ARMS, compiled, states
from tests.long import long
from tests.random_trees import RandomTree, trees

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


@pytest.mark.parametrize(("arm", "quantity"), [*SOME, *long(case for case in CASES if case not in SOME)])
def test_each_quantity_agrees_with_pinocchio(arm: str, quantity: str) -> None:
    """One state: to 1e-12 of the terms added into it; forward dynamics to 8 n u κ more, κ ≤ 1e4 for these."""
    engine, asked = compiled(arm), EQUATION[quantity]
    for row in zip(*states(engine.n, 8), strict=True):
        state = dict(zip(asked.arguments, row, strict=False))
        ours, size = np.asarray(asked.ask(engine, state)), magnitudes(rd.Lagrangian(engine.robot).linkage, row[0])
        terms = np.asarray(asked.terms(size, {name: np.abs(x) for name, x in state.items()}))
        if asked.solves:
            back = engine.robot.inverse_dynamics(row[0], row[1], ours)
            assert np.all(np.abs(back - row[2]) <= 1e-11 * (size.inverse_dynamics(row[1], ours) + np.abs(row[2])))
        else:
            assert np.all(np.abs(ours - asked.ask(engine.robot, state)) <= 1e-12 * floored(terms))


@pytest.mark.parametrize(
    ("arm", "quantity"),
    [*SOME, *long(case for case in CASES if case[0] in ("ur5", "mimic_chain") and case not in SOME)],
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


def test_threads_give_the_same_numbers() -> None:
    """Tiles do not know who computes them."""
    q, v, tau = states(6, 1000)
    one, two = compiled("ur5"), CompiledDynamics(compiled("ur5").original, threads=2, cache=False)
    assert np.array_equal(one.forward_dynamics(q, v, tau), two.forward_dynamics(q, v, tau))


def test_results_go_into_out() -> None:
    """Without a fresh array, for one state and a batch; out may be an argument."""
    engine = compiled("ur5")
    q, v, tau = states(6, 1)[:, 0]
    expected = engine.forward_dynamics(q, v, tau)
    out = np.empty(6)
    assert engine.forward_dynamics(q, v, tau, out=out) is out
    assert np.array_equal(out, expected)
    assert np.array_equal(engine.forward_dynamics(q, v, tau.copy(), out=tau), expected)
    M = np.empty((6, 6), order="F")
    assert engine.M(q, out=M) is M
    assert np.array_equal(M, engine.M(q))
    for wrong in (np.empty(5), np.empty(6, np.float32), [0.0] * 6):
        with pytest.raises(QueryError, match="out must be an array"):
            engine.inverse_dynamics(q, v, tau, out=wrong)  # pyright: ignore[reportArgumentType]


def test_errors_are_those_of_the_robot() -> None:
    """The words of Robot: wrong shapes, NaN by joint, overflow; in a batch as well."""
    engine = compiled("ur5")
    good = np.ones(6)
    nan = np.array([1, 1, np.nan, 1, 1, 1.0])
    for bad in (np.ones(5), nan, np.full(6, np.inf), [1.0, "x"], np.full((3, 6), nan), np.full(6, 1e300), None):
        with pytest.raises(QueryError) as ours:
            engine.inverse_dynamics(good, bad, good)
        with pytest.raises(QueryError) as theirs:
            engine.robot.inverse_dynamics(good, bad, good)
        assert str(ours.value) == str(theirs.value)
    with pytest.raises(QueryError, match="batch axes do not match"):
        engine.inverse_dynamics(np.ones((2, 6)), np.ones((3, 6)), good)
    with pytest.raises(OverflowedError, match="q, v, a are so large"):
        engine.inverse_dynamics(good, np.full(6, 1e200), good)


def test_lists_and_other_dtypes_are_taken() -> None:
    """As Robot does, of integers, float32 and lists."""
    engine = compiled("ur5")
    expected = engine.N(np.ones(6))
    for same in ([1] * 6, np.ones(6, int), np.ones(6, np.float32), np.ones((2, 6))[1], np.ones(12)[::2]):
        assert np.array_equal(engine.N(same), expected)
    assert engine.N(np.empty((0, 6))).shape == (0, 6)


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


@pytest.mark.parametrize(
    ("machine", "packed", "scalar"),
    [
        ("x86_64", "vfmadd213pd\t%zmm3, %zmm1, %zmm2", "vmulsd\t%xmm3, %xmm1, %xmm2"),
        ("x86_64", "mulpd\t%xmm3, %xmm1", "addss\t%xmm3, %xmm1"),
        ("aarch64", "fmla\tv0.2d, v1.2d, v2.2d", "fmul\td0, d1, d2"),
        ("arm64", "fadd.2d\tv0, v1, v2", "fmadd\td0, d1, d2, d3"),
        ("aarch64", "fmul\tz0.d, z1.d, z2.d", "mul\tx0, x1, x2"),
    ],
)
def test_packed_instructions_are_told_from_scalar_ones(machine: str, packed: str, scalar: str) -> None:
    assert re.search(PACKED[machine], packed) and not re.search(PACKED[machine], scalar)


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
    with pytest.warns(SizeWarning, match="M needs 187 instructions, more than the 10 .* Pinocchio computes it"):
        assert np.array_equal(engine.M(q), engine.robot.M(q))
    assert np.array_equal(engine.M(q[0]), engine.robot.M(q[0]))  # said once
    assert engine.served_by("M") == "Pinocchio"
    assert not engine.engine.kernels


def test_a_compiled_robot_can_be_pickled() -> None:
    """As its robot and options; the kernels are made again."""
    engine = compiled("planar_2r")
    again = pickle.loads(pickle.dumps(engine))
    assert np.array_equal(again.potential_energy([0.1, 0.2]), engine.potential_energy([0.1, 0.2]))


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
