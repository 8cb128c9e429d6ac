"""Exported C: built without a warning, equal to Pinocchio, within proven bounds; no heap, no static data, no double."""

from __future__ import annotations

import ctypes
import json
import re
import shutil
import warnings
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from flint import arb, ctx

import robot_dyn as rd
from robot_dyn.codegen import Kind, Op, Program, program_of
from robot_dyn.foundations import ExportError, QueryError, RobotDynWarning
from robot_dyn.tools.export import CSource, c_source
from robot_dyn.tools.export.equations import QUANTITIES, equations_of
from robot_dyn.tools.export.operations import evaluated, math_functions, statements
from robot_dyn.tools.export.rounding import UNITS, StatesOfArm, bound, box_of
from tests.command import ROOT, run
from tests.long import stress, third
from tests.promised import check_document
from tests.tools.export.c_program import HOST, STRICT, TARGETS, WRITABLE, call, library, self_test, symbols

QUICK = (  # a fifth of the catalog: chains, trees, slides, coupled joints
    "cart_pole", "double_pendulum", "flyball_governor", "light_tip", "massless_tip", "mimic_chain", "panda", "pendulum",
    "planar_2r", "simple_pendulum", "skew_tree", "so100", "twodofs", "ur3_gripper", "ur5", "z1",
)  # fmt: skip
SLOW_IN_FLOAT = {"light_tip", "mimic_chain", "panda", "skew_tree", "so100", "z1"}  # in tests.campaigns.exported_c
OTHERS = [name for name in rd.list_robots() if name not in {*QUICK, "tiago_dual"}]
ARM = rd.load("planar_2r")
UR5 = rd.load("ur5")

needs_cc = pytest.mark.skipif(bool(HOST.missing), reason=f"not installed: {HOST.missing}")


def loaded(name: str) -> rd.Robot:
    """A robot, its warnings ignored."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RobotDynWarning)
        return rd.load(name)


def plant(arm: rd.Robot = ARM, tip: str = "tip") -> rd.Plant:
    """An arm with effects that use tanh, comparisons and parameters of joints, and a payload."""
    effects = rd.effects
    stops = effects.joint_stops(lower=-2.0, upper=2.0, stiffness=500.0, damping=3.0)
    acting = [effects.RegularisedCoulombFriction(0.4), effects.ViscousFriction(0.3), effects.EffortLimit(20.0), *stops]
    return rd.Plant(arm.with_(payload=rd.Payload(tip, 0.7, com=(0.1, 0.0, 0.05))), acting)


@dataclass(frozen=True)
class Written:
    """A source and its text."""

    source: CSource

    @property
    def c(self) -> str:
        return self.source.files[f"{self.source.name}_dynamics.c"]

    @property
    def header(self) -> str:
        return self.source.files[f"{self.source.name}_dynamics.h"]


@needs_cc
@pytest.mark.parametrize("name", [*QUICK, *third(OTHERS), *stress(["tiago_dual"])])
def test_robots_of_the_catalog_pass_their_self_test(name: str, tmp_path: Path) -> None:
    """Built with all warnings as errors. The tolerance is 16 times the largest difference at 10 000 states."""
    try:
        arm = loaded(name)
    except rd.RobotDynError as error:
        pytest.skip(f"is not loaded: {error}")
    source = c_source(arm)
    compiled = library(source, tmp_path)
    needed, kinds = symbols(compiled)
    assert needed <= {*source.math, "sincos"}  # GCC calls sincos for a sine and a cosine
    assert not kinds & WRITABLE
    assert "passed" in self_test(source, tmp_path)
    assert max(x.difference for x in source.functions if x.quantity != "forward_dynamics") < 1e-14


@needs_cc
@pytest.mark.parametrize("name", ["pendulum", *third(sorted(set(QUICK) - SLOW_IN_FLOAT - {"pendulum"}))])
def test_robots_in_float_have_no_operation_in_double(name: str, tmp_path: Path) -> None:
    """`library` makes promotions to double errors. Some hundred operations of 6e-8 add up to less than 1e-6."""
    source = c_source(loaded(name), dtype="float32")
    compiled = library(source, tmp_path)
    assert symbols(compiled)[0] <= {*(x + "f" for x in source.math), "sincosf"}
    assert "passed" in self_test(source, tmp_path)
    assert max(x.difference for x in source.functions if x.quantity != "forward_dynamics") < 1e-6


@needs_cc
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_plants_pass_their_self_test(dtype: str, tmp_path: Path) -> None:
    source = c_source(plant(), dtype=dtype)
    compiled = library(source, tmp_path)
    suffix = "f" if dtype == "float32" else ""
    assert symbols(compiled)[0] <= {*(x + suffix for x in source.math), f"sincos{suffix}"}
    assert "passed" in self_test(source, tmp_path)


@needs_cc
def test_parameters_may_change_without_a_new_export(tmp_path: Path) -> None:
    """C with other coefficients in p, against the interpreted plant with these; rounding, 1e-13 of some 100 N m."""
    source = c_source(plant(), ["M", "N", "forward_dynamics"])
    call(
        "cc",
        "-shared",
        "-fPIC",
        library(source, tmp_path).with_name("planar_2r_dynamics.c"),
        "-lm",
        "-o",
        tmp_path / "l.so",
    )
    functions = ctypes.CDLL(str(tmp_path / "l.so"))
    other = plant(ARM.with_(gravity=(0.0, 0.0, -1.6)))
    twice = [rd.effects.RegularisedCoulombFriction([0.8, 0.2]), *other.effects[1:]]
    changed = rd.Plant(other.dynamics, twice)
    p = np.concatenate([*rd.tools.export.parameter_values(changed).values()])
    assert len(p) == len(np.concatenate([*rd.tools.export.parameter_values(plant()).values()]))
    q, v, u = np.array([[0.3, -0.4], [0.02, -1.5], [1.3, 0.9]])

    def answer(name: str, *arguments: np.ndarray) -> np.ndarray:
        result = np.empty(4 if name == "M" else 2)
        pointers = [x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in (*arguments, result)]
        getattr(functions, f"planar_2r_{name}")(*pointers)
        return result

    assert np.allclose(answer("M", q, p), changed.M(q).ravel(), rtol=1e-13)
    assert np.allclose(answer("N", q, v, p), changed.N(q, v), rtol=1e-13)
    assert np.allclose(answer("forward_dynamics", q, v, u, p), changed.forward_dynamics(q, v, u), rtol=1e-12)


@needs_cc
def test_a_result_may_overwrite_an_argument(tmp_path: Path) -> None:
    source = c_source(UR5, ["N"])
    call(
        "cc", "-shared", "-fPIC", library(source, tmp_path).with_name("ur5_dynamics.c"), "-lm", "-o", tmp_path / "l.so"
    )
    x = np.array([0.3, -0.4, 0.5, 0.6, 0.7, 0.8])
    expected = rd.compiled(UR5).robot.N(x)  # right angles at full precision
    pointer = x.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
    ctypes.CDLL(str(tmp_path / "l.so")).ur5_N(pointer, pointer)
    assert np.allclose(x, expected, rtol=1e-13, atol=1e-13)


@needs_cc
def test_c_of_the_page_compiles(tmp_path: Path) -> None:
    """The controller of docs/how_to/c_for_a_controller.md, with the plant that it names."""
    page = (ROOT / "docs" / "how_to" / "c_for_a_controller.md").read_text(encoding="utf-8")
    gripper = rd.Payload("tool0", 1.0, com=(0.0, 0.0, 0.1))
    effects = [rd.effects.ViscousFriction(0.3), rd.effects.EffortLimit(150.0)]
    c_source(rd.Plant(UR5.with_(payload=gripper), effects), ["N", "inverse_dynamics"]).write(tmp_path)
    blocks = re.findall(r"^```c\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        (tmp_path / "block.c").write_text(block)
        call("cc", *STRICT, "-c", tmp_path / "block.c", "-o", tmp_path / "block.o")


def test_float_has_no_operation_in_double() -> None:
    """Each literal of a number has the suffix f, and each function of <math.h>; the compiler checks the same."""
    text = Written(c_source(plant(UR5, "tool0"), dtype="float32")).c
    body = re.sub(r"#include.*|\w+\[\d+\]", "", text)
    assert "double" not in body
    literals = re.findall(r"(?<![\w.])(\d+\.\d*(?:e[-+]?\d+)?|\d+e[-+]?\d+)(\w?)", body)
    assert literals and all(suffix == "f" for _, suffix in literals)
    called = set(re.findall(r"\b([a-z]\w*)\(", body)) - {f"ur5_{x}" for x in QUANTITIES}
    assert called >= {"sinf", "cosf", "tanhf"} and all(name.endswith("f") for name in called)


@needs_cc
@pytest.mark.skipif(shutil.which("cmake") is None, reason="not installed: cmake")
@pytest.mark.skipif(shutil.which("c++") is None, reason="not installed: c++")
def test_cmake_builds_it_ctest_runs_it_and_cpp_calls_it(tmp_path: Path) -> None:
    c_source(ARM, name="two").write(tmp_path)
    (tmp_path / "main.cpp").write_text('#include "two_dynamics.h"\nint main() { double q[2] = {0, 0}; two_N(q, q); }\n')
    call("cmake", "-S", tmp_path, "-B", tmp_path / "build")
    call("cmake", "--build", tmp_path / "build")
    assert "100% tests passed" in call("ctest", "--test-dir", tmp_path / "build")
    call(
        "c++",
        "-Wall",
        "-Werror",
        tmp_path / "main.cpp",
        tmp_path / "build" / "libtwo_dynamics.a",
        "-lm",
        "-o",
        tmp_path / "m",
    )


@pytest.mark.parametrize("processor", TARGETS)
@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_it_passes_on_other_processors(processor: str, dtype: str, tmp_path: Path) -> None:
    target = TARGETS[processor]
    if target.missing:
        pytest.skip(f"not installed: {target.missing}")
    source = c_source(UR5, dtype=dtype)
    assert not symbols(library(source, tmp_path, target), target)[1] & WRITABLE
    assert "passed" in self_test(source, tmp_path, target)


def test_a_self_test_fails_if_a_number_is_wrong(tmp_path: Path) -> None:
    """One constant of N is changed by 1e-9 of itself."""
    if HOST.missing:
        pytest.skip(f"not installed: {HOST.missing}")
    source = c_source(ARM, ["N"])
    library(source, tmp_path)
    text = Written(source).c
    (number,) = set(re.findall(r"\d+\.\d{3,}", text)[:1])
    (tmp_path / "planar_2r_dynamics.c").write_text(text.replace(number, repr(float(number) * (1 + 1e-9))))
    call("cc", "-c", tmp_path / "planar_2r_dynamics.c", "-o", tmp_path / "dynamics.o")
    with pytest.raises(AssertionError, match="FAILED"):
        self_test(source, tmp_path)


@pytest.mark.parametrize("name", ["planar_2r", "ur5", "panda"])
@pytest.mark.parametrize("quantity", ["M", "N"])
def test_the_bound_holds_at_random_states(name: str, quantity: str) -> None:
    """Errors in float32 and float64 against the same instructions with 200 bits: below the bound, and not far below.

    In the arithmetic of balls a product of n rotations has the size 2ⁿ, hence the factor 1000.
    """
    equations = equations_of(rd.load(name))
    traced = equations.function(quantity)
    program = program_of(traced)
    for dtype, unit in UNITS.items():
        limits = bound(program, [box_of(equations, "q")], unit)
        q = StatesOfArm(dtype, 100, equations).inputs["q"]
        errors = np.abs(evaluated(program, [q], dtype) - exact(program, q)).max(axis=0)
        assert limits is not None and np.all(errors <= limits)
        assert np.max(limits) < 1000 * np.max(errors)


def exact(program: Program, q: np.ndarray) -> np.ndarray:
    """The results of a program without rounding, to 200 bits."""
    old, ctx.prec = ctx.prec, 200
    rows = []
    for row in q.tolist():
        values = dict(enumerate([arb(x) for x in (*row, *program.constants)]))
        for op in program.ops:
            x, *y = (values[k] for k in op.operands)
            one = {
                Kind.ADD: lambda x, y: x + y, Kind.SUBTRACT: lambda x, y: x - y, Kind.MULTIPLY: lambda x, y: x * y,
                Kind.NEGATE: lambda x: -x, Kind.SQUARE: lambda x: x * x, Kind.TWICE: lambda x: x + x,
            }  # fmt: skip
            results = x.sin_cos() if op.kind is Kind.SINE_COSINE else [one[op.kind](x, *y)]
            values |= dict(zip(op.results, results, strict=True))
        rows.append([float(values[k].mid()) for k in program.outputs])
    ctx.prec = old
    return np.array(rows)


def test_bounds_are_stated_below_1e_12() -> None:
    stated = {x.quantity: x.bound for x in c_source(UR5).functions}
    assert {name for name, x in stated.items() if x is not None} == {"M", "N"}
    assert all(x is None or x < 1e-12 for x in stated.values())


@needs_cc
@pytest.mark.parametrize("kind", [kind for kind in Kind if kind is not Kind.SINE_COSINE])
def test_each_instruction_is_the_same_in_c_and_numpy(kind: Kind, tmp_path: Path) -> None:
    """Exact, except functions of the C library, of which NumPy's own differ by some rounding units."""
    numbers = np.array([-1.5, -0.5, -0.0, 0.0, 0.25, 0.5, 0.75, 1.0, 3.0])
    x, y = (z.ravel() for z in np.meshgrid(numbers, numbers))
    operands = (0, 1) if kind in TWO else (0,)
    program = Program((2,), (), (Op(kind, (2,), operands),), (2,))
    body = "\n".join(statements(program, ["q"], {"y": 1}, "float64"))
    (tmp_path / "f.c").write_text(f"#include <math.h>\nvoid f(const double q[2], double y[1]) {{ {body} }}\n")
    call(
        "cc",
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Werror",
        "-shared",
        "-fPIC",
        tmp_path / "f.c",
        "-lm",
        "-o",
        tmp_path / "f.so",
    )
    f = ctypes.CDLL(str(tmp_path / "f.so")).f
    theirs = np.empty(len(x))
    for i in range(len(x)):
        q, result = np.array([x[i], y[i]]), np.empty(1)
        f(*(z.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for z in (q, result)))
        theirs[i] = result[0]
    ours = evaluated(program, [np.stack([x, y], axis=1)], "float64")[:, 0]
    rounding = 4e-16 if math_functions(program) else 0.0
    assert np.allclose(ours, theirs, rtol=rounding, atol=0, equal_nan=True)


TWO = {
    Kind.ADD, Kind.SUBTRACT, Kind.MULTIPLY, Kind.DIVIDE, Kind.MINIMUM, Kind.MAXIMUM, Kind.COPY_SIGN, Kind.REMAINDER,
    Kind.HYPOTENUSE, Kind.POWER, Kind.ARC_TANGENT_OF_TWO, Kind.LESS, Kind.LESS_OR_EQUAL, Kind.EQUAL, Kind.NOT_EQUAL,
    Kind.AND, Kind.OR, Kind.WHERE,
}  # fmt: skip


def test_effects_that_depend_on_the_time_take_it(tmp_path: Path) -> None:
    """A user's own effect, 2 sin(3 t) on joint 1."""
    source = c_source(rd.Plant(ARM, [Shaken()]), ["N", "M"])
    assert source.functions[0].arguments[0] == "t" and "t" not in source.functions[1].arguments
    if not HOST.missing:
        library(source, tmp_path)
        assert "passed" in self_test(source, tmp_path)


@dataclass(frozen=True)
class Shaken(rd.effects.Active):
    """A torque of the time."""

    def torque(self, dynamics: Any, t: Any, q: Any, v: Any) -> Any:
        return 2.0 * np.sin(3.0 * t) * np.array([1.0, 0.0]) + 0 * q

    def thresholds(self, n: int) -> tuple[()]:
        return ()


def test_larger_arms_have_n_and_inverse_dynamics() -> None:
    names = [x.quantity for x in c_source(loaded("allegro_left_hand")).functions]
    assert names == ["N", "inverse_dynamics"]


# --- refusals


def test_effects_that_switch_are_refused() -> None:
    wrench = rd.effects.ExternalWrench("tip", np.ones(6), end_s=1.0)
    with pytest.raises(ExportError, match=wrench.name):
        c_source(rd.Plant(ARM, [wrench]))
    with pytest.raises(ExportError, match="carried_payload"):
        c_source(rd.Plant(ARM, [rd.effects.CarriedPayload(rd.Payload("tip", 1.0), 0.5)]))


def test_set_valued_effects_are_refused() -> None:
    for effect in (rd.effects.DryFriction(0.4), rd.effects.RigidStops(-1.0, 1.0)):
        with pytest.raises(ExportError, match=effect.name):
            c_source(rd.Plant(ARM, [effect]))


def test_effects_with_states_are_refused() -> None:
    with pytest.raises(ExportError, match="actuator_lag"):
        c_source(rd.Plant(ARM, [rd.effects.ActuatorLag(0.01)]))


def test_existing_files_are_kept_without_force(tmp_path: Path) -> None:
    source = c_source(ARM, ["N"])
    source.write(tmp_path / "new" / "folder")
    (kept := tmp_path / "CMakeLists.txt").write_text("mine")
    with pytest.raises(ExportError, match="CMakeLists"):
        source.write(tmp_path)
    assert kept.read_text() == "mine" and len([*tmp_path.iterdir()]) == 2
    source.write(tmp_path, force=True)
    assert kept.read_text() != "mine"
    with pytest.raises(ExportError, match="folder"):
        source.write(kept)


def test_names_that_are_no_identifiers_are_mapped_and_the_map_is_shown(tmp_path: Path) -> None:
    text = ARM.description.xml.decode().replace('"joint_1"', '"joint/1 */"').replace('"joint_2"', '"joint.1 ä"')
    source = c_source(rd.Robot.from_text(text), name="7 dof-arm")
    assert source.name == "arm_7_dof_arm" == source.renamed["7 dof-arm"]
    identifiers = [source.renamed[name] for name in ("joint/1 */", "joint.1 ä")]
    assert len(set(identifiers)) == 2 and all(re.fullmatch(r"\w+", x, re.ASCII) for x in identifiers)
    assert all(name in repr(source) and source.renamed[name] in repr(source) for name in source.renamed)
    assert all(text.isascii() for text in source.files.values())
    if not HOST.missing:
        library(source, tmp_path)


def test_unknown_quantities_and_joints_without_inertia_are_refused() -> None:
    with pytest.raises(QueryError, match="forward_dynamics"):
        c_source(ARM, ["FD"])
    massless = loaded("massless_tip")
    assert "forward_dynamics" not in [x.quantity for x in c_source(massless).functions]
    with pytest.raises(ExportError, match=str(massless.joint_without_inertia)):
        c_source(massless, ["forward_dynamics"])


def test_the_command_writes_the_files_and_prints_the_table(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'robot = "planar_2r"\nduration_s = 1.0\n[[effect]]\nkind = "viscous_friction"\nviscous_N_m_s_per_rad = 0.3\n'
    )
    import_module("robot_dyn.tools.export.command")  # registers it, also where an older version is installed
    done = run("export-c", scene, "-o", tmp_path / "out", "--quantities", "N, M")
    assert done.returncode == 0, done.stderr
    assert "inverse" not in done.stdout and "\nN " in done.stdout and done.stderr.count("written") == 4
    again = run("export-c", scene, "-o", tmp_path / "out", "--quantities", "N", "--force", "--json")
    check_document("export-c", json.loads(again.stdout))
    assert "PLANAR_2R_P_VISCOUS_FRICTION_VISCOUS" in (tmp_path / "out" / "planar_2r_dynamics.h").read_text()
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "planar_2r_dynamics.h", "planar_2r_dynamics.c", "planar_2r_self_test.c", "CMakeLists.txt",
    }  # fmt: skip


def test_the_header_states_gravity_locked_joints_and_payloads() -> None:
    """Of a mount under the ceiling, whose N has the opposite sign."""
    payload = rd.Payload("tip", 0.7, com=(0.1, 0.0, 0.05))
    edited = ARM.with_(gravity=(0.0, 0.0, 9.80665), lock={"joint_2": 0.25}, payload=payload)
    header = Written(c_source(edited, ["N"])).header
    assert "(0, 0, 9.80665) m/s^2" in header
    assert "joint_2 = 0.25" in header and "0.7 kg on tip at (0.1, 0, 0.05) m" in header
