"""Formulas of an arm: the lecture's, the laws of M and C as polynomials, and Pinocchio at random letters."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy as sp

import robot_dyn as rd
from robot_dyn.foundations import MissingExtraError, QueryError, RobotDynWarning
from robot_dyn.tools.symbols import SymbolicEquations, align, symbols
from tests.command import run
from tests.tools.symbols.in_pinocchio import differences, rate_is_C_plus_its_transpose

OWN = Path(__file__).with_name("spatial_3r.urdf")
ARMS = [  # a fifth of those that are printed; the others are in tests.campaigns.symbols
    ("planar_2r", "file"), ("cart_pole", "file"), ("iris", "file"), ("quadruped", "base"), ("flyball_governor", "base"),
    (str(OWN), "file"), (str(OWN), None),
]  # fmt: skip
LONG = [("finger_edu", "file"), ("bolt", "file"), ("hextilt_flying_arm_5", "base"), ("b1", "base"), ("ur5", "base")]


def loaded(name: str) -> rd.Robot:
    """A robot, its warnings ignored."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotDynWarning)
        return rd.load(name)


@pytest.fixture(scope="module", params=[*ARMS, *(pytest.param(arm, marks=pytest.mark.long) for arm in LONG)], ids=str)
def equations(request: pytest.FixtureRequest) -> SymbolicEquations:
    name, letters = request.param
    return symbols(loaded(name), letters)


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
    """Ṁ = Σ ∂M/∂q_k v_k = C + Cᵀ, as polynomials."""
    assert rate_is_C_plus_its_transpose(equations)


def test_formulas_equal_pinocchio_at_random_letters(equations: SymbolicEquations) -> None:
    """A model of Pinocchio with the same letters and rounded angles; both evaluate some hundred terms in float64."""
    assert max(differences(equations, np.random.default_rng(3)).values()) < 1e-12


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


@pytest.mark.parametrize("letters", ["file", "base"])
def test_equations_nobody_reads_are_refused(letters: Any) -> None:
    """The remedies are for the command line and for Python; base parameters are none where they are in use."""
    with pytest.raises(QueryError, match=r"export-c.*c_source") as refused:
        symbols(loaded("skew_tree"), letters).latex()
    assert ("--letters base" in str(refused.value)) == (letters == "file")


HAND = """<robot name="hand"><link name="base"/><link name="arm"/><link name="left"/><link name="right"/>
<joint name="swing" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="close" type="KIND"><parent link="arm"/><child link="left"/><axis xyz="1 0 0"/><origin xyz="0 0 1"/>
<limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
<joint name="follow" type="KIND"><parent link="PARENT"/><child link="right"/><axis xyz="1 0 0"/><origin xyz="0 1 1"/>
<mimic joint="close" multiplier="RATIO" offset="0.25"/><limit lower="-3" upper="3" effort="9" velocity="9"/></joint>
</robot>""".replace(
    '<link name="arm"/><link name="left"/><link name="right"/>',
    "".join(
        f'<link name="{name}"><inertial><origin xyz="0.1 0.2 0.3"/><mass value="2"/><inertia ixx="0.3" iyy="0.4"'
        ' izz="0.5" ixy="0.01" ixz="0" iyz="0"/></inertial></link>'
        for name in ("arm", "left", "right")
    ),
)


def hand(kind: str, parent: str, ratio: str) -> rd.Robot:
    """An arm with a finger and a second one, on the arm or on the finger, that follows the first."""
    return rd.Robot.from_text(HAND.replace("KIND", kind).replace("PARENT", parent).replace("RATIO", ratio))


def test_mimic_joints_are_locked_with_their_drive() -> None:
    """The remedy of the refusal: at 0.7 of the drive, the follower is at −0.5 · 0.7 + 0.25."""
    arm = hand("revolute", "arm", "-0.5")
    with pytest.raises(QueryError, match=r"lock=\{'close': 0.0\}"):
        symbols(arm)
    locked = symbols(arm.with_(lock={"close": 0.7}))
    assert max(locked.difference.values()) < 1e-14
    angles = {meaning.value for name, meaning in locked.letters.items() if name.startswith("alpha")}
    assert angles == {0.7, -0.1}
    assert max(differences(locked, np.random.default_rng(4)).values()) < 1e-12


@pytest.mark.parametrize("letters", ["file", "base", None])
@pytest.mark.parametrize(
    ("kind", "parent", "ratio"),
    [("revolute", "arm", "-1"), ("revolute", "left", "2"), ("prismatic", "arm", "-1"), ("prismatic", "arm", "0.35")],
)
def test_mimic_joints_are_reduced_to_their_drive(kind: str, parent: str, ratio: str, letters: Any) -> None:
    """q_full = S q + s₀, M = Sᵀ M_full S, …: of Pinocchio's matrices of all joints, at random letters."""
    reduced = symbols(hand(kind, parent, ratio), letters)
    assert reduced.n == 2
    assert rate_is_C_plus_its_transpose(reduced)
    assert max(reduced.difference.values()) < 1e-14
    assert max(differences(reduced, np.random.default_rng(5)).values()) < 1e-12


def test_the_written_tex_has_one_equation_for_each_entry(tmp_path: Path) -> None:
    """Braces and environments are balanced, and SymPy's reader of LaTeX is not needed: M, C, N are counted."""
    path = tmp_path / "equations.tex"
    import_module("robot_dyn.tools.symbols.command")  # registers it, also where an older version is installed
    done = run("derive", "planar_2r", "-o", path)
    assert done.returncode == 0, done.stderr
    lines = [line for line in path.read_text().splitlines() if not line.startswith("%")][1:-1]  # in a group
    assert (lines[0], lines[-1]) == (r"\begin{align*}", r"\end{align*}")
    assert [line.split(" &= ")[0] for line in lines[1:-1]] == [
        f"{name}_{{{place}}}" for name, places in (("M", "11 12 22"), ("C", "11 12 21"), ("N", "1 2"))
        for place in places.split()
    ]  # fmt: skip
    for k, line in enumerate(lines[1:-1]):
        assert line.count("&") == 1 and line.endswith(r"\\") == (k < len(lines) - 3)
        depths = np.cumsum([(x == "{") - (x == "}") for x in line])
        assert depths.min() == 0 == depths[-1]
        assert line.count(r"\left(") == line.count(r"\right)")


def test_sums_are_broken_before_a_term_and_long_products_multiplied_out() -> None:
    """A (x₁ + … + x₃₀) has 30 terms, each printed once."""
    a, *x = sp.symbols("a x1:31", real=True)
    first, *others = align([("y", a * sp.Add(*x))]).splitlines()[1:-1]
    assert first.startswith("y &= a x_{1} +") and others and all(line.startswith(r"&\quad + a x_") for line in others)
    printed = re.findall(r"a x_\{(\d+)\}", " ".join([first, *others]))
    assert sorted(map(int, printed)) == [*range(1, 31)]


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex (Debian: texlive-latex-base)")
@pytest.mark.parametrize(
    ("arm", "letters", "matrices"),
    [
        ("planar_2r", "file", "MCN"), ("cart_pole", "file", "MCN"), (str(OWN), "file", "MCN"),
        pytest.param("ur5", "base", "MN", marks=pytest.mark.long),
    ],
)  # fmt: skip
def test_printed_lines_fit_a_page(arm: str, letters: Any, matrices: str, tmp_path: Path) -> None:
    """TeX reports each line that is wider than the column, and each page that is too high."""
    page = symbols(loaded(arm), letters).latex(matrices)
    head = r"\documentclass{article}\usepackage{amsmath}\allowdisplaybreaks\begin{document}"
    (tmp_path / "page.tex").write_text(head + page + r"\end{document}")
    done = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "page.tex"], cwd=tmp_path, capture_output=True, timeout=60, check=False
    )
    assert done.returncode == 0 and b"Overfull" not in done.stdout


def test_latex_of_some_matrices() -> None:
    equations = symbols(rd.load("planar_2r"))
    M, C, N = (equations.latex(name).splitlines()[1:-1] for name in "MCN")
    assert len([*M, *C, *N]) == len(equations.latex().splitlines()) - 2
    assert all(line.startswith("N_") for line in N)
    for wrong in ("", "MK", None):
        with pytest.raises(QueryError):
            equations.latex(wrong)  # pyright: ignore[reportArgumentType]


@pytest.mark.parametrize(("arm", "letters"), [("mimic_chain", "file"), ("planar_2r", "all"), (None, "file")])
def test_wrong_arguments_are_refused_with_a_remedy(arm: str | None, letters: Any) -> None:
    with pytest.raises(QueryError):
        symbols(rd.load(arm) if arm else 3, letters)  # pyright: ignore[reportArgumentType]


def test_missing_sympy_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "sympy", None)
    with pytest.raises(MissingExtraError, match=r"robot-dyn\[symbols\]"):
        symbols(rd.load("planar_2r"))
