"""The equations of an arm in letters: M(q) a + C(q, v) v + N(q) = τ as formulas to read and print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.foundations import FLOAT64, QueryError, first_moment, hat, needs, shown
from robot_dyn.lagrange import FORMULAS, Linkage, Pose, linkage_of, tree_of
from robot_dyn.tools.symbols.fourier import expression, shortest
from robot_dyn.tools.symbols.latex import align
from robot_dyn.tools.symbols.letters import MOMENTS, Lettering, Meaning, RoundedAngle, body_numbers, readable
from robot_dyn.tools.symbols.polynomials import Letter, Polynomials, Turn

if TYPE_CHECKING:
    import sympy as sp

READABLE = 600  # terms of M and N: some four pages
BASE = ("M", "MX", "MY", "MZ", *map(str.upper, MOMENTS))  # letters of the base parameters of a body
SMALL = 1e-12  # relative to the largest parameter of a kind: rounding of the regrouping


@final
@dataclass(frozen=True, eq=False)
class SymbolicEquations:
    """M(q), C(q, v) and N(q) of an arm as formulas, in SI units; built by `symbols`.

    Symbols are q1, q2, … and v1, v2, … in the order of the arm's joints, and the letters.

    Attributes:
        arm: The arm.
        lettered: Which numbers are letters: "file", "base" or None.
        letters: Value of each letter and its place in the file, by name.
        rounded: Angles of the file that are read as multiples of π/12.
        polynomials: M (n, n), C (n, n) and N (n,) as reduced polynomials, by name.
        groups: Names of the coordinates of joints with parallel axes.
    """

    arm: Robot
    lettered: Literal["file", "base"] | None
    letters: Mapping[str, Meaning]
    rounded: tuple[RoundedAngle, ...]
    polynomials: Mapping[str, np.ndarray]
    groups: tuple[tuple[str, ...], ...]

    def __reduce__(self) -> tuple[object, ...]:
        return symbols, (self.arm, self.lettered)  # polynomials of flint cannot be pickled

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.arm.joint_names)

    @cached_property
    def M(self) -> sp.Matrix:
        """Mass matrix, (n, n)."""
        return self._matrix("M")

    @cached_property
    def C(self) -> sp.Matrix:
        """Coriolis matrix of the Christoffel symbols, (n, n): Ṁ = C + Cᵀ."""
        return self._matrix("C")

    @cached_property
    def N(self) -> sp.Matrix:
        """Gravity torque, (n, 1)."""
        return self._matrix("N")

    @cached_property
    def terms(self) -> dict[str, int]:
        """Number of terms of M (upper triangle), C and N."""
        upper = np.triu_indices(self.n)
        return {
            name: sum(map(len, (entries[upper] if name == "M" else entries).flat))
            for name, entries in self._terms.items()
        }

    @cached_property
    def difference(self) -> dict[str, float]:
        """Largest difference of M and N to the arm as its file states it, relative to the largest entry.

        It is taken at 20 states, and comes from angles that are read as multiples of π/12.
        """
        import sympy as sp

        q = np.random.default_rng(0).uniform(-2.0, 2.0, (20, self.n))
        arguments = sp.symbols([*(f"q{k + 1}" for k in range(self.n)), *self.letters], real=True)
        values = [meaning.value for meaning in self.letters.values()]
        result = {}
        for name, matrix, exact in (("M", self.M, self.arm.M(q)), ("N", self.N, self.arm.N(q)[..., None])):
            function = sp.lambdify(arguments, matrix, cse=True)
            ours = np.array([function(*row, *values) for row in q], dtype=float)
            result[name] = float(np.abs(ours - exact).max() / (np.abs(exact).max() or 1.0))
        return result

    def latex(self, matrices: str = "MCN") -> str:
        """Return the equations in LaTeX, in an align* environment of amsmath with lines for a page of one column.

        M is symmetric: its upper triangle is printed. Entries that are not printed are zero.

        Args:
            matrices: Letters of the matrices to print, for example "N" for gravity only.

        Raises:
            QueryError: If the equations are too long to read, or a letter is not M, C or N.
        """
        if not isinstance(matrices, str) or not matrices or {*matrices} - {*"MCN"}:
            raise QueryError(f"matrices must be letters of 'MCN', for example 'MN', got {shown(matrices)}")
        if sum(self.terms[name] for name in "MN" if name in matrices) > READABLE:
            raise _unreadable(f"M has {self.terms['M']} terms, N {self.terms['N']}", self.lettered)
        places = [(i, j) for i in range(self.n) for j in range(self.n)]
        entries = {
            "M": [(f"M_{{{i + 1}{j + 1}}}", self.M[i, j]) for i, j in places if i <= j],
            "C": [(f"C_{{{i + 1}{j + 1}}}", self.C[i, j]) for i, j in places],
            "N": [(f"N_{{{i + 1}}}", self.N[i]) for i in range(self.n)],
        }
        return align((left, right) for name in matrices for left, right in entries[name] if right != 0)

    def _repr_latex_(self) -> str:
        return self.latex() if self.terms["M"] + self.terms["N"] <= READABLE else str(self)

    def __str__(self) -> str:
        lines = [f"{self.arm.name}: terms of M {self.terms['M']}, C {self.terms['C']}, N {self.terms['N']}"]
        lines += [f"{name} = {meaning}" for name, meaning in self.letters.items()]
        lines += map(str, self.rounded)
        if self.terms["M"] + self.terms["N"] <= READABLE:
            lines += [f"difference to the file: M {self.difference['M']:.0e}, N {self.difference['N']:.0e}"]
        return "\n".join(lines)

    @cached_property
    def _terms(self) -> dict[str, np.ndarray]:
        result = {}
        for name, entries in self.polynomials.items():
            result[name] = terms = np.empty(entries.shape, dtype=object)
            terms[:] = np.vectorize(lambda x: shortest(x, self.groups), otypes=[object])(entries)
        return result

    def _matrix(self, name: str) -> sp.Matrix:
        import sympy as sp

        ring = self.polynomials["M"].flat[0].ring
        names = tuple(part if (part := _part(x)) in self.letters else x for x in ring.names)
        entries = self._terms[name]
        rows = entries.reshape(self.n, -1)
        return sp.Matrix([[expression(terms, names, self.groups) for terms in row] for row in rows])


def symbols(arm: Robot, letters: Literal["file", "base"] | None = "file") -> SymbolicEquations:
    """Return the equations of an arm as formulas, by the equations of `rd.Lagrangian` on polynomials.

    Angles within 1e-5 rad of a multiple of π/12 are read as that multiple, and reported; other angles become letters.

    Args:
        arm: Arm; mimic joints turn by whole multiples of their drive, or slide with it.
        letters: "file" for a letter for each number of the file; "base" for numbers of the file with a letter for
            gravity and each base inertial parameter, which are fewest; None for numbers only.

    Raises:
        MissingExtraError: If SymPy is not installed.
        QueryError: If a mimic joint turns by a fraction of its drive, `letters` is unknown, or the equations have more
            terms than fit.
    """
    needs("sympy", extra="symbols")
    if not isinstance(arm, Robot):
        raise QueryError(f"arm must be a Robot, for example rd.load('ur5'), got {shown(arm)}")
    if letters is not None and not (isinstance(letters, str) and letters in ("file", "base")):
        raise QueryError(f"letters must be 'file', 'base' or None, got {shown(letters)}")
    tree = readable(tree_of(arm.description, arm.edits))
    lettering = Lettering(named=letters == "file", with_g=letters is not None)
    lettered = lettering.tree(tree, arm.joint_names)
    parameters = _base_parameters(arm) if letters == "base" else {}
    meanings = dict(lettering.letters) | parameters
    coordinates = tuple(f"q{k + 1}" for k in range(len(arm.joint_names)))
    rates = tuple(f"v{k + 1}" for k in range(len(arm.joint_names)))
    scalars = tuple(name for name in meanings if name not in lettering.angles)
    kinds = {joint.name: joint.kind for joint in tree.joints}
    turning = [name for name, joint in zip(coordinates, arm.joint_names, strict=True) if kinds[joint] != "prismatic"]
    sliding = tuple(name for name in coordinates if name not in turning)
    ring = Polynomials((*scalars, *rates, *sliding), (*turning, *lettering.angles))
    linkage = linkage_of(lettered, arm.joint_names, ring)
    if letters == "base":
        numbers, identity = (
            body_numbers(tree, arm.joint_names),
            Pose(np.eye(3, dtype=object), np.zeros(3, dtype=object)),
        )
        names = [body.joint for body in linkage.bodies]
        links = {name: (i, identity, _inertia(parameters, numbers[name], ring)) for i, name in enumerate(names)}
        linkage = replace(linkage, links=links)
    q = np.empty(len(coordinates), dtype=object)
    q[:] = [
        Turn(ring.generator(f"s_{name}"), ring.generator(f"c_{name}")) if name in turning else ring.generator(name)
        for name in coordinates
    ]
    v = ring.array([Letter(name) for name in rates])
    at = linkage.at(q)
    try:
        results: dict[str, Any] = {"M": FORMULAS["M"](at), "C": FORMULAS["C"](at, v), "N": FORMULAS["N"](at)}
    except (OverflowError, SystemError) as error:
        cause: BaseException = error
        while isinstance(cause, SystemError) and cause.__cause__:  # NumPy raises one from the error of an operator
            cause = cause.__cause__
        if not isinstance(cause, OverflowError):
            raise
        raise _unreadable(f"an intermediate result has {cause}", letters) from None
    results = {name: ring.array(entries) for name, entries in results.items()}  # zeros of trees are integers of NumPy
    for entries in results.values():
        entries.setflags(write=False)
    used = _occurring(meanings, results)
    return SymbolicEquations(arm, letters, used, tuple(lettering.rounded), results, _parallel(linkage))


def _unreadable(size: str, letters: str | None) -> QueryError:
    """Return the error for equations that are too long to read."""
    base = "" if letters == "base" else "use base parameters (--letters base, in Python letters='base'), "
    return QueryError(
        f"no readable form: {size}; {base}lock joints (--lock JOINT=VALUE, in Python arm.with_(lock={{...}})), or"
        " export C (robot-dyn export-c, in Python rd.tools.export.c_source(arm))"
    )


def _occurring(letters: Mapping[str, Meaning], polynomials: Mapping[str, np.ndarray]) -> dict[str, Meaning]:
    """Return the letters that occur, with I2 where one moment of a part does."""
    values = [x for entries in polynomials.values() for x in entries.flat]
    occurring = {*values[0].ring.names}.difference(set.intersection(*(set(x.value.unused_gens()) for x in values)))
    used = {name: meaning for name, meaning in letters.items() if occurring & {name, f"s_{name}", f"c_{name}"}}
    parts = [_part(name) for name in used]
    return {part if parts.count(part) == 1 else name: used[name] for name, part in zip(used, parts, strict=True)}


def _part(name: str) -> str:
    """Return I2 of I2_zz, and other letters as they are."""
    return name.partition("_")[0] if name.startswith("I") else name


def _base_parameters(arm: Robot) -> dict[str, Meaning]:
    """Return the base parameters of all bodies, by their letters.

    The letters follow Gautier and Khalil (1990): M mass, MX first moment, XX second moment in the joint's frame.
    """
    # the same angles as in the formulas, in floats
    tree = Lettering(named=False).tree(readable(tree_of(arm.description, arm.edits)), arm.joint_names)
    numbers = regrouped(linkage_of(tree, arm.joint_names, FLOAT64))
    inertias = np.array(numbers.inertias, dtype=float)
    largest = np.abs(inertias).max(axis=0)
    small = SMALL * np.array([[largest[:3, :3].max()] * 3 + [largest[:3, 3:].max()] * 3] * 3
                             + [[largest[:3, 3:].max()] * 3 + [largest[3:, 3:].max()] * 3] * 3)  # fmt: skip
    result: dict[str, Meaning] = {}
    indices = body_numbers(tree, arm.joint_names)
    for body, inertia in zip(numbers.bodies, np.where(np.abs(inertias) > small, inertias, 0.0), strict=True):
        values = (inertia[0, 0], *first_moment(inertia), *inertia[3:, 3:][np.triu_indices(3)])
        where, k = f"base parameter of joint {body.joint!r}", indices[body.joint]
        result |= {f"{name}{k}": Meaning(float(x), where) for name, x in zip(BASE, values, strict=True) if x}
    return result


def _inertia(parameters: Mapping[str, Meaning], k: int, ring: Polynomials) -> np.ndarray:
    """Return 𝓜 of body k in the letters of its base parameters."""
    names = [f"{name}{k}" for name in BASE]
    M, X, Y, Z, XX, XY, XZ, YY, YZ, ZZ = ring.array([Letter(name) if name in parameters else 0 for name in names])
    c, J = hat(np.array([X, Y, Z])), np.array([[XX, XY, XZ], [XY, YY, YZ], [XZ, YZ, ZZ]])
    return np.block([[M * np.eye(3, dtype=object), -c], [c, J]])


def _parallel(linkage: Linkage) -> tuple[tuple[str, ...], ...]:
    """Return chains of turning joints with parallel axes, by the names of their coordinates."""
    chains: dict[int, list[int]] = {}
    for i, body in enumerate(linkage.bodies):
        parent = linkage.bodies[body.parent] if body.parent >= 0 else None
        axis = body.pose.R @ body.axis
        parallel = (
            parent and body.revolute and parent.revolute and (all(axis == parent.axis) or all(axis == -parent.axis))
        )
        chains[i] = [*chains[body.parent], i] if parallel else [i]
    longest = sorted((chain for chain in chains.values() if len(chain) > 1), key=len, reverse=True)
    groups: list[tuple[str, ...]] = []
    for chain in longest:
        names = tuple(dict.fromkeys(f"q{k + 1}" for k in np.argmax(linkage.couplings.S[chain] != 0, axis=1)))
        if not any(set(names) & set(group) for group in groups):  # an angle is in one group, also where arms branch
            groups.append(names)
    return tuple(groups)
