"""Formulas of an arm: the lecture's, the laws of M and C as polynomials, and Pinocchio at random letters."""

from __future__ import annotations

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
import sympy as sp

import robot_dyn as rd
from robot_dyn.foundations import MissingExtraError, QueryError
from robot_dyn.lagrange import tree_of
from robot_dyn.tools.symbols import Lettering, Numbers, SymbolicEquations, symbols

OWN = Path(__file__).with_name("spatial_3r.urdf")
ARMS: dict[str, tuple[str, str | None]] = {
    "planar_2r": ("planar_2r", "file"),
    "cart_pole": ("cart_pole", "file"),
    "pendulum": ("pendulum", "file"),
    "spatial_3r": (str(OWN), "file"),
    "spatial_3r in numbers": (str(OWN), None),
    "ur5": ("ur5", "base"),
}


@pytest.fixture(scope="module", params=ARMS)
def equations(request: pytest.FixtureRequest) -> SymbolicEquations:
    name, letters = ARMS[request.param]
    return symbols(rd.load(name), letters)  # pyright: ignore[reportArgumentType]


def test_two_bars_are_the_equations_of_the_lecture() -> None:
    """The closed form of a 2R arm of bars (Murray, Li, Sastry 1994, ex. 4.3), letter by letter."""
    m1, m2, l1, r1, r2, I1, I2, g = sp.symbols("m1 m2 l1 r1 r2 I1 I2 g", real=True)
    q1, q2, v1, v2 = sp.symbols("q1 q2 v1 v2", real=True)
    M12 = m2 * (r2**2 + l1 * r2 * sp.cos(q2)) + I2
    M11 = m1 * r1**2 + I1 + m2 * (l1**2 + r2**2 + 2 * l1 * r2 * sp.cos(q2)) + I2
    h = -m2 * l1 * r2 * sp.sin(q2)
    N2 = g * m2 * r2 * sp.cos(q1 + q2)
    found = symbols(rd.load("planar_2r"))
    for ours, lecture in (
        (found.M, [[M11, M12], [M12, m2 * r2**2 + I2]]),
        (found.C, [[h * v2, h * (v1 + v2)], [-h * v1, 0]]),
        (found.N, [[g * (m1 * r1 + m2 * l1) * sp.cos(q1) + N2], [N2]]),
    ):
        assert sp.expand(ours - sp.Matrix(lecture)) == sp.zeros(2, ours.cols)
    assert set(found.letters) == {"m1", "m2", "l1", "r1", "r2", "I1", "I2", "g"}


def test_rate_of_the_mass_matrix_is_C_plus_its_transpose(equations: SymbolicEquations) -> None:
    """Ṁ = Σ ∂M/∂q_k v_k = C + Cᵀ, as polynomials: with ds = c, dc = −s."""
    M, C = equations.polynomials["M"], equations.polynomials["C"]
    ring = C[0, 0].ring if hasattr(C[0, 0], "ring") else M[0, 0].ring
    rate = 0 * M
    for k in range(equations.n):
        q, v = f"q{k + 1}", ring.generator(f"v{k + 1}")
        for entry, x in np.ndenumerate(M):
            if f"s_{q}" in ring.names:
                s, c = ring.generator(f"s_{q}"), ring.generator(f"c_{q}")
                change = x.derivative(f"s_{q}") * c - x.derivative(f"c_{q}") * s
            else:
                change = x.derivative(q)
            rate[entry] = rate[entry] + change * v
    assert all(rate[entry] == C[entry] + C.T[entry] for entry in np.ndindex(M.shape))


def test_formulas_equal_pinocchio_at_random_letters(equations: SymbolicEquations) -> None:
    """A model of Pinocchio with the same letters and rounded angles; both evaluate some hundred terms in float64."""
    rng = np.random.default_rng(3)
    base = any(name.startswith("ZZ") for name in equations.letters)  # such letters are values of the file's
    values = {
        name: meaning.value if base else meaning.value * rng.uniform(0.5, 2.0)
        for name, meaning in equations.letters.items()
    }
    model, data = pinocchio_model(equations, values)
    for _ in range(3):
        q, v = rng.uniform(-2.0, 2.0, (2, equations.n))
        M, C, N = (evaluated(x, equations, values, q, v) for x in (equations.M, equations.C, equations.N))
        order = [model.joints[model.getJointId(name)].idx_v for name in equations.arm.joint_names]
        full_q, full_v = np.empty(model.nq), np.empty(model.nv)
        full_q[order], full_v[order] = q, v
        expected = pin.crba(model, data, full_q)
        expected = np.triu(expected) + np.triu(expected, 1).T
        for ours, theirs in (
            (M, expected),
            (C, pin.computeCoriolisMatrix(model, data, full_q, full_v)),
        ):
            theirs = theirs[np.ix_(order, order)]
            assert np.abs(ours - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max())
        theirs = pin.computeGeneralizedGravity(model, data, full_q)[order]
        assert np.abs(N[:, 0] - theirs).max() <= 1e-12 * max(1.0, np.abs(theirs).max())


def evaluated(matrix: Any, equations: SymbolicEquations, values: dict[str, float], q: Any, v: Any) -> np.ndarray:
    names = [f"{x}{k + 1}" for x in "qv" for k in range(equations.n)]
    arguments = [sp.Symbol(name, real=True) for name in (*names, *values)]
    return np.array(sp.lambdify(arguments, matrix, cse=True)(*q, *v, *values.values()), dtype=float)


def pinocchio_model(equations: SymbolicEquations, values: dict[str, float]) -> tuple[Any, Any]:
    """Build a model joint by joint from the lettered tree, with the letters' values."""
    named = any(name[0] == "m" for name in values)
    lettering = Lettering(named=named, with_g=named)
    arm = equations.arm
    tree = lettering.tree(tree_of(arm.description, arm.edits), arm.joint_names)
    every = {name: meaning.value for name, meaning in lettering.letters.items()} | values
    every |= {
        name: values[name.partition("_")[0]] for name in every if name[0] == "I" and name.partition("_")[0] in values
    }
    number = Numbers(every).number
    model = pin.Model()
    model.gravity = pin.Motion(np.array([*map(number, tree.gravity), 0.0, 0.0, 0.0]))
    frames = {tree.root: (0, pin.SE3.Identity())}
    for joint in tree.joints:
        parent, at = frames[joint.parent]
        at = at * pin.SE3(
            pin.rpy.rpyToMatrix(*map(number, joint.rpy)), np.array([*map(number, joint.xyz)], dtype=float)
        )
        if joint.name in arm.joint_names:
            axis = np.array([*map(number, joint.axis)])
            kind = pin.JointModelPrismaticUnaligned if joint.kind == "prismatic" else pin.JointModelRevoluteUnaligned
            parent, at = model.addJoint(parent, kind(axis), at, joint.name), pin.SE3.Identity()
            armature = model.armature
            armature[model.joints[parent].idx_v] = number(joint.armature)
            model.armature = armature
        frames[joint.child] = parent, at
    for link in tree.links:
        body, at = frames[link.name]
        for part in link.inertials:
            xx, xy, xz, yy, yz, zz = map(number, part.moments)
            R = pin.rpy.rpyToMatrix(*map(number, part.rpy))
            inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
            model.appendBodyToJoint(
                body, pin.Inertia(number(part.mass), np.array([*map(number, part.xyz)]), inertia), at
            )
    return model, model.createData()


def test_difference_to_the_file_comes_from_rounded_angles(equations: SymbolicEquations) -> None:
    """An angle changes by ε, M by less than 4 n ε of its largest entry; rounding is below 1e-13."""
    most = max((abs(angle.change) for angle in equations.rounded), default=0.0)
    assert max(equations.difference.values()) <= 4 * equations.n * most + 1e-13


def test_each_multiple_of_15_degrees_has_its_sine() -> None:
    ring = symbols(rd.load("planar_2r")).polynomials["M"][0, 0].ring
    for k in range(-30, 30):
        terms = ring._sine(k).terms()
        roots = {ring.names.index("sqrt2"): 2, ring.names.index("sqrt3"): 3}
        value = sum(
            float(x) * math.prod(math.sqrt(r) ** int(key[i]) for i, r in roots.items()) for key, x in terms.items()
        )
        assert abs(value - math.sin(k * math.pi / 12)) < 1e-15


def test_latex_is_printed_and_letters_say_their_place() -> None:
    found = symbols(rd.load("planar_2r"))
    assert found.latex() == found._repr_latex_()
    assert r"\cos{\left(q_{1} + q_{2} \right)}" in found.latex()
    assert found.letters["m2"].value == 1.5 and "bar_2" in found.letters["m2"].where


def test_base_parameters_of_a_ur5_give_six_terms_of_N() -> None:
    found = symbols(rd.load("ur5"), "base")
    assert found.terms["N"] == 6 and found.terms["M"] <= 186


def test_equations_nobody_reads_are_refused() -> None:
    arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.02})
    with pytest.raises(QueryError, match="export"):
        symbols(arm, None).latex()


@pytest.mark.parametrize(("arm", "letters"), [("mimic_chain", "file"), ("planar_2r", "all"), (None, "file")])
def test_wrong_arguments_are_refused_with_a_remedy(arm: str | None, letters: Any) -> None:
    with pytest.raises(QueryError):
        symbols(rd.load(arm) if arm else 3, letters)  # pyright: ignore[reportArgumentType]


def test_missing_sympy_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(MissingExtraError, match=r"robot-dyn\[symbols\]"):
        symbols(rd.load("planar_2r"))
