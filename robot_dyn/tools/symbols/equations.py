"""The equations of an arm in letters: M(q) a + C(q, v) v + N(q) = τ as formulas to read and print."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.codegen.trace.base_parameters import regrouped
from robot_dyn.foundations import QueryError, first_moment, needs, shown
from robot_dyn.lagrange import FORMULAS, Linkage, Pose, linkage_of, tree_of
from robot_dyn.tools.symbols.fourier import expression, shortest
from robot_dyn.tools.symbols.latex import align
from robot_dyn.tools.symbols.letters import MOMENTS, Lettering, Meaning, RoundedAngle, body_numbers, readable
from robot_dyn.tools.symbols.polynomials import Letter, Numbers, Polynomials, Turn

if TYPE_CHECKING:
    import sympy as sp

READABLE = 600  # terms of M and N: some four pages
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
        values = [meaning.value for meaning in self.letters.values()]
        result = {}
        for name, matrix, exact in (("M", self.M, self.arm.M(q)), ("N", self.N, self.arm.N(q)[..., None])):
            symbols = [[sp.Symbol(f"q{k + 1}", real=True) for k in range(self.n)], *_symbols(self.letters)]
            function = sp.lambdify(symbols, matrix, cse=True)
            ours = np.array([function(row, *values) for row in q], dtype=float)
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

        names = next(x for x in self.polynomials["M"].flat if not isinstance(x, int)).ring.names
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
    meanings = dict(lettering.letters)
    inertias = _base_inertias(arm) if letters == "base" else {}
    for values, _ in inertias.values():
        meanings |= values
    coordinates = tuple(f"q{k + 1}" for k in range(len(arm.joint_names)))
    rates = tuple(f"v{k + 1}" for k in range(len(arm.joint_names)))
    scalars = tuple(name for name in meanings if name not in lettering.angles)
    kinds = {joint.name: joint.kind for joint in tree.joints}
    turning = [name for name, joint in zip(coordinates, arm.joint_names, strict=True) if kinds[joint] != "prismatic"]
    sliding = tuple(name for name in coordinates if name not in turning)
    ring = Polynomials((*scalars, *rates, *sliding), (*turning, *lettering.angles))
    linkage = linkage_of(lettered, arm.joint_names, ring)
    if letters == "base":
        links = {
            name: (i, Pose(np.eye(3, dtype=object), np.zeros(3, dtype=object)), ring.array(inertias[name][1]))
            for i, name in enumerate(body.joint for body in linkage.bodies)
        }
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
        cause: BaseException | None = error
        while isinstance(cause, SystemError):  # products of NumPy's objects raise one from the error of an operator
            cause = cause.__cause__
        if cause is None:
            raise
        raise _unreadable(f"an intermediate result has {cause}", letters) from None
    return _named(SymbolicEquations(arm, letters, meanings, tuple(lettering.rounded), results, _parallel(linkage)))


def _unreadable(size: str, letters: str | None) -> QueryError:
    """Return the error for equations that are too long to read."""
    base = "" if letters == "base" else "use base parameters (--letters base, in Python letters='base'), "
    return QueryError(
        f"no readable form: {size}; {base}lock joints (--lock JOINT=VALUE, in Python arm.with_(lock={{...}})), or"
        " export C (robot-dyn export-c, in Python rd.tools.export.c_source(arm))"
    )


def _named(equations: SymbolicEquations) -> SymbolicEquations:
    """Return the equations without letters that do not occur, and with I2 where one moment of a part occurs."""
    ring = next(x for x in equations.polynomials["M"].flat if not isinstance(x, int)).ring
    polynomials = [x for entries in equations.polynomials.values() for x in entries.flat if not isinstance(x, int)]
    degrees = np.max([x.value.degrees() for x in polynomials], axis=0)
    used = {name for name, degree in zip(ring.names, degrees, strict=True) if degree}
    used |= {name[2:] for name in used if name[:2] in ("s_", "c_")}
    letters = {name: meaning for name, meaning in equations.letters.items() if name in used}
    moments = [name for name in letters if name[0] == "I" and name.partition("_")[2] in MOMENTS]
    parts = [name.partition("_")[0] for name in moments]
    names = {name: part for name, part in zip(moments, parts, strict=True) if parts.count(part) == 1}
    renamed = Polynomials(tuple(str(names.get(name, name)) for name in ring.letters), ring.angles)
    converted = {
        key: np.vectorize(renamed.of, otypes=[object])(entries) for key, entries in equations.polynomials.items()
    }
    for entries in converted.values():
        entries.setflags(write=False)
    letters = {names.get(name, name): meaning for name, meaning in letters.items()}
    return replace(equations, letters=letters, polynomials=converted)


def _base_inertias(arm: Robot) -> dict[str, tuple[dict[str, Meaning], list[list[Any]]]]:
    """Return the letters of each body's base parameters, and its 𝓜 in them, by joint.

    The letters follow Gautier and Khalil (1990): M mass, MX first moment, XX second moment in the joint's frame.
    """
    lettering = Lettering(named=False)  # the same angles as in the formulas, in floats
    tree = lettering.tree(readable(tree_of(arm.description, arm.edits)), arm.joint_names)
    numbers = regrouped(linkage_of(tree, arm.joint_names, Numbers({k: m.value for k, m in lettering.letters.items()})))
    inertias = np.array(numbers.inertias, dtype=float)
    largest = np.abs(inertias).max(axis=0)
    small = SMALL * np.array([[largest[:3, :3].max()] * 3 + [largest[:3, 3:].max()] * 3] * 3
                             + [[largest[:3, 3:].max()] * 3 + [largest[3:, 3:].max()] * 3] * 3)  # fmt: skip
    result = {}
    indices = body_numbers(tree, arm.joint_names)
    for body, inertia in zip(numbers.bodies, np.where(np.abs(inertias) > small, inertias, 0.0), strict=True):
        k = indices[body.joint]
        values = {f"M{k}": inertia[0, 0]}
        values |= dict(zip((f"MX{k}", f"MY{k}", f"MZ{k}"), first_moment(inertia), strict=True))
        pairs = dict(zip(MOMENTS, zip(*np.triu_indices(3), strict=True), strict=True))
        values |= {f"{name.upper()}{k}": inertia[3 + i, 3 + j] for name, (i, j) in pairs.items()}
        symbols = {name: Letter(name) if value else 0 for name, value in values.items()}
        M, X, Y, Z, XX, XY, XZ, YY, YZ, ZZ = symbols.values()
        minus = {
            name: replace(x, negative=True) if isinstance(x, Letter) else 0
            for name, x in zip("XYZ", (X, Y, Z), strict=True)
        }
        rows = [
            [M, 0, 0, 0, Z, minus["Y"]], [0, M, 0, minus["Z"], 0, X], [0, 0, M, Y, minus["X"], 0],
            [0, minus["Z"], Y, XX, XY, XZ], [Z, 0, minus["X"], XY, YY, YZ], [minus["Y"], X, 0, XZ, YZ, ZZ],
        ]  # fmt: skip
        where = f"base parameter of joint {body.joint!r}"
        result[body.joint] = {name: Meaning(float(x), where) for name, x in values.items() if x}, rows
    return result


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


def _symbols(names: Mapping[str, Meaning]) -> list[Any]:
    import sympy as sp

    return [sp.Symbol(name, real=True) for name in names]
