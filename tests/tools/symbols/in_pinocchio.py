"""Formulas against Pinocchio, with models built from the same letters and rounded angles, and as polynomials."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import sympy as sp

from robot_dyn.lagrange import Joint, Tree, tree_of
from robot_dyn.tools.symbols import Lettering, Numbers, SymbolicEquations, independent

Matrices = dict[str, np.ndarray]
BASE = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")  # in the order of Pinocchio's parameters


def differences(equations: SymbolicEquations, rng: np.random.Generator, states: int = 3) -> dict[str, float]:
    """Return the largest differences of M, C and N at random letters and states.

    Those of M and N are divided by the largest entry, those of C by max |M| max |v|, because C may be 0. Letters are
    half to twice their values.
    """
    values = {name: meaning.value * rng.uniform(0.5, 2.0) for name, meaning in equations.letters.items()}
    functions = {name: _function(equations, name, values) for name in "MCN"}
    models = [(1.0, _model(equations, values))]
    if (
        equations.lettered == "base"
    ):  # Pinocchio divides by the mass: add one to each body, and subtract the unit masses
        models = [(1.0, _model(equations, values, 1.0)), (-1.0, _model(equations, values, 1.0, 0.0))]
    worst = dict.fromkeys("MCN", 0.0)
    for _ in range(states):
        q, v = rng.uniform(-2.0, 2.0, (2, equations.n))
        both = [(sign, _in_pinocchio(equations, model, q, v)) for sign, model in models]
        for name, function in functions.items():
            ours = np.array(function(*q, *v, *values.values()), dtype=float)
            theirs = sum(sign * matrices[name] for sign, matrices in both)
            scale = max(np.abs(matrices["M" if name == "C" else name]).max() for _, matrices in both)
            scale *= np.abs(v).max() if name == "C" else 1.0
            worst[name] = max(worst[name], float(np.abs(ours - theirs).max() / (scale or 1.0)))
    return worst


def rate_is_C_plus_its_transpose(equations: SymbolicEquations) -> bool:
    """Return True if Ṁ = Σ ∂M/∂q_k v_k and C + Cᵀ are the same polynomials: with ds = c, dc = −s."""
    M, C = equations.polynomials["M"], equations.polynomials["C"]
    ring = next(x.ring for x in M.flat if not isinstance(x, int))
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
    return all(rate[entry] == C[entry] + C.T[entry] for entry in np.ndindex(M.shape))


def _function(equations: SymbolicEquations, name: str, values: dict[str, float]) -> Any:
    names = [f"{x}{k + 1}" for x in "qv" for k in range(equations.n)]
    arguments = [sp.Symbol(x, real=True) for x in (*names, *values)]
    return sp.lambdify(arguments, getattr(equations, name), cse=True)


def _in_pinocchio(equations: SymbolicEquations, model: Any, q: np.ndarray, v: np.ndarray) -> Matrices:
    data = model.createData()
    order = [model.joints[model.getJointId(name)].idx_v for name in equations.arm.joint_names]
    full_q, full_v = np.empty(model.nq), np.empty(model.nv)
    full_q[order], full_v[order] = q, v
    upper = np.triu(pin.crba(model, data, full_q))
    M, C = upper + np.triu(upper, 1).T, pin.computeCoriolisMatrix(model, data, full_q, full_v)
    N = pin.computeGeneralizedGravity(model, data, full_q)
    return {"M": M[np.ix_(order, order)], "C": C[np.ix_(order, order)], "N": N[order][:, None]}


def _model(equations: SymbolicEquations, values: dict[str, float], added: float = 0.0, part: float = 1.0) -> Any:
    """Build a model joint by joint from the lettered tree; base parameters `part` times, and a mass `added` to each."""
    arm, base = equations.arm, equations.lettered == "base"
    lettering = Lettering(named=equations.lettered == "file", with_g=equations.lettered is not None)
    tree = lettering.tree(independent(tree_of(arm.description, arm.edits)), arm.joint_names)
    every = {name: meaning.value for name, meaning in lettering.letters.items()} | values
    every |= {name: values[one] for name in every if name[0] == "I" and (one := name.partition("_")[0]) in values}
    number = Numbers(every).number
    model = pin.Model()
    model.gravity = pin.Motion(np.array([*map(number, tree.gravity), 0.0, 0.0, 0.0]))
    frames = {tree.root: (0, pin.SE3.Identity())}
    for joint in _depth_first(tree, tree.root):
        parent, at = frames[joint.parent]
        at = at * pin.SE3(_turn(*map(number, joint.rpy)), np.array([*map(number, joint.xyz)], dtype=float))
        axis = np.array([*map(number, joint.axis)]) if joint.kind != "fixed" else np.zeros(3)
        if joint.name in arm.joint_names:
            kind = pin.JointModelPrismaticUnaligned if joint.kind == "prismatic" else pin.JointModelRevoluteUnaligned
            parent, at = model.addJoint(parent, kind(axis), at, joint.name), pin.SE3.Identity()
            armature = model.armature
            armature[model.joints[parent].idx_v] = number(joint.armature) * part
            model.armature = armature
            if base:
                k = arm.joint_names.index(joint.name) + 1
                numbers = part * np.array([values.get(f"{name}{k}", 0.0) for name in BASE])
                numbers[0] += added
                model.appendBodyToJoint(parent, pin.Inertia.FromDynamicParameters(numbers), at)
        elif joint.kind != "fixed":
            x = number(joint.locked) * axis
            at = at * (pin.SE3(np.eye(3), x) if joint.kind == "prismatic" else pin.SE3(pin.exp3(x), np.zeros(3)))
        frames[joint.child] = parent, at
    for link in () if base else tree.links:
        body, at = frames[link.name]
        for inertial in link.inertials:
            xx, xy, xz, yy, yz, zz = map(number, inertial.moments)
            R = _turn(*map(number, inertial.rpy))
            inertia = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
            com = np.array([*map(number, inertial.xyz)])
            model.appendBodyToJoint(body, pin.Inertia(number(inertial.mass), com, inertia), at)
    return model


def _depth_first(tree: Tree, link: str) -> Iterator[Joint]:
    """Yield the joints beyond a link in the order of a walk, in which Pinocchio's algorithms expect them."""
    for joint in tree.joints:
        if joint.parent == link:
            yield joint
            yield from _depth_first(tree, joint.child)


def _turn(*rpy: float) -> np.ndarray:
    return pin.rpy.rpyToMatrix(*rpy)
