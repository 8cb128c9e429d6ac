"""The tick of a controller as C: equal to the controller's own code, state by state and over runs in closed loop."""

from __future__ import annotations

import ctypes
import json
import re
from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.codegen import SelfCheckError
from robot_dyn.foundations import ExportError, QueryError
from robot_dyn.model import with_exact_right_angles
from robot_dyn.tools.export import CSource, c_source
from tests.command import ROOT, run
from tests.promised import check_document
from tests.tools.export.c_program import HOST, STRICT, TARGETS, WRITABLE, call, library, self_test, symbols

control = rd.control
UR5, _ = with_exact_right_angles(rd.load("ur5"))  # right angles in full, as in C
START = np.array([0.1, -1.2, 1.0, -0.3, 0.5, 0.2])
REFERENCE = control.quintic(START, START + np.array([0.8, 0.5, -0.7, 0.6, -0.5, 0.9]), 0.8)
KP, KD = control.gains_from(np.diag(UR5.M(START)), 12.0)
PERIOD, PERIODS = 1e-3, 1000
PLANT = rd.Plant(UR5, [rd.effects.ViscousFriction(0.5)])
PD = control.PD(REFERENCE, kp=KP, kd=KD, period_s=PERIOD)
PID = control.PID(REFERENCE, kp=KP, ki=3 * KP, kd=KD, effort_limit=[150, 50, 150, 28, 28, 28], period_s=PERIOD)
LAWS = {
    "PD": PD,
    "PID": PID,
    "computed torque": control.ComputedTorque(UR5, REFERENCE, bandwidth_rad_s=15.0, period_s=PERIOD),
    "PD with gravity": control.PDGravity(UR5, REFERENCE, kp=KP, kd=KD, period_s=PERIOD),
    "loop": control.Loop(PID, velocity=(control.Differences(), control.LowPass(200.0))),
    "observer": control.MomentumObserver(PD, UR5, bandwidth_rad_s=30.0),
}

pytestmark = pytest.mark.skipif(bool(HOST.missing), reason=f"not installed: {HOST.missing}")


@cache
def exported(law: str, dtype: str = "float64") -> CSource:
    """The C source of a law."""
    return c_source(LAWS[law], dtype=dtype)


@cache
def simulated(law: str) -> rd.Trajectory:
    """A run of 1000 periods by RK4, one step in each."""
    return rd.simulate(
        PLANT, START, controller=LAWS[law], duration_s=1.0, method="RK4", step_s=PERIOD, estimate_error=False,
        engine="compiled",
    )  # fmt: skip


def states_at_ticks(ran: rd.Trajectory) -> np.ndarray:
    """States z before each tick, from zeros; a run records those after it."""
    after = ran.controller_states
    return np.zeros((PERIODS + 2, 0)) if after is None else np.vstack([0 * after[:1], after])


def pointers(*arrays: np.ndarray) -> list[Any]:
    """Arguments of a C function."""
    return [x.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for x in arrays]


def shared(folder: Path, *files: Path) -> ctypes.CDLL:
    """C files as one library."""
    made = folder / f"{files[0].stem}.so"
    call("cc", *STRICT, "-O2", "-shared", "-fPIC", "-I", folder, *files, "-lm", "-o", made)
    return ctypes.CDLL(str(made))


@dataclass(frozen=True)
class InC:
    """A tick in C, with the values of its parameters."""

    source: CSource
    library: ctypes.CDLL
    p: np.ndarray

    def __call__(self, **inputs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return u and the next states."""
        (function,) = self.source.functions
        u, z_next = np.empty(6), np.empty(len(inputs["z"]))
        arrays = [np.ascontiguousarray(({**inputs, "p": self.p})[x]) for x in function.arguments]
        getattr(self.library, f"{self.source.name}_tick")(*pointers(*arrays, u, *([z_next] if len(z_next) else [])))
        return u, z_next


def in_c(law: str, folder: Path) -> InC:
    """The tick of a law, compiled."""
    source = exported(law)
    source.write(folder)
    (values,) = re.findall(r"_P_VALUES \{(.*)\}", source.files[f"{source.name}_controller.h"])
    p = np.array([float(x.strip("()")) for x in values.split(", ")])
    return InC(source, shared(folder, folder / f"{source.name}_controller.c"), p)


@pytest.mark.parametrize(("law", "dtype"), [*((law, "float64") for law in LAWS), ("PID", "float32")])
def test_ticks_pass_their_self_test(law: str, dtype: str, tmp_path: Path) -> None:
    """All warnings are errors, promotions to double too; no heap, no static data, functions of the header only."""
    source = exported(law, dtype)
    suffix = "f" if dtype == "float32" else ""
    needed, kinds = symbols(library(source, tmp_path))
    assert needed <= {*(x + suffix for x in source.math), f"sincos{suffix}"}
    assert not kinds & WRITABLE
    assert "passed" in self_test(source, tmp_path)


@pytest.mark.parametrize("law", ["PD", "PID", "computed torque"])
def test_each_tick_of_a_run_equals_the_librarys(law: str, tmp_path: Path) -> None:
    """At the 1000 states of a run. PD and PID do the same operations in the same order, so their bits are equal.

    Computed torque in C has 323 operations, ordered otherwise than in Pinocchio: 323 · 1.1e-16 of the largest torque.
    """
    controller, tick, ran = LAWS[law], in_c(law, tmp_path), simulated(law)
    z = states_at_ticks(ran)
    q_d, v_d, a_d = REFERENCE.at(ran.t)
    ours, theirs, following = [], [], []
    for k in range(PERIODS):
        state = ran.t[k], ran.q[k], ran.v[k], z[k]
        u, z_next = tick(q=ran.q[k], v=ran.v[k], q_d=q_d[k], v_d=v_d[k], a_d=a_d[k], z=z[k])
        ours.append([*u, *z_next])
        theirs.append([*controller.torque(*state), *controller.next_state(*state)])
        following.append([*ran.u[k], *z[k + 1]])
    bound = 323 * 2.0**-53 * np.abs(theirs).max() if law == "computed torque" else 0.0
    assert np.abs(np.subtract(ours, theirs)).max() <= bound
    assert np.abs(np.subtract(ours, following)).max() <= 323 * 2.0**-53 * np.abs(theirs).max()  # machine code
    if law == "PID":
        assert (np.abs(np.array(ours)[:, 1]) == 50.0).sum() > 10  # the limit and the anti-windup act


LOOP = """
#include "ur5_dynamics.h"
#include "{name}_controller.h"

static const double of_plant[] = UR5_P_VALUES, of_controller[] = {upper}_P_VALUES;

static void rate(const double y[12], const double u[6], double dy[12])
{{
    for (int i = 0; i < 6; i++) dy[i] = y[6 + i];
    ur5_forward_dynamics(y, y + 6, u, of_plant, dy + 6);
}}

/* From y = (q, v) at tick 0 to that at each tick, by RK4 with one step a period; torque held between ticks. */
void loop(const double *q_d, const double *v_d, const double *a_d, double *y, double *z)
{{
    static const double at[4] = {{0, 0.5, 0.5, 1}}, weight[4] = {{1.0 / 6, 1.0 / 3, 1.0 / 3, 1.0 / 6}};
    const double h = {upper}_PERIOD_S;
    for (int k = 0; k < {periods}; k++, y += 12, q_d += 6, v_d += 6, a_d += 6) {{
        double u[6], slope[12] = {{0}}, sum[12] = {{0}};
        {name}_tick({inputs});
        for (int stage = 0; stage < 4; stage++) {{
            double x[12];
            for (int i = 0; i < 12; i++) x[i] = y[i] + at[stage] * h * slope[i];
            rate(x, u, slope);
            for (int i = 0; i < 12; i++) sum[i] += weight[stage] * slope[i];
        }}
        for (int i = 0; i < 12; i++) y[12 + i] = y[i] + h * sum[i];
    }}
    (void)a_d, (void)z;
}}
"""


@pytest.mark.parametrize("law", ["PD", "PID", "computed torque"])
def test_plant_and_controller_in_c_give_the_librarys_run(law: str, tmp_path: Path) -> None:
    """1000 periods of RK4. Each adds some units of rounding of q, 1e-15, which a stable loop does not amplify."""
    tick, ran = in_c(law, tmp_path), simulated(law)
    c_source(PLANT, ["forward_dynamics"], name="ur5").write(tmp_path, force=True)
    (function,) = tick.source.functions
    named = {"q": "y", "v": "y + 6", "p": "of_controller"}
    inputs = [named.get(x, x) for x in function.arguments] + ["u"] + ["z"] * ("z" in function.arguments)
    name = tick.source.name
    text = LOOP.format(name=name, upper=name.upper(), periods=PERIODS, inputs=", ".join(inputs))
    (tmp_path / "loop.c").write_text(text)
    parts = [tmp_path / x for x in ("loop.c", "ur5_dynamics.c", f"{name}_controller.c")]
    y, z = np.zeros((PERIODS + 1, 12)), np.zeros(6)
    y[0, :6] = START
    shared(tmp_path, *parts).loop(*pointers(*(np.ascontiguousarray(x) for x in REFERENCE.at(ran.t)), y, z))
    assert np.abs(y[:, :6] - ran.q).max() < 1e-12
    assert np.abs(y[-1, :6] - START).max() > 0.4  # it moved
    last = states_at_ticks(ran)[PERIODS]
    assert np.abs(z[: len(last)] - last).max(initial=0.0) < 1e-12 * KP.max()  # z is the integral of 3 kp e


def test_c_of_the_page_compiles(tmp_path: Path) -> None:
    """The firmware of docs/how_to/controller_in_c.md, with a PID in float."""
    exported("PID", "float32").write(tmp_path)
    page = (ROOT / "docs" / "how_to" / "controller_in_c.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```c\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    (tmp_path / "firmware.c").write_text(block)
    call("cc", *STRICT, "-c", tmp_path / "firmware.c", "-o", tmp_path / "firmware.o")


def test_gains_may_change_without_a_new_export(tmp_path: Path) -> None:
    tick = in_c("PD", tmp_path)
    q, v, q_d, v_d = np.random.default_rng(0).normal(size=(4, 6))
    u, _ = replace(tick, p=np.concatenate([2 * KP, KD / 2]))(q=q, v=v, q_d=q_d, v_d=v_d, z=np.zeros(0))
    assert np.allclose(u, 2 * KP * (q_d - q) + KD / 2 * (v_d - v), rtol=1e-14)


def test_states_may_be_overwritten(tmp_path: Path) -> None:
    tick = in_c("PID", tmp_path)
    q, v, q_d, v_d, z = np.random.default_rng(0).normal(size=(5, 6))
    u, z_next = tick(q=q, v=v, q_d=q_d, v_d=v_d, z=z)
    tick.library.pid_tick(*pointers(q, v, q_d, v_d, z, tick.p, q, z))
    assert np.array_equal(q, u) and np.array_equal(z, z_next)


def test_inputs_that_a_law_does_not_use_are_left_out() -> None:
    """A reference at rest leaves v_d an input: in C it may move."""
    at_rest = control.PD(control.hold(START), kp=1.0, kd=1.0, period_s=PERIOD)
    assert c_source(at_rest).functions[0].arguments == ("q", "v", "q_d", "v_d", "p")
    damping = control.ControlLaw(lambda t, q, v: -2.0 * v, 6)
    assert c_source(damping).functions[0].arguments == ("q", "v")
    source = c_source(control.ControlLaw(lambda t, q, v: np.sin(t) * np.ones(2), 2), name="shaker")
    assert source.functions[0].arguments == ("t", "q", "v") and source.math == ("cos", "sin")


def test_references_of_a_frame_are_inputs() -> None:
    arm = rd.load("planar_2r")
    line = control.line([1.0, 0.5, 0.0], [0.5, 1.0, 0.0], 1.0)
    law = control.OperationalSpace(arm, "tip", line, kp=100.0, kd=20.0, rows=(0, 1), period_s=PERIOD)
    arguments = c_source(law).functions[0].arguments
    assert {"reference_position", "reference_position_rate", "reference_position_rate2"} < {*arguments}


def test_the_header_states_period_and_constants() -> None:
    header = exported("PID", "float32").files["pid_controller.h"]
    assert "#define PID_PERIOD_S 0.001f" in header
    assert re.search(r"Constant of the code: tracking_time_s: \S+ s", header)
    assert "PID_SIZE_Z = 6" in header and header.isascii()


@pytest.mark.long
@pytest.mark.parametrize("processor", TARGETS)
def test_ticks_pass_on_other_processors(processor: str, tmp_path: Path) -> None:
    if (target := TARGETS[processor]).missing:
        pytest.skip(f"not installed: {target.missing}")
    for dtype in ("float64", "float32"):
        source = exported("computed torque", dtype)
        assert not symbols(library(source, tmp_path / dtype, target), target)[1] & WRITABLE
        assert "passed" in self_test(source, tmp_path / dtype, target)


# --- refusals


@dataclass(frozen=True, eq=False)
class Ahead(control.Stateless):
    """A law that looks ahead in its reference."""

    reference: control.PiecewisePolynomial = REFERENCE

    @property
    def n(self) -> int:
        return self.reference.n

    def torque(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        return self.reference.at(t + 0.1)[0] - q


def test_laws_that_c_cannot_have_are_refused() -> None:
    with pytest.raises(ExportError, match="period_s"):
        c_source(PID.at_period(0.0))
    delayed = control.Loop(PD, measurement_delay_periods=1.0)
    with pytest.raises(ExportError, match="measurement_delay_periods=0"):
        c_source(delayed)
    with pytest.raises(ExportError, match="Noise"):
        c_source(control.Loop(PD, position=(control.Noise(1e-4),)))
    with pytest.raises(ExportError, match="at a time other"):
        c_source(Ahead())
    with pytest.raises(ExportError, match="float"):
        c_source(control.ControlLaw(lambda t, q, v: np.array([float(x) for x in q]), 6))
    with pytest.raises(SelfCheckError, match="differs"):  # other numbers than symbols
        c_source(control.ControlLaw(lambda t, q, v: q + isinstance(q[0], float), 6))
    with pytest.raises(QueryError, match="quantities"):
        c_source(PD, ["M"])
    assert c_source(replace(delayed, measurement_delay_periods=0.0)).functions


def test_the_command_writes_the_tick_of_a_scene(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    scene.write_text(
        'robot = "planar_2r"\nduration_s = 1.0\n[control]\nkind = "pd"\nperiod_s = 0.001\nkp = 30.0\n'
        'kd = 3.0\n[reference]\nkind = "hold"\nq = [0.1, 0.2]\n'
    )
    import_module("robot_dyn.tools.export.command")  # registers it, also where an older version is installed
    done = run("export-c", scene, "--controller", "-o", tmp_path / "out", "--json")
    assert done.returncode == 0, done.stderr
    check_document("export-c", json.loads(done.stdout))
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        "pd_controller.h", "pd_controller.c", "pd_self_test.c", "CMakeLists.txt",
    }  # fmt: skip
    assert run("export-c", "ur5", "--controller", "-o", tmp_path / "out").returncode != 0
