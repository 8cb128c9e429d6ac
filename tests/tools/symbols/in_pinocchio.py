"""Formulas against Pinocchio, with models built from the same letters and rounded angles, and as polynomials."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import sympy as sp

from robot_dyn.lagrange import Joint, Tree, tree_of
from robot_dyn.tools.symbols import Component, Lettering, SymbolicEquations, body_numbers, readable

Matrices = dict[str, np.ndarray]
BASE = ("M", "MX", "MY", "MZ", "XX", "XY", "YY", "XZ", "YZ", "ZZ")  # in the order of Pinocchio's parameters


def differences(equations: SymbolicEquations, rng: np.random.Generator, states: int = 3) -> dict[str, float]:
    """Return the largest differences of M, C and N at random letters and states.

    Those of M are divided by the largest entry, those of C by max |M| max |v|, those of N by max |N| + max |M| g/m:
    C and N may be 0. Letters are half to twice their values.
    """
    values = {name: meaning.value * rng.uniform(0.5, 2.0) for name, meaning in equations.letters.items()}
    functions = {name: _function(equations, name, values) for name in "MCN"}
    models = [(1.0, _model(equations, values))]
    if equations.lettered == "base":  # Pinocchio divides by the mass: add one to each body, subtract the unit masses
        models = [(1.0, _model(equations, values, 1.0)), (-1.0, _model(equations, values, 1.0, 0.0))]
    tree, number = _lettered(equations, values)
    worst = dict.fromkeys("MCN", 0.0)
    for _ in range(states):
        q, v = rng.uniform(-2.0, 2.0, (2, equations.n))
        both = [(sign, _in_pinocchio(equations.arm.joint_names, tree, number, model, q, v)) for sign, model in models]
        for name, function in functions.items():
            ours = np.array(function(*q, *v, *values.values()), dtype=float)
            theirs = sum(sign * matrices[name] for sign, matrices in both)
            largest = {key: max(np.abs(matrices[key]).max() for _, matrices in both) for key in "MN"}
            scale = largest["M"] * {"M": 1.0, "C": np.abs(v).max(), "N": 9.81}[name] + (name == "N") * largest["N"]
            worst[name] = max(worst[name], float(np.abs(ours - theirs).max() / scale))
    return worst


def rate_is_C_plus_its_transpose(equations: SymbolicEquations) -> bool:
    """Return True if Ṁ = Σ ∂M/∂q_k v_k and C + Cᵀ are the same polynomials: with ds = c, dc = −s."""
    M, C = equations.polynomials["M"], equations.polynomials["C"]
    ring = M[0, 0].ring
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


def _in_pinocchio(
    names: tuple[str, ...], tree: Tree, number: Callable[[Any], float], model: Any, q: np.ndarray, v: np.ndarray
) -> Matrices:
    """Return M, C and N of the coordinates: those of all joints, reduced by q_full = S q + s₀."""
    data = model.createData()
    mimics = {joint.name: joint.mimic for joint in tree.joints if joint.mimic}
    S, full_q = np.zeros((model.nv, len(q))), np.empty(model.nq)
    for joint in map(str, [*model.names][1:]):
        source, ratio, offset = joint, 1.0, 0.0
        while source in mimics:
            offset += ratio * number(mimics[source].offset)
            ratio *= float(mimics[source].multiplier)
            source = mimics[source].source
        row = model.joints[model.getJointId(joint)].idx_v
        S[row, names.index(source)] = ratio
        full_q[row] = S[row] @ q + offset
    upper = np.triu(pin.crba(model, data, full_q))
    M, C = upper + np.triu(upper, 1).T, pin.computeCoriolisMatrix(model, data, full_q, S @ v)
    N = pin.computeGeneralizedGravity(model, data, full_q)
    return {"M": S.T @ M @ S, "C": S.T @ C @ S, "N": (S.T @ N)[:, None]}


def _lettered(equations: SymbolicEquations, values: dict[str, float]) -> tuple[Tree, Callable[[Any], float]]:
    """Return the lettered tree, and the function that converts its numbers."""
    arm = equations.arm
    lettering = Lettering(named=equations.lettered == "file", with_g=equations.lettered is not None)
    tree = lettering.tree(readable(tree_of(arm.description, arm.edits)), arm.joint_names)
    every = {name: meaning.value for name, meaning in lettering.letters.items()} | values
    every |= {name: values[one] for name in every if name[0] == "I" and (one := name.partition("_")[0]) in values}

    def number(literal: Any) -> float:
        if isinstance(literal, Component):
            angles = {
                name: replace(x, value=number(x))
                for name, x in (("azimuth", literal.azimuth), ("elevation", literal.elevation))
            }
            return float(replace(literal, **angles))
        return float(replace(literal, value=every[name]) if (name := getattr(literal, "name", "")) else literal)

    return tree, number


def _model(equations: SymbolicEquations, values: dict[str, float], added: float = 0.0, part: float = 1.0) -> Any:
    """Build a model joint by joint from the lettered tree; base parameters `part` times, and a mass `added` to each."""
    arm, base = equations.arm, equations.lettered == "base"
    tree, number = _lettered(equations, values)
    bodies = body_numbers(tree, arm.joint_names)
    model = pin.Model()
    model.gravity = pin.Motion(np.array([*map(number, tree.gravity), 0.0, 0.0, 0.0]))
    frames = {tree.root: (0, pin.SE3.Identity())}
    for joint in _depth_first(tree, tree.root):
        parent, at = frames[joint.parent]
        at = at * pin.SE3(_turn(*map(number, joint.rpy)), np.array([*map(number, joint.xyz)], dtype=float))
        axis = np.array([*map(number, joint.axis)]) if joint.kind != "fixed" else np.zeros(3)
        if joint.name in bodies:
            kind = pin.JointModelPrismaticUnaligned if joint.kind == "prismatic" else pin.JointModelRevoluteUnaligned
            parent, at = model.addJoint(parent, kind(axis), at, joint.name), pin.SE3.Identity()
            armature = model.armature
            armature[model.joints[parent].idx_v] = number(joint.armature) * part
            model.armature = armature
            if base:
                k = bodies[joint.name]
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
